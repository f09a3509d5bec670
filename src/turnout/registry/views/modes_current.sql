-- One row per mode that counts: without what was computed again since.
-- needs: superseded
create or replace view modes_current as
select * from modes_settled
union all
select t.* from modes_touched t anti join superseded s on t.model_id = s.old_id;
