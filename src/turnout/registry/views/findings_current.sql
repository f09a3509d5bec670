-- One row per finding that counts: without what was computed again since.
-- needs: superseded
create or replace view findings_current as
select t.*
from mismatch_findings t anti join superseded s on t.finding_id = s.old_id;
