-- One row per recording that counts: without what was computed again since.
-- needs: superseded
create or replace view recordings_current as
select t.*
from recordings t anti join superseded s on t.result_id = s.old_id;

-- columns of recordings_current
-- recording_id | varchar | | first 128 bits of sha256 of the file's bytes, hex
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section of a hammer test; empty for a passage
-- campaign_id | varchar | | campaign of a hammer test
-- passage_id | varchar | | passage
-- kind | varchar | | what was recorded
-- path | varchar | | file, relative to the raw root
-- file_format | varchar | | reader that read it
-- file_bytes | bigint | byte | size of the file
-- sampling_rate_hz | double | Hz | samples per second
-- n_channels | integer | | channels read
-- n_records | integer | | intact records read
-- n_samples | bigint | | samples per record and channel
-- expected_n_samples | bigint | | samples configured; empty = not configured
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch that brought the row
