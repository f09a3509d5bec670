-- One row per chart and campaign since a date: the residual of the chart, recomputed from modes and baselines.
-- corrected_pct: 100 (f / f0 - 1) - b (T - T0) - c (T - T0)² - level of the epoch. residual_pct: the same minus the median of the
-- other sections of the turnout, where the chart uses them and three are there, minus their usual difference.
-- Sections in alarm are not siblings, nor are those that learn their level, except for others that learn too.
-- A campaign may last into the next day: a value belongs to the last campaign that began before it.
-- needs: chart_values
create or replace macro mode_residuals(since) as table
with valued as (
    select c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, m.frequency_hz, m.rail_temperature_c
    from chart_values m
    asof join charts c
        on m.turnout_id = c.turnout_id and m.section_id = c.section_id and m.band = c.band and m.source = c.source
            and m.measured_at_utc >= c.measured_at_utc
    where c.measured_at_utc >= since and m.frequency_hz > 0 and not ends_with(c.band, '_damping')
    qualify row_number() over (
        partition by c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc order by m.measured_at_utc desc
    ) = 1
),
corrected as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.epoch, c.state,
        m.frequency_hz, b.with_siblings, b.sibling_shift_pct, b.sd_pct, b.sd_alone_pct,
        b.complete and c.state <> 'learning' as settled, c.is_sibling,
        100 * (m.frequency_hz / b.frequency_hz - 1)
            - b.slope_pct_per_c * (m.rail_temperature_c - b.rail_temperature_c)
            - coalesce(b.curvature_pct_per_c2, 0) * (m.rail_temperature_c - b.rail_temperature_c) ** 2
            - b.level_pct as corrected_pct
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
    join valued m using (turnout_id, section_id, band, source, measured_at_utc)
    where c.measured_at_utc >= since and m.rail_temperature_c is not null
),
together as (
    select
        turnout_id, band, source, measured_at_utc,
        list(corrected_pct order by corrected_pct) filter (where is_sibling) as settled_pct,
        list(corrected_pct order by corrected_pct) as all_pct
    from corrected
    group by all
),
others as (
    select
        c.*,
        case when is_sibling then list_position(settled_pct, corrected_pct) else 0 end as place,
        list_position(all_pct, corrected_pct) as place_in_all,
        coalesce(settled_pct, []) as settled_pct,
        all_pct
    from corrected c
    join together using (turnout_id, band, source, measured_at_utc)
),
medians as (
    select
        *,
        len(settled_pct) - is_sibling::integer as n_settled,
        list_median(list_concat(settled_pct[1:place - 1], settled_pct[place + 1:])) as settled_median,
        list_median(list_concat(all_pct[1:place_in_all - 1], all_pct[place_in_all + 1:])) as all_median
    from others
),
siblings as (
    select
        *,
        case
            when not with_siblings then null
            when n_settled >= 3 then settled_median
            when not settled and len(all_pct) >= 4 then all_median
        end as median_pct
    from medians
),
common as (
    select distinct s.turnout_id, s.section_id, s.band, s.source, s.measured_at_utc
    from siblings s
    join alarms a using (turnout_id, band, source)
    where a.section_id = '*' and a.closed_by is distinct from 'recomputed'
        and s.measured_at_utc > coalesce(a.began_at_utc, '-infinity'::timestamp)
        and (a.closed_at_utc is null or s.measured_at_utc < a.closed_at_utc)
),
nearer as (
    select
        s.* exclude (median_pct),
        case
            when c.section_id is null or abs(corrected_pct) / sd_alone_pct
                >= abs(corrected_pct - median_pct - sibling_shift_pct) / sd_pct then median_pct
        end as sibling_median_pct
    from siblings s
    left join common c using (turnout_id, section_id, band, source, measured_at_utc)
)
select
    turnout_id, section_id, band, source, measured_at_utc, epoch, state, frequency_hz, corrected_pct,
    sibling_median_pct,
    coalesce(corrected_pct - sibling_median_pct - sibling_shift_pct, corrected_pct) as residual_pct
from nearer;

-- columns of mode_residuals(since)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- measured_at_utc | timestamp | UTC | start of the campaign
-- epoch | integer | | epoch of the chart, 0 from the first campaign
-- state | varchar | | state of the chart after this campaign
-- frequency_hz | double | Hz | undamped natural frequency, mean over impacts
-- corrected_pct | double | % | deviation from the baseline at its temperature, minus the level of the epoch
-- sibling_median_pct | double | % | median of the other sections' corrected_pct; empty where they do not serve
-- residual_pct | double | % | corrected_pct minus the siblings' median and its usual difference
