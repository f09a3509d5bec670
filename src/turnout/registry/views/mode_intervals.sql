-- One row per mode of a hammer test and quantity (frequency, damping): its 95 % interval from the history of its section.
-- The error has two parts: the repeatability of the campaign, and the scatter between the campaigns of the section
-- beyond it. That scatter is one for all of them, so the interval does not depend on which rival explanations a
-- campaign happened to have. It contains no error that is the same in all campaigns: compare campaigns by it.
-- Scatter: steps from campaign to campaign of ln f or ln zeta in one epoch, without their slope over the steps of rail
-- temperature; half their variance (von Neumann 1941), so that a slow change does not count. A step beyond six robust
-- standard deviations is a change, and left out. Two thirds of a degree of freedom for each step. The mean of the fleet
-- for the band counts as one further degree of freedom (unit information prior, Kass and Wasserman 1995).
-- Less than seven steps are no history.
-- needs: epochs, students_t
create or replace view mode_intervals as
with points as (
    select
        model_id, turnout_id, section_id, band, measured_at_utc, epoch, rail_temperature_c, 'frequency' as quantity,
        ln(frequency_hz) as log_value, frequency_repeatability_hz / frequency_hz as repeatability
    from epochs where source = 'hammer' and frequency_repeatability_hz is not null
    union all
    select
        model_id, turnout_id, section_id, band, measured_at_utc, epoch, rail_temperature_c, 'damping',
        ln(damping_ratio), damping_repeatability / damping_ratio
    from epochs where source = 'hammer' and damping_repeatability is not null and damping_ratio > 0
),
moves as (
    select
        section_id, band, quantity, repeatability,
        log_value - lag(log_value) over history as step,
        rail_temperature_c - lag(rail_temperature_c) over history as warmer
    from points
    window history as (partition by section_id, band, quantity, epoch order by measured_at_utc)
),
slopes as (
    select
        section_id, band, quantity, avg(repeatability ^ 2) as repeatability_variance,
        coalesce(sum(step * warmer) / nullif(sum(warmer ^ 2) filter (where step is not null), 0), 0) as slope
    from moves group by all
),
residuals as (
    select
        section_id, band, quantity, repeatability_variance, step - slope * coalesce(warmer, 0) as residual,
        median(abs(step - slope * coalesce(warmer, 0))) over (partition by section_id, band, quantity) as middle
    from moves join slopes using (section_id, band, quantity) where step is not null
),
sections as (
    select
        section_id, band, quantity, count(*) as n_steps, 2.0 * (count(*) - 1) / 3.0 as freedom,
        greatest(0, sum(residual ^ 2) / (count(*) - 1) / 2 - any_value(repeatability_variance)) as between_variance
    from residuals where abs(residual) <= 6 * 1.4826 * middle
    group by all having count(*) >= 7
),
fleet as (select band, quantity, avg(between_variance) as fleet_variance from sections group by all),
pooled as (
    select
        section_id, band, quantity, n_steps, 1 + freedom as freedom,
        sqrt((fleet_variance + freedom * between_variance) / (1 + freedom)) as between_sd
    from sections join fleet using (band, quantity)
)
select
    p.section_id, p.turnout_id, p.band, p.quantity, p.measured_at_utc, exp(p.log_value) as value,
    exp(p.log_value - students_t(freedom) * sqrt(p.repeatability ^ 2 + between_sd ^ 2)) as value_low,
    exp(p.log_value + students_t(freedom) * sqrt(p.repeatability ^ 2 + between_sd ^ 2)) as value_high,
    100 * p.repeatability as repeatability_pct, 100 * between_sd as between_campaigns_pct, n_steps, freedom, p.model_id
from points p join pooled using (section_id, band, quantity)
order by p.section_id, p.band, p.quantity, p.measured_at_utc;

-- columns of mode_intervals
-- section_id | varchar | | section
-- turnout_id | varchar | | turnout
-- band | varchar | | which resonance
-- quantity | varchar | | frequency [Hz] or damping [-]
-- measured_at_utc | timestamp | UTC | time of the campaign
-- value | double | | frequency in Hz, or damping ratio
-- value_low | double | | lower 95 % limit, in the unit of value
-- value_high | double | | upper 95 % limit, in the unit of value
-- repeatability_pct | double | % | standard error from the scatter of the impacts of the campaign
-- between_campaigns_pct | double | % | standard deviation between the campaigns of the section beyond their repeatability
-- n_steps | bigint | | steps from campaign to campaign behind it; at least seven are needed
-- freedom | double | | degrees of freedom of the interval
-- model_id | varchar | | model
