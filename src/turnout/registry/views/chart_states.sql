-- One row per chart: its state at the newest campaign, in the words of the worklist, on the day `asof` at or after it.
-- confirm now: the newest campaign is far outside and not confirmed. inspect this week: an open alarm, unless its change
-- is below the target, or only follows from the other component (is_coupled), whose row is not silenced. plan: an acknowledged or smaller alarm, or a drift among the discoveries of the fleet
-- (false-discovery rate 10 %), also where the chart is too noisy to see the target within a year. suppressed: somebody
-- silenced it, with a reason and an end, a day at which it comes back.
-- needs: chart_status_at, acknowledgement_counts, in_service, is_below_target
create or replace macro chart_states_on("asof") as table
with open_alarms as (
    select turnout_id, section_id, band, source, max(raised_at_utc) as raised_at_utc
    from alarms
    where closed_at_utc is null
    group by all
),
acknowledged_charts as (
    select
        s.turnout_id, s.section_id, s.band, s.source, o.raised_at_utc,
        max_by(k.by_whom || ': ' || k.reason, k.at_utc) filter (
            where k.action = 'acknowledge' and k.at_utc >= o.raised_at_utc
        ) as acknowledged,
        max_by(k.by_whom || ': ' || k.reason, k.at_utc) filter (
            where k.action = 'suppress' and coalesce(k.until_utc, timestamp '9999-01-01') > "asof"
        ) as suppressed
    from chart_status s
    left join open_alarms o using (turnout_id, section_id, band, source)
    left join acknowledgements k
        on k.turnout_id = s.turnout_id and coalesce(k.section_id, s.section_id) = s.section_id
            and coalesce(k.band, s.band) = s.band and acknowledgement_counts(k.at_utc, "asof")
    group by all
)
select
    s.turnout_id, s.section_id, s.band, s.source,
    case
        when p.suppressed is not null and s.state in ('alarm', 'confirm_now', 'ok') then 'suppressed'
        when s.state = 'alarm' and p.acknowledged is null
            and not is_below_target(s.change_low_pct, s.change_high_pct, s.target_pct)
            and not (s.is_coupled and count(*) filter (
                s.band in ('ballast', 'railpad') and s.state in ('alarm', 'confirm_now') and p.suppressed is null
            ) over (partition by s.turnout_id, s.section_id, s.source) > 1)
        then 'inspect this week'
        when s.state = 'alarm' then 'plan'
        when (s.state = 'ok' or s.reason = 'too_noisy') and s.forecast is not null then 'plan'
        else replace(s.state, '_', ' ')
    end as state,
    s.reason, p.raised_at_utc, p.acknowledged, p.suppressed, s.direction, s.statistic_ratio, s.change_kind,
    s.since_at_utc, s.since_earliest_utc, s.since_latest_utc, s.change_pct, s.change_low_pct, s.change_high_pct,
    s.n_after, s.detectable_pct, s.target_pct, s.drift_pct_per_year, s.drift_se_pct_per_year, s.drift_q,
    s.last_measured_at_utc, s.n_campaigns, s.changed_component, s.ballast_stiffness_pct, s.ballast_stiffness_low_pct,
    s.ballast_stiffness_high_pct, s.pad_stiffness_pct, s.pad_stiffness_low_pct, s.pad_stiffness_high_pct
from chart_status_on("asof") s
join acknowledged_charts p using (turnout_id, section_id, band, source)
where in_service(s.turnout_id) and not has_left(s.section_id);

-- One row per chart: its state at the newest measurement, in the words of the worklist.
create or replace view chart_states as select * from chart_states_on(newest_measurement());

-- columns of chart_states
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- state | varchar | | what is to be done or known about the chart
-- reason | varchar | | why
-- raised_at_utc | timestamp | UTC | campaign that raised the alarm
-- acknowledged | varchar | | who acknowledged the alarm and why
-- suppressed | varchar | | who silenced the chart and why
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
-- detectable_pct | double | % | smallest change of frequency seen within a year with 90 %
-- target_pct | double | % | change of frequency that is to be seen
-- drift_pct_per_year | double | %/a | slope of the residual in the present epoch
-- drift_se_pct_per_year | double | %/a | its standard error with memory
-- drift_q | double | | the same adjusted for all charts (Benjamini-Hochberg)
-- last_measured_at_utc | timestamp | UTC | newest campaign with a value
-- n_campaigns | integer | | campaigns with a value
-- changed_component | varchar | | stiffness that changed: ballast, pad, both, or either (both resonances together do not decide)
-- ballast_stiffness_pct | double | % | change of the ballast's stiffness since the onset
-- ballast_stiffness_low_pct | double | % | 95 % interval, lower end
-- ballast_stiffness_high_pct | double | % | upper end
-- pad_stiffness_pct | double | % | change of the railpads' stiffness since the onset
-- pad_stiffness_low_pct | double | % | 95 % interval, lower end
-- pad_stiffness_high_pct | double | % | upper end

-- columns of chart_states_on(asof)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- state | varchar | | what is to be done or known about the chart
-- reason | varchar | | why
-- raised_at_utc | timestamp | UTC | campaign that raised the alarm
-- acknowledged | varchar | | who acknowledged the alarm and why
-- suppressed | varchar | | who silenced the chart and why
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
-- detectable_pct | double | % | smallest change of frequency seen within a year with 90 %
-- target_pct | double | % | change of frequency that is to be seen
-- drift_pct_per_year | double | %/a | slope of the residual in the present epoch
-- drift_se_pct_per_year | double | %/a | its standard error with memory
-- drift_q | double | | the same adjusted for all charts (Benjamini-Hochberg)
-- last_measured_at_utc | timestamp | UTC | newest campaign with a value
-- n_campaigns | integer | | campaigns with a value
-- changed_component | varchar | | stiffness that changed: ballast, pad, both, or either (both resonances together do not decide)
-- ballast_stiffness_pct | double | % | change of the ballast's stiffness since the onset
-- ballast_stiffness_low_pct | double | % | 95 % interval, lower end
-- ballast_stiffness_high_pct | double | % | upper end
-- pad_stiffness_pct | double | % | change of the railpads' stiffness since the onset
-- pad_stiffness_low_pct | double | % | 95 % interval, lower end
-- pad_stiffness_high_pct | double | % | upper end
