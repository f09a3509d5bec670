-- One row per section, band and quantity (frequency, damping) of its hammer tests: the scatter between its campaigns.
-- Scatter: steps from campaign to campaign of ln f or ln zeta in one epoch, without their slope over the steps of rail
-- temperature; half their variance (von Neumann 1941), so that a slow change does not count. A step beyond six robust
-- standard deviations is a change, and left out. Two thirds of a degree of freedom for each step. The mean of the fleet
-- for the band counts as one further degree of freedom (unit information prior, Kass and Wasserman 1995).
-- Less than seven steps are no history.
-- needs: epochs
create or replace view mode_points as
select
    model_id, turnout_id, section_id, band, measured_at_utc, epoch, rail_temperature_c, 'frequency' as quantity,
    ln(frequency_hz) as log_value, frequency_repeatability_hz / frequency_hz as repeatability
from epochs where source = 'hammer' and frequency_repeatability_hz is not null
union all
select
    model_id, turnout_id, section_id, band, measured_at_utc, epoch, rail_temperature_c, 'damping',
    ln(damping_ratio), damping_repeatability / damping_ratio
from epochs where source = 'hammer' and damping_repeatability is not null and damping_ratio > 0;

create or replace view mode_scatter as
with moves as (
    select
        section_id, band, quantity, repeatability,
        log_value - lag(log_value) over history as step,
        rail_temperature_c - lag(rail_temperature_c) over history as warmer
    from mode_points
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
fleet as (select band, quantity, avg(between_variance) as fleet_variance from sections group by all)
select
    section_id, band, quantity, n_steps, 1 + freedom as freedom,
    sqrt((fleet_variance + freedom * between_variance) / (1 + freedom)) as between_sd
from sections join fleet using (band, quantity);

-- columns of mode_points
-- model_id | varchar | | model
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- measured_at_utc | timestamp | UTC | time of the campaign
-- epoch | bigint | | epoch of the chart, 0 before the first event that resets it
-- rail_temperature_c | double | °C | rail temperature of the campaign
-- quantity | varchar | | frequency or damping
-- log_value | double | | ln of the frequency in Hz, or of the damping ratio
-- repeatability | double | | relative standard error from the scatter of the impacts of the campaign

-- columns of mode_scatter
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- quantity | varchar | | frequency or damping
-- n_steps | bigint | | steps from campaign to campaign behind it; at least seven are needed
-- freedom | double | | degrees of freedom of between_sd
-- between_sd | double | | relative standard deviation between the campaigns of the section beyond their repeatability
