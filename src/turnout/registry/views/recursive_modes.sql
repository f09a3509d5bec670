-- One row per mode of a chart and campaign: frequency and damping ratio estimated recursively since the last event.
-- m(n) = m(n-1) + w(n) (x(n) - m(n-1)) / W(n), W(n) = w(n) + W(n-1) exp(-(t(n) - t(n-1)) / 180 d): recursive least
-- squares with exponential forgetting, the steady state of a Kalman filter of a level that walks at random. w(n) is
-- error_weight with the median error of the campaigns so far: one with a large error does not move the level. The standard error is from
-- the weighted scatter of the campaigns and their effective number W^2 / sum of squared weights; empty for the first.
-- Not corrected for temperature, which charts are.
-- needs: epochs, campaign_weight
create or replace view recursive_modes as
with weighted as (
    select
        turnout_id, section_id, band, source, measured_at_utc, epoch, frequency_hz, damping_ratio, rail_temperature_c,
        error_weight(frequency_se_hz, median(frequency_se_hz) over past) as w_f,
        error_weight(damping_se, median(damping_se) over past) as w_d
    from epochs
    where band in ('ballast', 'railpad')
    window past as (
        partition by section_id, band, source, epoch order by measured_at_utc
        rows between unbounded preceding and current row
    )
),
aged as (
    select
        *, frequency_hz - min(frequency_hz) over chart as f, damping_ratio - min(damping_ratio) over chart as d,
        min(frequency_hz) over chart as f_0, min(damping_ratio) over chart as d_0,
        -- weights relative to the newest campaign of the epoch; the oldest may fall to 0
        exp(greatest(-date_diff('second', measured_at_utc, max(measured_at_utc) over chart) / (180 * 86400.0), -300))
            as age,
        w_f * age as u_f, w_d * age as u_d
    from weighted
    window chart as (partition by section_id, band, source, epoch)
),
summed as (
    select
        *, sum(u_f) over past as wf, sum(u_f * u_f) over past as wwf,
        sum(u_d) over past as wd, sum(u_d * u_d) over past as wwd,
        sum(u_f * f) over past / sum(u_f) over past as f_mean,
        sum(u_f * f * f) over past / sum(u_f) over past as f_square,
        sum(u_d * d) over past / sum(u_d) over past as d_mean,
        sum(u_d * d * d) over past / sum(u_d) over past as d_square
    from aged
    window past as (
        partition by section_id, band, source, epoch order by measured_at_utc
        rows between unbounded preceding and current row
    )
)
select
    turnout_id, section_id, band, source, measured_at_utc, epoch, frequency_hz, f_0 + f_mean as frequency_recursive_hz,
    case when wf * wf > 1.001 * wwf then sqrt(greatest(f_square - f_mean * f_mean, 0) / (wf * wf / wwf - 1)) end
        as frequency_recursive_se_hz,
    damping_ratio, d_0 + d_mean as damping_recursive,
    case when wd * wd > 1.001 * wwd then sqrt(greatest(d_square - d_mean * d_mean, 0) / (wd * wd / wwd - 1)) end
        as damping_recursive_se,
    wf * wf / wwf as n_effective
from summed;

-- columns of recursive_modes
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- source | varchar | | what it was identified from
-- measured_at_utc | timestamp | UTC | time of the campaign
-- epoch | bigint | | epoch of the chart, 0 from the first campaign
-- frequency_hz | double | Hz | natural frequency of the campaign
-- frequency_recursive_hz | double | Hz | recursive estimate of it after this campaign
-- frequency_recursive_se_hz | double | Hz | its standard error
-- damping_ratio | double | | damping ratio of the campaign
-- damping_recursive | double | | recursive estimate of it after this campaign
-- damping_recursive_se | double | | its standard error
-- n_effective | double | | campaigns of equal weight that the estimate of the frequency is worth
