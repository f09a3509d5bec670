-- One row per chart and campaign: the values that the charts are made of, with their own error bars.
-- Bands ballast_damping and railpad_damping hold damping ratios in percent of critical damping, amplitude accelerations.
-- source hammer: modes of hammer tests, method joint. source passage: passage_values. Never one chart.
-- needs: modes_current, passage_values
create or replace view chart_values as
select
    turnout_id, section_id, band, source, measured_at_utc, frequency_hz, frequency_se_hz, rail_temperature_c
from modes_current
where source = 'hammer' and coalesce(method, 'joint') = 'joint'
union all
select
    turnout_id, section_id, band || '_damping', source, measured_at_utc, 100 * damping_ratio, 100 * damping_se,
    rail_temperature_c
from modes_current
where source = 'hammer' and coalesce(method, 'joint') = 'joint' and damping_se is not null
    and band in ('ballast', 'railpad')
union all
select * from passage_values;

-- columns of chart_values
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | resonance, or 'amplitude'
-- source | varchar | | what it was identified from
-- measured_at_utc | timestamp | UTC | time of the campaign; Monday of the week for source passage
-- frequency_hz | double | Hz | value of the campaign or week; m/s² for band 'amplitude'
-- frequency_se_hz | double | Hz | its standard error, in the same unit
-- rail_temperature_c | double | °C | rail temperature, mean of the week for source passage
