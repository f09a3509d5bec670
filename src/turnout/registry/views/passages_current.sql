-- One row per passage that counts: without what was computed again since.
-- needs: superseded
create or replace view passages_current as
select t.*
from passages t anti join superseded s on t.passage_id = s.old_id;
