-- One row per recording that counts: without what was computed again since.
-- needs: superseded
create or replace view recordings_current as
select t.*
from recordings t anti join superseded s on t.result_id = s.old_id;
