-- One row per passage and score (fit, forecast), mean of its sensors: the contributions of train type, speed and axle load.
-- Least squares with a level per train type and slopes in speed and axle load, per section: the ground of fit_effects
-- and fit_adjusted. If a fifth of the loads is missing, they are left out, and the slope in speed contains their effect.
-- Windows only, no part twice: a condition on turnout_id or section_id reaches the files.
-- needs: section_scores
create or replace view fit_residuals as
with measured as (
    select
        turnout_id, section_id, passage_id, coalesce(train_type, 'unknown') as train_type, speed_kmh, axle_load_t,
        unnest(['fit', 'forecast']) as score, unnest([fit_pct, forecast_pct]) as value_pct,
        unnest([fit_null_pct, forecast_null_pct]) as null_pct, unnest([n_fit, n_forecast]) as n_sensors
    from section_scores
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
summed as (
    select
        *, count(*) over place as n, count(distinct train_type) over place as n_types,
        sum(v * v) over place as vv, sum(v * p) over place as vp, sum(p * p) over place as pp,
        sum(v * y) over place as vy, sum(p * y) over place as py,
        avg(speed_kmh) over place as mean_speed, avg(axle_load_t) over place as mean_load,
        avg(value_pct) over place as mean_pct,
        -- a factor that the others determine to 99 % says nothing by itself
        vv > 0.01 * n * var_pop(speed_kmh / 10) over place as speed_varies,
        coalesce(pp > 0.01 * n * var_pop(axle_load_t) over place, false) as load_varies,
        vp * vp < 0.99 * vv * pp or vv * pp = 0 as apart
    from centred window place as (partition by turnout_id, section_id, score)
),
solved as (
    select
        *, speed_varies and apart and n > n_types + 4 as has_speed, load_varies and apart and n > n_types + 4 as has_load,
        case when has_speed and has_load then vv * pp - vp * vp end as det,
        case when det is not null then pp / det when has_speed then 1 / vv else 0 end as i_vv,
        case when det is not null then vv / det when has_load then 1 / pp else 0 end as i_pp,
        case when det is not null then -vp / det else 0 end as i_vp,
        i_vv * vy + i_vp * py as per_speed, i_vp * vy + i_pp * py as per_load
    from summed
)
select
    turnout_id, section_id, score, passage_id, train_type, speed_kmh, axle_load_t, value_pct, null_pct,
    n_sensors, n, n_types, has_speed, has_load, per_speed, per_load, i_vv, i_vp, i_pp, v, p,
    type_pct - per_speed * (speed_kmh - 10 * v - mean_speed) / 10
        - coalesce(per_load * (axle_load_t - p - mean_load), 0) as of_type_pct,
    mean_pct + per_speed * (speed_kmh - mean_speed) / 10 as of_speed_pct,
    mean_pct + coalesce(per_load * (axle_load_t - mean_load), 0) as of_load_pct,
    y - per_speed * v - per_load * p as residual_pct,
    -- what it would be had this passage not been fitted (HC3)
    residual_pct / (1 - least(1.0 / n_type + i_vv * v * v + 2 * i_vp * v * p + i_pp * p * p, 0.999)) as left_out_pct
from solved;

-- columns of fit_residuals
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- score | varchar | | fit or forecast
-- passage_id | varchar | | passage
-- train_type | varchar | | type of train
-- speed_kmh | double | km/h | speed
-- axle_load_t | double | t | mean axle load
-- value_pct | double | % | the score
-- null_pct | double | % | 95 % quantile of random models
-- n_sensors | bigint | | sensors that have the score
-- n | bigint | | passages of the section
-- n_types | bigint | | train types among them
-- has_speed | boolean | | the speed varies within the types and can be distinguished from the load
-- has_load | boolean | | the load varies within the types and can be distinguished from the speed
-- per_speed | double | | change of the score per 10 km/h, the others held fixed
-- per_load | double | | change of the score per tonne, the others held fixed
-- i_vv | double | | inverse of the normal matrix, speed
-- i_vp | double | | inverse of the normal matrix, speed and load
-- i_pp | double | | inverse of the normal matrix, load
-- v | double | | speed against the mean of its type, 10 km/h
-- p | double | | load against the mean of its type, t
-- of_type_pct | double | % | score of the train type at the section's mean speed and load
-- of_speed_pct | double | % | section's mean score at this speed
-- of_load_pct | double | % | section's mean score at this load
-- residual_pct | double | % | what type, speed and load leave over
-- left_out_pct | double | % | the same had this passage not been fitted
