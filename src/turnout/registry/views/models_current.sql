-- One row per model that counts: without what was computed again since.
-- needs: superseded
create or replace view models_current as
select t.*
from models t anti join superseded s on t.model_id = s.old_id;

-- columns of models_current
-- model_id | varchar | | content id: inputs, configuration, code
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- campaign_id | varchar | | campaign
-- measured_at_utc | timestamp | UTC | time of the campaign
-- method | varchar | | joint: both modes on the unfiltered decay; paper: 200 Hz split, 2 + 2; frf: averaged frequency responses, no impact could be checked
-- status | varchar | | what the model is good for
-- reason | varchar | | first reason of a rejection
-- measured_value | double | | number behind the reason
-- limit_value | double | | limit it was compared with
-- detail | varchar | | reasons, rejected modes and, for method paper, its simulated bias, in words
-- model_order | integer | | number of states
-- sampling_rate_hz | double | Hz | rate of the state-space model
-- a_matrix | double[] | | A, row by row
-- b_vector | double[] | | b
-- c_vector | double[] | | c
-- n_impacts_used | integer | | accepted impacts
-- n_impacts_rejected | integer | | rejected impacts
-- coherence_minimum | double | | lowest gate level over the bands of the modes
-- hammer_fit_pct | double | % | fit on the hammer decays left out, median
-- hammer_fit_null_pct | double | % | 95 % quantile of the same fit with random pole pairs
-- code_version | varchar | | version of the stage that computed it
-- config_hash | varchar | | hash of the merged configuration
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch
-- validation_fit_pct | double | % | fit of the same modes to the second response, which took no part in the identification, median; empty where the layout has none
-- n_validation | integer | | impacts behind validation_fit_pct
