-- One row per computed unit that counts: without what was computed again since.
-- needs: superseded
create or replace view results_current as
select t.*
from results t anti join superseded s on t.result_id = s.old_id;
