-- One row per computed unit that counts: without what was computed again since.
-- needs: superseded
create or replace view results_current as
select t.*
from results t anti join superseded s on t.result_id = s.old_id;

-- columns of results_current
-- result_id | varchar | | content id: unit, key
-- unit_id | varchar | | what was computed at once: turnout/kind/label
-- turnout_id | varchar | | turnout
-- kind | varchar | | hammer, passage, or the part that made it
-- label | varchar | | section and campaign, or passage file
-- unit_key | varchar | | key of the computation: files, configuration, code
-- inputs_hash | varchar | | hash of the raw files
-- config_hash | varchar | | hash of the merged configuration
-- code_version | varchar | | version of the code of its stages
-- n_rows | integer | | rows it brought
-- run_id | varchar | | content id of the batch
