-- One row per impact that counts: without what was computed again since.
-- needs: superseded
create or replace view impacts_current as
select t.*
from impacts t anti join superseded s on t.result_id = s.old_id;

-- columns of impacts_current
-- impact_id | varchar | | recording_id:record
-- recording_id | varchar | | recording
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- campaign_id | varchar | | campaign
-- test | integer | | test within the campaign
-- record | integer | | record within the file, from 0
-- status | varchar | | used or not
-- reason | varchar | | first reason of the rejection, see docs/reasons.md
-- measured_value | double | | number behind the reason
-- limit_value | double | | limit it was compared with
-- detail | varchar | | all reasons and notes in words
-- peak_n | double | N | peak force
-- contact_ms | double | ms | length of the contact
-- impulse_ns | double | N s | impulse of the impact
-- noise_ms2 | double | m/s² | rms acceleration before the impact
-- band_edge_hz | double | Hz | frequency at which the force spectrum has fallen by 20 dB
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch
