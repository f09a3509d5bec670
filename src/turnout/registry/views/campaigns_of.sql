-- One row per section of a turnout and campaign: what was measured and how much of it could be used, newest first.
-- needs: models_current, modes_current
create or replace macro campaigns_of(turnout) as table
select
    o.campaign_id, o.measured_at_utc, o.section_id, o.status, o.reason, o.n_impacts_used, o.n_impacts_rejected,
    o.coherence_minimum, o.hammer_fit_pct, o.hammer_fit_null_pct, c.rail_temperature_c,
    max(m.frequency_hz) filter (m.band = 'ballast') as ballast_hz,
    max(m.frequency_se_hz) filter (m.band = 'ballast') as ballast_se_hz,
    max(m.frequency_hz) filter (m.band = 'railpad') as railpad_hz,
    max(m.frequency_se_hz) filter (m.band = 'railpad') as railpad_se_hz
from models_current o left join modes_current m using (model_id) left join campaigns c on c.campaign_id = o.campaign_id
where o.turnout_id = turnout and o.method = 'joint'
group by all
order by o.measured_at_utc desc, o.section_id;

-- columns of campaigns_of(turnout)
-- campaign_id | varchar | | campaign
-- measured_at_utc | timestamp | UTC | time of the campaign
-- section_id | varchar | | section
-- status | varchar | | what the model is good for
-- reason | varchar | | first reason of a rejection
-- n_impacts_used | integer | | accepted impacts
-- n_impacts_rejected | integer | | rejected impacts
-- coherence_minimum | double | | lowest gate level over the bands of the modes
-- hammer_fit_pct | double | % | fit on the hammer decays left out, median
-- hammer_fit_null_pct | double | % | 95 % quantile of the same fit with random pole pairs
-- rail_temperature_c | double | °C | rail temperature noted for the campaign
-- ballast_hz | double | Hz | frequency of the ballast resonance
-- ballast_se_hz | double | Hz | its standard error
-- railpad_hz | double | Hz | frequency of the railpad resonance
-- railpad_se_hz | double | Hz | its standard error
