-- One row per campaign of one section and resonance: its chart, with epochs, oldest first.
-- needs: epochs
create or replace macro section_trend(section, resonance) as table
select
    m.measured_at_utc, m.frequency_hz, m.frequency_se_hz, m.damping_ratio, m.damping_se, m.n_impacts,
    m.rail_temperature_c, m.source, coalesce(e.epoch, 0) as epoch, e.event_at_utc as epoch_start_utc,
    e.kind as epoch_kind, m.model_id
from modes_current m
    asof left join (select * from resets r where r.section_id = section and r.band = resonance) e
    on m.section_id = e.section_id and m.band = e.band and m.measured_at_utc >= e.event_at_utc
where m.section_id = section and m.band = resonance and coalesce(m.method, 'joint') = 'joint'
order by m.measured_at_utc, m.source;

-- columns of section_trend(section, resonance)
-- measured_at_utc | timestamp | UTC | time of the campaign
-- frequency_hz | double | Hz | undamped natural frequency, mean over impacts
-- frequency_se_hz | double | Hz | standard error of frequency_hz from the spread of its impacts and the choice among explanations
-- damping_ratio | double | | damping ratio, mean over impacts
-- damping_se | double | | standard error of damping_ratio
-- n_impacts | integer | | impacts (method frf: responses) behind the value
-- rail_temperature_c | double | °C | rail temperature of the campaign
-- source | varchar | | what it was identified from
-- epoch | bigint | | epoch of the chart, 0 before the first event that resets it
-- epoch_start_utc | timestamp | UTC | event that started the epoch; empty for epoch 0
-- epoch_kind | varchar | | what was done then
-- model_id | varchar | | model
