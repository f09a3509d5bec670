-- One row per flagged chart: when its resonance reaches the limit, as an interval of dates, or why there is none.
-- 80 % interval; a latest date only where a line beats a curve that settles.
create or replace view time_to_threshold as
select
    turnout_id, section_id, band, source, change_pct, change_low_pct, change_high_pct,
    forecast_slope_pct_per_year as slope_pct_per_year, forecast_slope_se_pct_per_year as slope_se_pct_per_year,
    forecast, not_before_utc, not_after_utc,
    case coalesce(case when band = 'amplitude' then 'none' end, forecast)
        when 'none' then 'no limit is set for accelerations'
        when 'reached' then 'the limit is reached'
        when 'settling' then 'no date: the values settle'
        when 'too_short' then 'too early for a date'
        when 'no_limit' then 'no limit in sight'
        else case
            when not_before_utc > last_measured_at_utc
                then 'not before ' || strftime(not_before_utc, '%Y-%m-%d')
                    || case when not_after_utc is null then ', no latest date' else '' end
            else 'the limit may be reached already'
        end || case
            when not_after_utc > last_measured_at_utc
            then ', by ' || strftime(not_after_utc, '%Y-%m-%d') || ' if it goes on like this' else ''
        end
    end as words
from chart_status
where forecast is not null;

-- columns of time_to_threshold
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- change_pct | double | % | change of frequency at the newest campaign since the onset
-- change_low_pct | double | % | 95 % interval, lower end
-- change_high_pct | double | % | upper end
-- slope_pct_per_year | double | %/a | slope since the change
-- slope_se_pct_per_year | double | %/a | its standard error
-- forecast | varchar | | when the limit is reached
-- not_before_utc | timestamp | UTC | 80 % interval of the limit, earliest
-- not_after_utc | timestamp | UTC | 80 % interval of the limit, latest; empty = none
-- words | varchar | | in words
