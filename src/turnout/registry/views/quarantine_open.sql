-- One row per recording, or part of one, that is in quarantine now; repaired ones are left out, and those of turnouts that
-- have no row in turnouts.tsv any more.
-- needs: superseded, in_service
create or replace view quarantine_open as
select q.*, r.meaning as reason
from quarantine q anti join superseded s on q.quarantine_id = s.old_id
    left join reasons r using (reason_code)
where coalesce(in_service(q.turnout_id), true);
