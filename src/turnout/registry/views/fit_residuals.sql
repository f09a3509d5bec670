-- One row per passage, sensor and score (fit, forecast): what its train type, speed and axle load each contribute.
-- Least squares with a level per train type and slopes in speed and axle load, per section: the ground of fit_effects
-- and fit_adjusted. Where a fifth of the loads is missing they are left out, and the speed stands for them.
-- needs: passage_scores
create or replace view fit_residuals as
with measured as (
    select
        turnout_id, section_id, passage_id, coalesce(train_type, 'unknown') as train_type, speed_kmh, axle_load_t,
        unnest(['fit', 'forecast']) as score, unnest([fit_pct, forecast_pct]) as value_pct,
        unnest([fit_null_pct, forecast_null_pct]) as null_pct
    from passage_scores
    where speed_kmh is not null
),
used as (
    select *, count(axle_load_t) over place >= 0.8 * count(*) over place as loads_known
    from measured where value_pct is not null
    window place as (partition by turnout_id, section_id, score)
    qualify not loads_known or axle_load_t is not null
),
centred as (
    select
        *, count(*) over type as n_type, avg(value_pct) over type as type_pct,
        (speed_kmh - avg(speed_kmh) over type) / 10 as v,
        case when loads_known then axle_load_t - avg(axle_load_t) over type else 0 end as p, value_pct - type_pct as y
    from used window type as (partition by turnout_id, section_id, score, train_type)
),
sums as (
    select
        turnout_id, section_id, score, count(*) as n, count(distinct train_type) as n_types,
        sum(v * v) as vv, sum(v * p) as vp, sum(p * p) as pp, sum(v * y) as vy, sum(p * y) as py,
        avg(speed_kmh) as mean_speed, avg(axle_load_t) as mean_load, avg(value_pct) as mean_pct,
        -- a factor that the others determine to 99 % says nothing by itself
        vv > 0.01 * count(*) * var_pop(speed_kmh / 10) as speed_varies,
        coalesce(pp > 0.01 * count(*) * var_pop(axle_load_t), false) as load_varies,
        vp * vp < 0.99 * vv * pp or vv * pp = 0 as apart
    from centred group by turnout_id, section_id, score
),
solved as (
    select
        *, speed_varies and apart and n > n_types + 4 as has_speed, load_varies and apart and n > n_types + 4 as has_load,
        case when has_speed and has_load then vv * pp - vp * vp end as det,
        case when det is not null then pp / det when has_speed then 1 / vv else 0 end as i_vv,
        case when det is not null then vv / det when has_load then 1 / pp else 0 end as i_pp,
        case when det is not null then -vp / det else 0 end as i_vp,
        i_vv * vy + i_vp * py as per_speed, i_vp * vy + i_pp * py as per_load
    from sums
)
select
    c.turnout_id, c.section_id, c.score, c.passage_id, c.train_type, c.speed_kmh, c.axle_load_t, c.value_pct, c.null_pct,
    s.n, s.n_types, s.has_speed, s.has_load, s.per_speed, s.per_load, s.i_vv, s.i_vp, s.i_pp, c.v, c.p,
    c.type_pct - s.per_speed * (c.speed_kmh - 10 * c.v - s.mean_speed) / 10
        - coalesce(s.per_load * (c.axle_load_t - c.p - s.mean_load), 0) as of_type_pct,
    s.mean_pct + s.per_speed * (c.speed_kmh - s.mean_speed) / 10 as of_speed_pct,
    s.mean_pct + coalesce(s.per_load * (c.axle_load_t - s.mean_load), 0) as of_load_pct,
    c.y - s.per_speed * c.v - s.per_load * c.p as residual_pct,
    -- what it would be without this passage (HC3)
    residual_pct
        / (1 - least(1.0 / c.n_type + s.i_vv * c.v * c.v + 2 * s.i_vp * c.v * c.p + s.i_pp * c.p * c.p, 0.999)) as left_out_pct
from centred c join solved s using (turnout_id, section_id, score);
