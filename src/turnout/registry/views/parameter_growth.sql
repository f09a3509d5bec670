-- One row per turnout, effect, position, sensor and parameter that was named or accepted: its latest value, and its growth.
-- A straight line through all visits, each weighted by its standard error; NULL with a single visit. Where the visits
-- scatter about the line by more than their standard errors, those of the line are larger by the same factor (Birge 1932).
-- Visits before ballast work on their sections, unless it is only planned, do not count for effects of the ballast.
-- is_open: no newer visit diagnosed its sections.
-- needs: findings_newest
create or replace view parameter_growth as
with undone as (
    select distinct f.finding_id
    from findings_current f join events e on e.turnout_id = f.turnout_id and e.event_at_utc > f.found_at_utc
    where e.resets_ballast and e.event_at_utc < published_at() + interval 1 day and (
        e.section_id is null or list_contains(string_split(f.sections, ', '), split_part(e.section_id, '/', -1)))
),
visits as (
    select
        p.turnout_id, p.term, round(p.position_m, 1) as position_m, p.channel, p.parameter, p.unit, p.found_at_utc,
        p.value, p.value_se, p.finding_id, p.value_se ** -2 as weight,
        epoch_us(p.found_at_utc) / 31557600e6 as year
    from mismatch_parameters p join findings_current f using (finding_id)
    where p.value_se > 0 and (p.accepted or f.verdict = 'named') and not (
        p.term in (
            'hanging_sleeper', 'lifting_sleepers', 'local_ballast', 'ballast_hardening', 'ballast_inertia'
        ) and p.finding_id in (select finding_id from undone))
),
centred as (
    select
        *, year - sum(weight * year) over thing / sum(weight) over thing as t,
        value - sum(weight * value) over thing / sum(weight) over thing as v
    from visits
    window thing as (partition by turnout_id, term, position_m, channel, parameter, unit)
),
sums as (
    select
        turnout_id, term, position_m, channel, parameter, unit, count(*)::integer as n_visits,
        min(found_at_utc) as first_at_utc, max(found_at_utc) as found_at_utc, arg_max(value, found_at_utc) as value,
        arg_max(value_se, found_at_utc) as value_se, arg_max(finding_id, found_at_utc) as finding_id,
        sum(weight * t * value) as product, sum(weight * value) / sum(weight) as mean_value,
        sum(weight) ** -0.5 as mean_value_se, sum(weight * year) / sum(weight) as mean_year,
        case when min(found_at_utc) < max(found_at_utc) then sum(weight * t * t) end as spread,
        sum(weight * v * v) as square
    from centred group by all
),
scaled as (
    select
        *, case when n_visits > 2 then sqrt(greatest(
            1, (square - coalesce(product ** 2 / spread, 0)) / (n_visits - 2)
        )) else 1 end as excess
    from sums
)
select
    turnout_id, term, position_m, channel, parameter, unit, n_visits, first_at_utc, found_at_utc, value, value_se,
    product / spread as per_year, excess * spread ** -0.5 as per_year_se, mean_value,
    excess * mean_value_se as mean_value_se,
    make_timestamp((mean_year * 31557600e6)::bigint) as mean_at_utc,
    finding_id in (select finding_id from findings_newest) as is_open, finding_id
from scaled;

-- columns of parameter_growth
-- turnout_id | varchar | | turnout
-- term | varchar | | effect
-- position_m | double | m | its position along the turnout, to 0.1 m
-- channel | varchar | | its sensor
-- parameter | varchar | | parameter of the effect
-- unit | varchar | | unit of value and growth
-- n_visits | integer | | visits behind it
-- first_at_utc | timestamp | UTC | time of the first visit
-- found_at_utc | timestamp | UTC | time of the newest
-- value | double | | value at the newest visit, in the unit of the row
-- value_se | double | | its standard error
-- per_year | double | | growth per year, weighted least squares; empty with one visit
-- per_year_se | double | | its standard error
-- mean_value | double | | weighted mean of the values: the line at mean_at_utc
-- mean_value_se | double | | its standard error, independent of that of the growth
-- mean_at_utc | timestamp | UTC | weighted mean of the times
-- is_open | boolean | | the newest visit of its sections still has it
-- finding_id | varchar | | newest finding with it
