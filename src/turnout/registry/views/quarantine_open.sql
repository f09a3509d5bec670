-- One row per recording, or part of one, that is in quarantine now; repaired ones are left out.
-- needs: superseded
create or replace view quarantine_open as
select q.*, r.meaning as reason
from quarantine q anti join superseded s on q.quarantine_id = s.old_id
    left join reasons r using (reason_code);
