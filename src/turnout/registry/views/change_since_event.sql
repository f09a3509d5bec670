-- One row per event of a kind and chart it touches: level in the days before and after, on residuals.
-- Raw frequencies would call every October tamping a success: the summer lies before it, the winter behind.
-- Windows are half open: [event - days, event) and [event, event + days). Levels are weighted means: a campaign whose
-- error is larger than usual counts by the inverse of its variance. Of a side with three or more, one campaign alone that
-- lies beyond the outlier limit of its chart from their median does not count. change_se_pct holds the scatter of the
-- campaigns with their memory, and what the error of the temperature slope makes of the difference in temperature.
-- Of work on a whole turnout the siblings' median is left in, for what all sections share is asked for (but not in
-- band amplitude).
-- needs: campaign_weight, students_t
create or replace macro change_since_event(kind_of_event, days) as table
with values_pct as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.rail_temperature_c, b.n_learned, b.n_baseline,
        b.sd_alone_pct * sqrt((1 + b.phi) / (1 - b.phi)) as sd_pct, b.slope_se_pct_per_c,
        campaign_weight(c.z, c.residual_pct, b.guard * b.sd_pct * sqrt((1 + b.phi) / (1 - b.phi))) as weight,
        b.guard * b.outlier_limit as z_limit, c.residual_pct + b.level_pct as value_pct,
        100 * (c.expected_hz / b.frequency_hz - 1) + c.residual_pct
            - b.slope_pct_per_c * (c.rail_temperature_c - b.rail_temperature_c)
            - coalesce(b.curvature_pct_per_c2, 0) * (c.rail_temperature_c - b.rail_temperature_c) ** 2 as alone_pct
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
    where c.residual_pct is not null and c.section_id <> '*'
),
sides as (
    select
        e.event_id, e.kind, e.event_at_utc, v.turnout_id, v.section_id, v.band, v.source,
        v.measured_at_utc >= e.event_at_utc as is_after,
        case when e.section_id is null then coalesce(v.alone_pct, v.value_pct) else v.value_pct end as value_pct,
        v.weight, v.rail_temperature_c, v.sd_pct, v.slope_se_pct_per_c, v.n_learned, v.n_baseline, v.z_limit
    from events e
    join values_pct v
        on e.turnout_id = v.turnout_id and coalesce(e.section_id, v.section_id) = v.section_id
            and v.measured_at_utc >= e.event_at_utc - to_days(days::integer)
            and v.measured_at_utc < e.event_at_utc + to_days(days::integer)
    where e.kind = kind_of_event
),
marked as (
    select
        *, is_outlier(value_pct, median(value_pct) over side, sd_pct, weight, z_limit) as is_far,
        count(*) over side as n_side
    from sides
    window side as (partition by event_id, turnout_id, section_id, band, source, is_after)
),
used as (
    select *
    from marked
    qualify not (is_far and n_side > 2 and count(*) filter (is_far) over (
        partition by event_id, turnout_id, section_id, band, source, is_after
    ) = 1)
),
counted as (
    select
        event_id, kind, event_at_utc, turnout_id, section_id, band, source,
        count(*) filter (where not is_after) as n_before,
        count(*) filter (where is_after) as n_after,
        sum(weight) filter (where not is_after) as weight_before,
        sum(weight) filter (where is_after) as weight_after,
        sum(weight * value_pct) filter (where not is_after) / sum(weight) filter (where not is_after) as before_pct,
        sum(weight * value_pct) filter (where is_after) / sum(weight) filter (where is_after) as after_pct,
        sum(weight * rail_temperature_c) filter (where is_after) / sum(weight) filter (where is_after)
            - sum(weight * rail_temperature_c) filter (where not is_after) / sum(weight) filter (where not is_after) as dt_c,
        max(sd_pct) as sd_pct, max(slope_se_pct_per_c) as slope_se_pct_per_c,
        min(n_learned) filter (where is_after) as n_learned, min(n_baseline) as n_baseline
    from used
    group by all
),
compared as (
    select
        *, after_pct - before_pct as change_pct,
        sqrt(sd_pct ** 2 * (1 / weight_before + 1 / least(weight_after, n_learned)) + (slope_se_pct_per_c * dt_c) ** 2)
            as change_se_pct
    from counted
    where n_before > 0 and n_after > 0
)
select
    event_id, kind, event_at_utc, turnout_id, section_id, band, source, n_before, n_after, before_pct, after_pct,
    change_pct, change_se_pct, abs(change_pct) > students_t(n_baseline - 2) * change_se_pct as changed
from compared;

-- columns of change_since_event(kind_of_event, days)
-- event_id | varchar | | content id of the event
-- kind | varchar | | what was done
-- event_at_utc | timestamp | UTC | when it was done
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- n_before | bigint | | campaigns before
-- n_after | bigint | | campaigns after
-- before_pct | double | % | level before, of the baseline's frequency
-- after_pct | double | % | level after
-- change_pct | double | % | after minus before
-- change_se_pct | double | % | its standard error
-- changed | boolean | | whether its 95 % interval leaves out zero
