-- One row per position where an effect grows, named or accepted: when it reaches a size, as an interval of dates. The line
-- through all visits is known with an error; the dates are those at which its 95 % limits reach the size (Fieller 1954).
-- With falls := true the size lies below: when a stiffness has fallen to it.
-- needs: parameter_growth, in_service
create or replace macro growth_to_limit(
    effect := 'hanging_sleeper', quantity := 'gap', size_limit := 0.002, falls := false
) as table
with line as (
    select
        *, case when falls then -1 else 1 end as side, side * (size_limit - mean_value) as missing,
        per_year * (size_limit - mean_value) as towards,
        per_year ** 2 - (1.959964 * per_year_se) ** 2 as growing,
        (size_limit - mean_value) ** 2 - (1.959964 * mean_value_se) ** 2 as short_of
    from parameter_growth
    where in_service(turnout_id) and is_open and term = effect and parameter = quantity and per_year_se > 0
),
roots as (
    select
        *, (towards - sqrt(towards ** 2 - growing * short_of)) / growing as earliest,
        (towards + sqrt(towards ** 2 - growing * short_of)) / growing as latest
    from line
),
dates as (
    select
        *, case
            when side * (value - size_limit) >= 1.959964 * value_se then 'reached'
            when missing <= 0 or short_of <= 0 or earliest is null then 'open'
            when side * per_year <= 0 and growing >= 0 then 'never'
            when mean_at_utc + to_microseconds((earliest * 31557600e6)::bigint) <= found_at_utc then 'open'
            when earliest > 100 then 'never'
            else 'date'
        end as forecast
    from roots
)
select
    turnout_id, position_m, channel, unit, value, value_se, per_year, per_year_se, n_visits, first_at_utc, found_at_utc,
    size_limit as size_limit, forecast,
    case when forecast = 'date' then mean_at_utc + to_microseconds((earliest * 31557600e6)::bigint) end as not_before_utc,
    case
        when forecast = 'date' and side * per_year > 0 and growing > 0 and latest < 100
        then mean_at_utc + to_microseconds((latest * 31557600e6)::bigint)
    end as not_after_utc,
    quantity || case forecast
        when 'reached' then ' has reached '
        when 'open' then ' may have reached '
        when 'never' then case when falls then ' does not fall towards ' else ' does not grow towards ' end
        else ' reaches '
    end || case unit
        when 'm' then printf('%g mm', 1e3 * size_limit)
        when '-' then printf('%g', size_limit)
        else printf('%g ', size_limit) || unit
    end
    || case
        when forecast <> 'date' then ''
        else ' not before ' || strftime(not_before_utc, '%Y-%m-%d')
            || coalesce(', by ' || strftime(not_after_utc, '%Y-%m-%d') || ' if it goes on like this', ', no latest date')
    end || printf(' (95 %%, n = %d visits)', n_visits) as words,
    finding_id
from dates
order by not_before_utc, turnout_id, position_m;

-- columns of growth_to_limit(effect := 'hanging_sleeper', quantity := 'gap', size_limit := 0.002, falls := false)
-- turnout_id | varchar | | turnout
-- position_m | double | m | position of the effect, to 0.1 m
-- channel | varchar | | its sensor
-- unit | varchar | | unit of value, growth and limit
-- value | double | | value at the newest visit
-- value_se | double | | its standard error
-- per_year | double | | growth per year
-- per_year_se | double | | its standard error
-- n_visits | integer | | visits behind it
-- first_at_utc | timestamp | UTC | time of the first visit
-- found_at_utc | timestamp | UTC | time of the newest
-- size_limit | decimal(4,3) | | the size asked for
-- forecast | varchar | | date; reached; open: it may have been reached; never: it does not grow towards it within 100 years
-- not_before_utc | timestamp | UTC | 95 % interval, earliest
-- not_after_utc | timestamp | UTC | latest; empty = none
-- words | varchar | | the same in words
-- finding_id | varchar | | newest finding with it
