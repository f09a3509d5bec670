-- One row per damping ratio and campaign: measured, expected at its temperature, and the 95 % band of one campaign.
-- band is the resonance.
-- A value belongs to the last campaign that began before it, the first value of a campaign is shown.
-- needs: chart_values, half_band_pct
create or replace view damping_charts as
with banded as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.epoch, c.residual_pct, c.z, c.state,
        b.damping_ratio as baseline_damping,
        half_band_pct(c.residual_pct, c.z, b.phi, b.guard, b.sd_pct) as half_pct
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
    where ends_with(c.band, '_damping') and c.section_id <> '*'
)
select
    c.turnout_id, c.section_id, replace(c.band, '_damping', '') as band, c.source, c.measured_at_utc, c.epoch,
    v.frequency_hz / 100 as damping_ratio, v.frequency_se_hz / 100 as damping_se,
    v.frequency_hz / 100 - c.baseline_damping * c.residual_pct / 100 as expected_damping,
    expected_damping - c.baseline_damping * c.half_pct / 100 as expected_low_damping,
    expected_damping + c.baseline_damping * c.half_pct / 100 as expected_high_damping,
    c.residual_pct, c.z, c.state
from banded c
    asof join chart_values v
    on v.turnout_id = c.turnout_id and v.section_id = c.section_id and v.band = c.band and v.source = c.source
        and c.measured_at_utc <= v.measured_at_utc;

-- columns of damping_charts
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- measured_at_utc | timestamp | UTC | start of the campaign
-- epoch | integer | | epoch of the chart, 0 from the first campaign
-- damping_ratio | double | | damping ratio of the campaign
-- damping_se | double | | its standard error
-- expected_damping | double | | expected at this temperature; empty without temperature
-- expected_low_damping | double | | lower end of the 95 % band of one campaign
-- expected_high_damping | double | | upper end
-- residual_pct | double | % | measured minus expected, of the baseline's damping ratio
-- z | double | | residual in its guarded standard deviations with memory
-- state | varchar | | state of the chart after this campaign
