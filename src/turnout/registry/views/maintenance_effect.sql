-- One row per event and section's chart that it reset: did the work help, by how much, and for how long. Several events
-- between the same two campaigns with a temperature are one row, dated by the last; a turnout's median begins again at 0
-- and has none. gain_pct: level of the eight campaigns after the event minus that of the eight before. Of the eight, one
-- campaign alone that lies beyond the outlier limit of its chart from their median does not count. held_until_utc: first
-- campaign at which the mean of eight without the lowest has lost half of a gain again; empty = it holds, until
-- last_measured_at_utc.
-- The siblings' median is left in, for work on a whole turnout lifts them all (but not in band amplitude). The interval
-- holds the scatter of the campaigns with their memory, and what the error of the temperature slope makes of the
-- difference in temperature. Levels are weighted means: a campaign whose error is larger than usual counts by the inverse
-- of its variance.
-- needs: campaign_weight, students_t
create or replace view maintenance_effect as
with own as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.epoch, c.rail_temperature_c,
        b.epoch_start_utc, b.slope_se_pct_per_c, b.n_baseline,
        b.guard * b.outlier_limit as z_limit, b.sd_alone_pct * sqrt((1 + b.phi) / (1 - b.phi)) as sd_pct,
        campaign_weight(c.z, c.residual_pct, b.guard * b.sd_pct * sqrt((1 + b.phi) / (1 - b.phi))) as weight,
        coalesce(
            100 * (c.expected_hz / b.frequency_hz - 1) + c.residual_pct
                - b.slope_pct_per_c * (c.rail_temperature_c - b.rail_temperature_c)
                - coalesce(b.curvature_pct_per_c2, 0) * (c.rail_temperature_c - b.rail_temperature_c) ** 2,
            c.residual_pct + b.level_pct
        ) as value_pct
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
    where c.residual_pct is not null and c.section_id <> '*' and not ends_with(c.band, '_damping')
),
placed as (
    select
        *, row_number() over (epoch_of_chart order by measured_at_utc) as place,
        row_number() over (epoch_of_chart order by measured_at_utc desc) as place_from_end,
        (sum(weight * value_pct) over eight - arg_min(weight, value_pct) over eight * min(value_pct) over eight)
            / nullif(sum(weight) over eight - arg_min(weight, value_pct) over eight, 0) as mean_without_lowest
    from own
    window
        epoch_of_chart as (partition by turnout_id, section_id, band, source, epoch),
        eight as (
            partition by turnout_id, section_id, band, source, epoch order by measured_at_utc
            rows between 7 preceding and current row
        )
),
marked as (
    select
        *,
        place <= 8 and is_outlier(
            value_pct, median(value_pct) filter (place <= 8) over epoch_of_chart, sd_pct, weight, z_limit
        ) as is_far_first,
        place_from_end <= 8 and is_outlier(
            value_pct, median(value_pct) filter (place_from_end <= 8) over epoch_of_chart, sd_pct, weight, z_limit
        ) as is_far_last
    from placed
    window epoch_of_chart as (partition by turnout_id, section_id, band, source, epoch)
),
values_pct as (
    select
        *,
        case when place <= 8 and not (
            is_far_first and count(*) over epoch_of_chart > 2 and count(*) filter (is_far_first) over epoch_of_chart = 1
        ) then weight end as weight_first,
        case when place_from_end <= 8 and not (
            is_far_last and count(*) over epoch_of_chart > 2 and count(*) filter (is_far_last) over epoch_of_chart = 1
        ) then weight end as weight_last
    from marked
    window epoch_of_chart as (partition by turnout_id, section_id, band, source, epoch)
),
levels as (
    select
        turnout_id, section_id, band, source, epoch,
        any_value(epoch_start_utc) as epoch_start_utc, max(sd_pct) as sd_pct, max(measured_at_utc) as last_at,
        sum(weight_first * value_pct) / sum(weight_first) as first_pct, count(weight_first) as n_first,
        sum(weight_last * value_pct) / sum(weight_last) as last_pct, count(weight_last) as n_last,
        sum(weight_first * rail_temperature_c) / sum(weight_first) as first_c,
        sum(weight_last * rail_temperature_c) / sum(weight_last) as last_c,
        sum(weight_first) as weight_first, sum(weight_last) as weight_last,
        max(slope_se_pct_per_c) as slope_se_pct_per_c, max(n_baseline) as n_baseline,
        lag(epoch) over (partition by turnout_id, section_id, band, source order by epoch) as epoch_before
    from values_pct
    group by turnout_id, section_id, band, source, epoch
),
pairs as (
    select
        l.turnout_id, l.section_id, l.band, l.source, l.epoch, l.epoch_start_utc, l.last_at,
        b.last_at as before_at, b.last_pct as before_pct, l.first_pct as after_pct,
        b.n_last as n_before, l.n_first as n_after,
        students_t(l.n_baseline - 2) * sqrt(
            l.sd_pct ** 2 * (1 / b.weight_last + 1 / l.weight_first)
            + (l.slope_se_pct_per_c * (l.first_c - b.last_c)) ** 2
        ) as half
    from levels l
    join levels b
        on l.turnout_id = b.turnout_id and l.section_id = b.section_id and l.band = b.band and l.source = b.source
            and b.epoch = l.epoch_before
),
lost as (
    select p.turnout_id, p.section_id, p.band, p.source, p.epoch, min(v.measured_at_utc) as held_until_utc
    from pairs p
    join values_pct v using (turnout_id, section_id, band, source, epoch)
    where v.place > 8 and p.after_pct - p.before_pct > p.half
        and v.mean_without_lowest < (p.before_pct + p.after_pct) / 2
    group by all
)
select
    p.turnout_id, p.section_id, p.band, p.source, p.epoch_start_utc as event_at_utc,
    (
        select string_agg(distinct e.kind, ', ' order by e.kind) from events e
        where e.turnout_id = p.turnout_id and coalesce(e.section_id, p.section_id) = p.section_id
            and e.event_at_utc > p.before_at and e.event_at_utc <= p.epoch_start_utc
            and ((e.resets_ballast and p.band <> 'railpad') or (e.resets_railpad and p.band <> 'ballast'))
    ) as kinds,
    n_before, n_after, after_pct - before_pct as gain_pct, after_pct - before_pct - half as gain_low_pct,
    after_pct - before_pct + half as gain_high_pct,
    case
        when after_pct - before_pct > half then 'stiffer'
        when after_pct - before_pct < -half then 'softer'
        else 'cannot tell'
    end as verdict,
    l.held_until_utc,
    p.last_at as last_measured_at_utc
from pairs p
left join lost l using (turnout_id, section_id, band, source, epoch);

-- columns of maintenance_effect
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- event_at_utc | timestamp | UTC | when it was done
-- kinds | varchar | | what was done
-- n_before | bigint | | campaigns before, at most eight
-- n_after | bigint | | campaigns after, at most eight
-- gain_pct | double | % | level after minus level before
-- gain_low_pct | double | % | 95 % interval, lower end
-- gain_high_pct | double | % | 95 % interval, upper end
-- verdict | varchar | | stiffer, softer or cannot tell
-- held_until_utc | timestamp | UTC | first campaign at which half of a gain was lost again; empty = it holds
-- last_measured_at_utc | timestamp | UTC | newest campaign of the epoch
