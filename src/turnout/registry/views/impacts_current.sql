-- One row per impact that counts: without what was computed again since.
-- needs: superseded
create or replace view impacts_current as
select t.*
from impacts t anti join superseded s on t.result_id = s.old_id;
