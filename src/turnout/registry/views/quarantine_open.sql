-- One row per recording, or part of one, that is in quarantine now; repaired ones are left out, and those of turnouts that
-- have no row in turnouts.tsv any more.
-- needs: superseded, in_service
create or replace view quarantine_open as
select q.*, r.meaning as reason, coalesce(r.is_remark, false) as is_remark
from quarantine q anti join superseded s on q.quarantine_id = s.old_id
    left join reasons r using (reason_code)
where coalesce(in_service(q.turnout_id), true)
    -- a row about a turnout that never had a result is a typing error
    or q.reason_code = 'not_counted' and q.turnout_id not in (select turnout_id from results);

-- columns of quarantine_open
-- quarantine_id | varchar | | content id: path, record, stage, reason, file
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- kind | varchar | | kind of recording
-- path | varchar | | file, relative to the raw root
-- record | integer | | record within the file; empty = the whole file
-- recording_id | varchar | | content id of the file, where it could be read
-- stage | varchar | | stage that found it
-- reason_code | varchar | | code, see docs/reasons.md
-- place | varchar | | place in the file
-- channels | varchar[] | | channels of a passage that the reason concerns: one, or two that are exchanged; empty = the whole record
-- found | varchar | | what was found there
-- remedy | varchar | | what to do
-- measured_value | double | | number behind the reason
-- threshold | double | | limit it was compared with
-- result_id | varchar | | result (unit and key) that it came with
-- run_id | varchar | | content id of the batch
-- reason | varchar | | what the code means
-- is_remark | boolean | | whether the recording is used all the same
