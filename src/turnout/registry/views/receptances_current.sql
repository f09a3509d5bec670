-- One row per receptance that counts: without what was computed again since.
-- needs: superseded
create or replace view receptances_current as
select t.*
from receptances t anti join superseded s on t.model_id = s.old_id;
