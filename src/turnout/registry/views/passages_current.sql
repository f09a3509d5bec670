-- One row per passage that counts: without what was computed again since.
-- needs: superseded
create or replace view passages_current as
select t.*
from passages t anti join superseded s on t.passage_id = s.old_id;

-- columns of passages_current
-- passage_id | varchar | | content id of the passage
-- turnout_id | varchar | | turnout
-- recording_id | varchar | | recording it was found in
-- passed_at_utc | timestamp | UTC | first axle at the turnout's origin
-- status | varchar | | used, used as far as intact, or not used
-- reason | varchar | | first reason where not accepted
-- reason_codes | varchar[] | | codes of all reasons, see docs/reasons.md; no element where accepted
-- detail | varchar | | all findings in words
-- n_axles | integer | | axles counted
-- speed_kmh | double | km/h | speed halfway through the passage
-- speed_se_kmh | double | km/h | standard error of speed_kmh
-- acceleration_ms2 | double | m/s² | change of speed during the passage
-- speed_source | varchar | | where the speed comes from
-- speed_listed_kmh | double | km/h | speed in the train data, where given
-- direction | varchar | | direction of travel through the turnout
-- track | varchar | | track taken
-- train_type | varchar | | type of train, 'unknown' where no template fits
-- train_type_probability | double | | posterior probability of the type
-- train_type_source | varchar | | where the type comes from
-- train_type_listed | varchar | | type in the train data, where given
-- axle_load_t | double | t | mean axle load; empty where not available
-- axle_load_se_t | double | t | standard error of axle_load_t
-- axle_load_source | varchar | | where the load comes from
-- axle_load_listed_t | double | t | axle load in the train data, where given
-- axle_times_s | double[] | s | axle times at the turnout's origin from the start of the recording
-- cluster_id | varchar | | cluster of like passages
-- rail_temperature_c | double | °C | rail temperature
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch
