-- One row per passage, sensor and model that counts: neither passage nor model was computed again since.
-- needs: superseded
create or replace view passage_fits_current as
select * from passage_fits_settled
union all
select t.*
from passage_fits_touched t
    anti join superseded s on t.passage_id = s.old_id
    anti join superseded m on t.model_id = m.old_id;
