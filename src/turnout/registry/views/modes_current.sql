-- One row per mode that counts: without what was computed again since.
-- needs: superseded
create or replace view modes_current as
select * from modes_settled
union all
select t.* from modes_touched t anti join superseded s on t.model_id = s.old_id;

-- columns of modes_current
-- model_id | varchar | | model
-- band | varchar | | which resonance
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- measured_at_utc | timestamp | UTC | time of the campaign
-- method | varchar | | method of its model; charts use joint only
-- frequency_hz | double | Hz | undamped natural frequency, mean over impacts
-- frequency_se_hz | double | Hz | standard error of frequency_hz from the spread of its impacts and the choice among explanations
-- frequency_sd_hz | double | Hz | between-impact spread beyond the estimation error
-- damping_ratio | double | | damping ratio, mean over impacts
-- damping_se | double | | standard error of damping_ratio
-- rail_temperature_c | double | °C | rail temperature of the campaign
-- n_impacts | integer | | impacts (method frf: responses) behind the value
-- source | varchar | | what it was identified from
-- run_id | varchar | | content id of the batch
-- frequency_repeatability_hz | double | Hz | part of frequency_se_hz from the scatter of the impacts of the campaign
-- frequency_systematic_hz | double | Hz | part of frequency_se_hz from what the modes leave of all impacts alike, the choice among explanations, and a second pole that is not resolved
-- damping_repeatability | double | | part of damping_se from the scatter of the impacts of the campaign
-- damping_systematic | double | | part of damping_se from what the modes leave of all impacts alike, the choice among explanations, and a second pole that is not resolved
-- stiffness_mn_m | double | MN/m | dynamic stiffness at the resonance; empty where the line fails the gate, and behind an exponential window
-- stiffness_low_mn_m | double | MN/m | lower 95 % limit of stiffness_mn_m
-- stiffness_high_mn_m | double | MN/m | upper 95 % limit of stiffness_mn_m; empty where there is none
-- a_block | double[] | | a11, a12, a21, a22 of this mode (Tables 1 and 2 of the paper)
-- a_block_se | double[] | | their standard errors
-- c_block | double[] | | c1, c2 of this mode (Tables 1 and 2 of the paper)
-- c_block_se | double[] | | their standard errors; empty without a fitted receptance
-- shape_ratio | double[] | | real and imaginary part of the amplitude at the second response over that at the first; empty where the layout has none
-- shape_covariance | double[] | | variance of the real part, covariance, variance of the imaginary part of shape_ratio, from the spread of the impacts
-- n_shape | integer | | impacts behind shape_ratio
