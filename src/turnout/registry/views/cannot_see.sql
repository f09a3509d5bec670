-- For words, where 1.53 must not be told as the 1.5 of the target: rounded up.
create or replace macro up_to_a_tenth(pct) as (ceil(10 * pct - 1e-6) / 10);

-- One row per chart that cannot answer at a date, and why: too noisy for the target, learning, never warm or cold
-- enough, not measured; and one of band 'all' where no newer recording could be used, and until the next campaign where an open
-- alarm was taken back. detectable_pct is the smallest change of frequency that it shows within a year with 90 %;
-- in stiffness about twice as much (one degree of freedom).
-- needs: campaign_name, chart_status_at, unusable, in_service
create or replace macro cannot_see("asof" := null) as table
select
    turnout_id, section_id, band, source,
    case when state in ('alarm', 'confirm_now', 'ok') then 'cannot tell' else replace(state, '_', ' ') end as state,
    case
        when reason = 'never' then 'not measured by then'
        when reason = 'too_long_ago' then 'last measured ' || campaign_name(turnout_id, last_measured_at_utc)
            || coalesce('; the campaign of '
                || campaign_name(turnout_id, case when set_aside_at_utc > last_measured_at_utc then set_aside_at_utc end)
                || ' waits for a second one: so long after all others, its clock may be wrong', '')
        when reason = 'constant' then 'the value never changes: stuck or copied'
        when reason = 'no_temperature' then
            without_temperature || ' of ' || n_campaigns || ' campaigns have no rail temperature'
        when reason = 'too_few_sections' then
            'too few sections are measured, or are without an alarm, in the same campaigns for their median'
        when reason = 'baseline' then n_baseline || case when n_baseline = 1 then ' campaign' else ' campaigns' end
            || ' with a rail temperature so far; a baseline needs a whole year and at least twelve campaigns'
        when reason = 'after_event' then n_learned || ' of ' || n_needed || ' campaigns since the event'
        when band = 'amplitude' and coalesce(detectable_pct < 50, false) then
            printf('a change below %.1f %% of acceleration may go unseen for a year; target: %.1f %%',
                up_to_a_tenth(detectable_pct), target_pct)
        when ends_with(band, '_damping') and detectable_pct is not null then
            printf('a change below %.0f %% of the damping ratio may go unseen for a year; target: %.0f %%',
                ceil(detectable_pct), target_pct)
        when coalesce(detectable_pct < 50, false) then
            printf('a change below %.1f %% of frequency (about %.1f %% in stiffness) may go unseen for a year; '
                || 'target: %.1f %% (%.1f %%)',
                up_to_a_tenth(detectable_pct), up_to_a_tenth(100 * (1 - (1 - detectable_pct / 100) ** 2)),
                target_pct, 100 * (1 - (1 - target_pct / 100) ** 2))
        else 'cannot see any change within a year: the values scatter too much'
    end as why,
    detectable_pct, target_pct, n_campaigns, last_measured_at_utc
from chart_status_at(coalesce("asof", newest_measurement())) left join (
    select turnout_id, section_id, band, source, max(measured_at_utc) as set_aside_at_utc
    from charts where state = 'wrong_time' and measured_at_utc <= coalesce("asof", newest_measurement()) group by all
) a using (turnout_id, section_id, band, source)
where in_service(turnout_id) and not has_left(section_id)
    and (state not in ('alarm', 'confirm_now', 'ok') or detectable_pct is null or detectable_pct > target_pct)
union all by name
select turnout_id, section_id, 'all' as band, source, 'cannot tell' as state, why, used_at_utc as last_measured_at_utc
from unusable(coalesce("asof", newest_measurement()))
union all by name
select
    turnout_id, section_id, 'all' as band, source, 'cannot tell' as state,
    'the alarm of ' || campaign_name(turnout_id, raised_at_utc) || ' (' || band || ', ' || direction
        || ') is not raised again: what it rested on was corrected, or the spread or memory of the charts is another' as why,
    closed_at_utc as last_measured_at_utc
from alarms
where in_service(turnout_id) and not has_left(section_id) and closed_by = 'recomputed'
    and closed_at_utc >= newest_charted() and coalesce("asof", newest_measurement()) >= newest_charted();

-- columns of cannot_see(asof := null)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance; all = no newer recording could be used
-- source | varchar | | hammer or passage: never mixed in one chart; empty = no file belongs to either
-- state | varchar | | learning, cannot tell or not measured
-- why | varchar | | in words
-- detectable_pct | double | % | smallest change of frequency seen within a year with 90 %
-- target_pct | double | % | change of frequency that is to be seen
-- n_campaigns | integer | | campaigns with a value
-- last_measured_at_utc | timestamp | UTC | newest campaign with a value
