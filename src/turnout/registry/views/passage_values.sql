-- One row per section, kind of value and week (Monday, UTC): the values from ordinary trains, with their own errors.
-- Modes of passages where another program entered any (this one identifies none), weighted by their errors; and
-- band 'amplitude', the peak acceleration [m/s²] at the usual speed, where at least five trains were measured:
-- every sensor against its own first year, so that one that stops recording does not shift the level.
-- needs: modes_current, passages_current, passage_fits_current, passage_trains
create or replace view passage_values as
with weighed as (
    select
        *, date_trunc('week', measured_at_utc)::timestamp as week_utc,
        coalesce(1 / nullif(frequency_se_hz, 0) ** 2, 1) as weight
    from modes_current
    where source = 'passage' and coalesce(method, 'joint') = 'joint'
),
peaks as (
    select
        f.turnout_id, f.section_id, f.channel, f.passage_id, any_value(f.passed_at_utc) as passed_at_utc,
        any_value(ln(f.peak_ms2)) as log_peak, any_value(ln(p.speed_kmh)) as log_speed,
        any_value(p.rail_temperature_c) as rail_temperature_c
    from passage_fits_current f join passages_current p using (passage_id)
    where f.status <> 'rejected' and f.peak_ms2 > 0 and p.speed_kmh > 0
    group by f.turnout_id, f.section_id, f.channel, f.passage_id
),
days as (select section_id, channel, passed_at_utc::date as day_utc from peaks group by all),
begun as (
    -- a clock that was reset dates a day or two long before all others: the third day is near the first of a real year
    select section_id, channel, coalesce(min(day_utc) filter (goes_on), min(day_utc))::timestamp as first_at
    from (
        select *, lead(day_utc, 2) over (partition by section_id, channel order by day_utc) < day_utc + 400 as goes_on
        from days
    )
    group by section_id, channel
),
first_year as (
    select
        section_id, channel, avg(log_speed) as usual_speed, avg(log_peak) as usual_peak,
        -- too few passages, or speeds that differ by less than 3 %, tell no exponent
        case
            when regr_count(log_peak, log_speed) >= 10 and stddev_pop(log_speed) > 0.03
            then regr_slope(log_peak, log_speed)
            else 0
        end as exponent
    from peaks join begun using (section_id, channel)
    where passed_at_utc >= first_at and passed_at_utc < first_at + interval 365 day
    group by section_id, channel
),
levelled as (
    select
        p.turnout_id, p.section_id, date_trunc('week', min(p.passed_at_utc))::timestamp as week_utc,
        avg(p.log_peak - y.exponent * (p.log_speed - y.usual_speed) - y.usual_peak) as log_ratio,
        avg(p.rail_temperature_c) as rail_temperature_c
    from peaks p join first_year y using (section_id, channel) join passage_trains t using (turnout_id, passage_id)
    group by p.turnout_id, p.section_id, t.train_id
),
usual as (select section_id, avg(usual_peak) as usual_peak from first_year group by section_id)
select
    turnout_id, section_id, band, 'passage' as source, week_utc as measured_at_utc,
    sum(weight * frequency_hz) / sum(weight) as frequency_hz,
    coalesce(stddev_samp(frequency_hz) / sqrt(count(*)), max(frequency_se_hz)) as frequency_se_hz,
    avg(rail_temperature_c) as rail_temperature_c
from weighed
group by turnout_id, section_id, band, week_utc
union all
select
    turnout_id, section_id, 'amplitude' as band, 'passage' as source, week_utc as measured_at_utc,
    exp(any_value(usual_peak) + avg(log_ratio)) as frequency_hz,
    exp(any_value(usual_peak) + avg(log_ratio)) * stddev_samp(log_ratio) / sqrt(count(*)) as frequency_se_hz,
    avg(rail_temperature_c) as rail_temperature_c
from levelled join usual using (section_id)
group by turnout_id, section_id, week_utc
having count(*) >= 5;

-- columns of passage_values
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | resonance, or 'amplitude'
-- source | varchar | | what it was identified from
-- measured_at_utc | timestamp | UTC | time of the campaign; Monday of the week for source passage
-- frequency_hz | double | Hz | value of the campaign or week; m/s² for band 'amplitude'
-- frequency_se_hz | double | Hz | its standard error, in the same unit
-- rail_temperature_c | double | °C | rail temperature, mean of the week for source passage
