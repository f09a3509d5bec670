-- One row per chart: its drift over the last days before asof, by least squares on time and rail temperature.
-- Closed form of f = a + b t + c T + e, with the weights of error_weight: a campaign with a large error does not decide.
-- Only the present epoch counts; hammer and passage values are not mixed. Values
-- without temperature are counted and left out, also of the raw slope, so that the two compare. A 0 * T makes them NULL.
-- Sums of products, not running covariances: half the time over a network, and exact to 1e-9 wherever the spread is
-- above a thousandth of the frequency's resolution; a spread below that is taken as none.
-- needs: epochs, campaign_weight
create or replace macro resonance_drift(days := 365, "asof" := null) as table
with present as (
    select section_id, band, max(event_at_utc) as start_utc
    from reset_events where event_at_utc <= coalesce("asof", newest_measurement()) group by section_id, band
),
sample as (
    select
        m.turnout_id, m.section_id, m.band, m.source, m.measured_at_utc, m.rail_temperature_c as c,
        m.frequency_hz + 0 * m.rail_temperature_c as f,
        (epoch_us(m.measured_at_utc) - epoch_us(coalesce("asof", newest_measurement()))) / 31557600e6
            + 0 * m.rail_temperature_c as t,
        m.frequency_se_hz + 0 * m.rail_temperature_c as se
    from modes_current m left join present p on m.section_id = p.section_id and m.band = p.band
    where m.measured_at_utc > coalesce("asof", newest_measurement()) - to_days(days)
        and m.measured_at_utc <= coalesce("asof", newest_measurement())
        and coalesce(m.method, 'joint') = 'joint'
        and (p.start_utc is null or m.measured_at_utc >= p.start_utc)
),
usual as (select section_id, band, source, median(se) as usual_se from sample group by section_id, band, source),
weighted as (
    select
        s.turnout_id, s.section_id, s.band, s.source, s.measured_at_utc, s.t, s.c, s.f,
        error_weight(s.se, u.usual_se) + 0 * s.t as w
    from sample s join usual u
        on s.section_id = u.section_id and s.band = u.band and s.source is not distinct from u.source
),
sums as (
    select
        any_value(turnout_id) as turnout_id, section_id, band, source, count(*) as n_all, count(c) as n, sum(w) as w1,
        min(measured_at_utc) as first_at_utc, max(measured_at_utc) as last_at_utc,
        sum(w * t) as t1, sum(w * c) as c1, sum(w * f) as f1,
        sum(w * t * t) as tt, sum(w * c * c) as cc, sum(w * f * f) as ff,
        sum(w * t * c) as tc, sum(w * t * f) as tf, sum(w * c * f) as cf
    from weighted
    group by section_id, band, source
),
moments as (
    select
        *, f1 / w1 as mean_hz,
        tt - t1 * t1 / w1 as stt, tc - t1 * c1 / w1 as stc, tf - t1 * f1 / w1 as stf, cf - c1 * f1 / w1 as scf,
        case when cc - c1 * c1 / w1 > 1e-6 * w1 then cc - c1 * c1 / w1 else 0 end as scc,
        case when ff - f1 * f1 / w1 > 1e-12 * ff then ff - f1 * f1 / w1 else 0 end as sff
    from sums
),
solved as (
    select
        *,
        case when n > 2 and stt * scc - stc * stc > 1e-9 * stt * scc then stt * scc - stc * stc end as d,
        case when n > 1 and stt > 1e-12 then stf / stt end as raw
    from moments
),
fitted as (
    select
        *,
        (stf * scc - scf * stc) / d as slope,
        (scf * stt - stf * stc) / d as per_c,
        case when n > 3 then sqrt(greatest(0, sff - stf * (stf * scc - scf * stc) / d - scf * (scf * stt - stf * stc) / d)
            / (n - 3)) end as sd,
        case when n > 2 and raw is not null then sqrt(greatest(0, sff - raw * stf) / (n - 2) / stt) end as raw_se
    from solved
)
select
    turnout_id, section_id, band, source, n, n_all - n as n_without_temperature, first_at_utc, last_at_utc,
    mean_hz as frequency_hz,
    100 * raw / mean_hz as raw_pct_per_year,
    100 * raw_se / mean_hz as raw_se_pct_per_year,
    100 * slope / mean_hz as drift_pct_per_year,
    100 * sd * sqrt(scc / d) / mean_hz as drift_se_pct_per_year,
    slope / nullif(sd * sqrt(scc / d), 0) as t,
    per_c as hz_per_c,
    sd * sqrt(stt / d) as hz_per_c_se,
    100 * sd / mean_hz as residual_sd_pct,
    case when n < 12 then 'too few'
        when last_at_utc - first_at_utc < to_days(300) then 'season not separable'
        when d is null then 'temperature not separable'
        else 'ok' end as verdict
from fitted;

-- columns of resonance_drift(days := 365, asof := null)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- source | varchar | | what it was identified from
-- n | bigint | | values with rail temperature
-- n_without_temperature | bigint | | values without; not used
-- first_at_utc | timestamp | UTC | oldest value used
-- last_at_utc | timestamp | UTC | newest value used
-- frequency_hz | double | Hz | weighted mean frequency
-- raw_pct_per_year | double | %/a | slope over time alone, of the mean frequency: season and all; never rank by it
-- raw_se_pct_per_year | double | %/a | its standard error, values taken as independent
-- drift_pct_per_year | double | %/a | slope over time with rail temperature held fixed
-- drift_se_pct_per_year | double | %/a | its standard error, values taken as independent
-- t | double | | drift over its standard error, n - 3 degrees of freedom
-- hz_per_c | double | Hz/°C | slope over rail temperature
-- hz_per_c_se | double | Hz/°C | its standard error
-- residual_sd_pct | double | % | spread of the residuals of a campaign of usual error, of the mean frequency
-- verdict | varchar | | ok, too few (n < 12), season not separable (less than 300 days), temperature not separable
