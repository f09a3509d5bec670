-- One row per model that counts: without what was computed again since.
-- needs: superseded
create or replace view models_current as
select t.*
from models t anti join superseded s on t.model_id = s.old_id;
