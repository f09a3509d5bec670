-- The newest campaign that a chart rests on; newest_measurement() would follow a clock that runs ahead.
create or replace macro newest_charted() as (select max(last_measured_at_utc) from chart_status);

-- One row per chart: chart_status on a day at or after the newest campaign. A chart without a
-- campaign for long is 'not_measured', also if the whole fleet has none; the median of a turnout is as old as its newest chart.
-- is_coupled: the alarm of one resonance follows from the component of the other, which is in alarm as well.
create or replace macro chart_status_on("asof") as table
select * exclude (is_silent) replace (
    case when is_silent then 'not_measured' else state end as state,
    case when is_silent then 'too_long_ago' else reason end as reason
)
from (
    select
        *,
        coalesce(
            state in ('ok', 'learning', 'cannot_tell')
                and "asof" - greatest(last_measured_at_utc, case when section_id = '*' then
                    max(last_measured_at_utc) over (partition by turnout_id, band, source) end)
                    > to_microseconds((86400e6 * stale_after_days)::bigint),
            false
        ) as is_silent,
        state = 'alarm' and coalesce(
            (band = 'railpad' and changed_component = 'ballast') or (band = 'ballast' and changed_component = 'pad'),
            false
        ) and count(*) filter (state in ('alarm', 'confirm_now'))
            over (partition by turnout_id, section_id, source, band in ('ballast', 'railpad')) > 1 as is_coupled
    from chart_status
);

-- One row per chart: its state at a date and why, from what was measured and entered by then.
-- At or after the newest campaign these are the rows of chart_status_on. Before it everything is counted from `charts` up
-- to the date; spread and thresholds are those of the baseline, which later campaigns do not change. Only the memory
-- is the fleet's of today.
-- needs: chart_values
create or replace macro chart_status_at("asof") as table
with by_epoch as (
    select
        turnout_id, section_id, band, source, epoch, count(*) as n, max(measured_at_utc) as last_at_utc,
        count(*) filter (state in ('baseline', 'learning')) as n_learned,
        count(*) filter (state = 'no_temperature') as n_cold,
        max(measured_at_utc) filter (deviation_pct is not null) as far_at_utc,
        max(measured_at_utc) filter (z is not null) as judged_at_utc
    from charts
    where measured_at_utc <= case when "asof" < newest_charted() then "asof" end and state <> 'wrong_time'
    group by all
),
counted as (
    select
        turnout_id, section_id, band, source, max(epoch) as epoch,
        min(epoch) filter (n_learned > 0) as first_epoch,
        sum(n)::integer as n_campaigns, sum(n_learned)::integer as n_baseline, sum(n_cold)::integer as n_cold,
        max_by(n_learned, epoch)::integer as n_learned, max(last_at_utc) as last_at_utc,
        max(judged_at_utc) as judged_at_utc, coalesce(max(far_at_utc) = max(last_at_utc), false) as is_far
    from by_epoch
    group by turnout_id, section_id, band, source
),
last_eight as (
    select turnout_id, section_id, band, source, max_by(frequency_hz, measured_at_utc, 8) as hz
    from chart_values
    where measured_at_utc <= case when "asof" < newest_charted() then "asof" end
    group by turnout_id, section_id, band, source
),
pending as (
    select distinct c.turnout_id, c.section_id, c.band, c.source
    from counted c
    join events e
        on e.turnout_id = c.turnout_id and e.event_at_utc > c.last_at_utc and e.event_at_utc <= "asof"
            and (e.section_id is null or e.section_id = c.section_id)
            and ((e.resets_ballast and not starts_with(c.band, 'railpad'))
                or (e.resets_railpad and not starts_with(c.band, 'ballast')))
),
alarmed as (
    select distinct turnout_id, section_id, band, source
    from alarms
    where raised_at_utc <= "asof" and coalesce(closed_at_utc > "asof", true)
),
known as (
    select
        s.turnout_id, s.section_id, s.band, s.source, c.last_at_utc, coalesce(c.n_campaigns, 0) as n_campaigns,
        case when s.complete and s.baseline_until_utc <= "asof" then s.n_baseline else coalesce(c.n_baseline, 0) end
            as n_baseline, coalesce(c.n_cold, 0) as n_cold, s.n_needed,
        case when p.turnout_id is null then coalesce(c.n_learned, 0) else 0 end as n_learned,
        coalesce(s.complete and s.baseline_until_utc <= "asof", false) as complete, p.turnout_id is not null as is_pending,
        a.turnout_id is not null and p.turnout_id is null as in_alarm,
        c.is_far and p.turnout_id is null as is_far, c.epoch > c.first_epoch as is_later, b.detectable_pct, s.target_pct, s.section_id = '*' as is_whole,
        "asof" - c.last_at_utc > to_microseconds((86400e6 * s.stale_after_days)::bigint) as is_old,
        s.section_id = '*' and "asof" - max(c.last_at_utc) filter (s.section_id <> '*')
            over (partition by s.turnout_id, s.band, s.source)
            <= to_microseconds((86400e6 * s.stale_after_days)::bigint) as has_sections,
        s.section_id <> '*' and (
            coalesce(len(v.hz) >= 8 and list_max(v.hz) - list_min(v.hz) < 0.001, false)
            or not coalesce(b.sd_pct > 0.1 / b.frequency_hz, b.sd_pct > 0, false)
        ) as is_stuck,
        s.section_id <> '*'
            and coalesce("asof" - c.judged_at_utc > to_microseconds((86400e6 * s.stale_after_days)::bigint), true)
            as is_unheard
    from chart_status s
    left join counted c using (turnout_id, section_id, band, source)
    left join last_eight v using (turnout_id, section_id, band, source)
    left join pending p using (turnout_id, section_id, band, source)
    left join alarmed a using (turnout_id, section_id, band, source)
    left join baselines b
        on b.turnout_id = s.turnout_id and b.section_id = s.section_id and b.band = s.band and b.source = s.source
            and b.epoch = c.epoch
    where "asof" < newest_charted()
),
judged as (
    select
        *,
        case
            when last_at_utc is null and is_whole then 'too_few_sections'
            when last_at_utc is null then 'never'
            when in_alarm and not (complete and is_stuck) then 'threshold_crossed'
            when is_old and has_sections then 'too_few_sections'
            when is_far then 'far_outside'
            when is_old then 'too_long_ago'
            when complete and is_stuck then 'constant'
            when complete and is_unheard then 'no_temperature'
            when not complete and 2 * n_cold > n_campaigns then 'no_temperature'
            when not complete and is_whole and n_baseline = 0 then 'too_few_sections'
            when not complete then 'baseline'
            when is_pending or (is_later and n_learned < n_needed) then 'after_event'
            when not coalesce(detectable_pct <= target_pct, false) then 'too_noisy'
            else ''
        end as reason
    from known
)
select
    turnout_id, section_id, band, source,
    case reason
        when 'never' then 'not_measured'
        when 'too_long_ago' then 'not_measured'
        when 'threshold_crossed' then 'alarm'
        when 'far_outside' then 'confirm_now'
        when 'baseline' then 'learning'
        when 'after_event' then 'learning'
        when '' then 'ok'
        else 'cannot_tell'
    end as state,
    reason, last_at_utc as last_measured_at_utc, n_campaigns, n_baseline, n_learned, n_needed, complete,
    n_cold as without_temperature,
    case when complete and reason <> 'after_event' then detectable_pct end as detectable_pct, target_pct
from judged
union all by name
select
    turnout_id, section_id, band, source, state, reason, last_measured_at_utc, n_campaigns, n_baseline, n_learned,
    n_needed, complete, without_temperature, detectable_pct, target_pct
from chart_status_on("asof")
where coalesce("asof" >= newest_charted(), true);

-- columns of chart_status_at(asof)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- state | varchar | | ok, alarm, confirm_now, learning, cannot_tell or not_measured
-- reason | varchar | | why: see docs/trends.md
-- last_measured_at_utc | timestamp | UTC | newest campaign with a value
-- n_campaigns | integer | | campaigns with a value
-- n_baseline | integer | | campaigns of the baseline by then
-- n_learned | integer | | campaigns that have learned the present level
-- n_needed | integer | | campaigns it takes to learn a level
-- complete | boolean | | baseline long enough by then
-- without_temperature | integer | | campaigns without rail temperature
-- detectable_pct | double | % | smallest change of frequency seen within a year with 90 %; empty while it learns
-- target_pct | double | % | change of frequency that is to be seen

-- columns of chart_status_on(asof)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- state | varchar | | state of the chart on that day
-- reason | varchar | | why: see docs/trends.md
-- last_measured_at_utc | timestamp | UTC | newest campaign with a value
-- n_campaigns | integer | | campaigns with a value
-- campaigns_per_year | integer | | mean number of campaigns a year in the baseline
-- n_baseline | integer | | campaigns of the baseline
-- baseline_until_utc | timestamp | UTC | campaign that completed the baseline; empty = not complete
-- n_learned | integer | | campaigns that learned the present level
-- complete | boolean | | baseline long enough
-- n_needed | integer | | campaigns it takes to learn a level
-- without_temperature | integer | | campaigns without rail temperature
-- detectable_pct | double | % | smallest change of frequency seen within a year with 90 %
-- target_pct | double | % | change of frequency that is to be seen
-- worklist_rows | integer | | rows that the list of things to do has unless more alarms are open
-- stale_after_days | double | d | older than this the chart is not measured
-- drift_pct_per_year | double | %/a | slope of the residual in the present epoch
-- drift_se_pct_per_year | double | %/a | its standard error with memory
-- drift_p | double | | p value of the slope
-- drift_q | double | | the same adjusted for all charts (Benjamini-Hochberg)
-- run_length_down | double | | mean campaigns between false alarms, loss of stiffness
-- run_length_up | double | | the same for a gain
-- direction | varchar | | direction of a flagged change
-- statistic_ratio | double | | CUSUM over its limit
-- change_kind | varchar | | what fits the flagged change better
-- since_at_utc | timestamp | UTC | estimated time of the change
-- since_earliest_utc | timestamp | UTC | 95 % interval, earliest
-- since_latest_utc | timestamp | UTC | 95 % interval, latest
-- change_pct | double | % | change of frequency at the newest campaign since the onset
-- change_low_pct | double | % | 95 % interval, lower end
-- change_high_pct | double | % | upper end
-- n_after | integer | | campaigns after the onset
-- forecast | varchar | | when the limit is reached
-- forecast_slope_pct_per_year | double | %/a | slope since the change
-- forecast_slope_se_pct_per_year | double | %/a | its standard error
-- not_before_utc | timestamp | UTC | 80 % interval of the limit, earliest
-- not_after_utc | timestamp | UTC | 80 % interval of the limit, latest; empty = none
-- changed_component | varchar | | stiffness that changed: ballast, pad, both, or either (both resonances together do not decide)
-- ballast_stiffness_pct | double | % | change of the ballast's stiffness since the onset
-- ballast_stiffness_low_pct | double | % | 95 % interval, lower end
-- ballast_stiffness_high_pct | double | % | upper end
-- pad_stiffness_pct | double | % | change of the railpads' stiffness since the onset
-- pad_stiffness_low_pct | double | % | 95 % interval, lower end
-- pad_stiffness_high_pct | double | % | upper end
-- is_coupled | boolean | | the alarm follows from the component of the other resonance of the section, which is in alarm as well
