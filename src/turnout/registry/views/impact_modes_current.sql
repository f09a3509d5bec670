-- One row per mode and impact that counts: without what was computed again since.
-- needs: superseded
create or replace view impact_modes_current as
select * from impact_modes_settled
union all
select t.* from impact_modes_touched t anti join superseded s on t.model_id = s.old_id;

-- columns of impact_modes_current
-- model_id | varchar | | model
-- impact_id | varchar | | impact
-- band | varchar | | which resonance
-- section_id | varchar | | section
-- measured_at_utc | timestamp | UTC | time of the campaign
-- frequency_hz | double | Hz | natural frequency from this impact
-- frequency_se_hz | double | Hz | its standard error from the noise of this impact
-- damping_ratio | double | | damping ratio from this impact
-- damping_se | double | | its standard error from the noise of this impact
-- run_id | varchar | | content id of the batch
