-- One row per mode and impact that counts: without what was computed again since.
-- needs: superseded
create or replace view impact_modes_current as
select * from impact_modes_settled
union all
select t.* from impact_modes_touched t anti join superseded s on t.model_id = s.old_id;
