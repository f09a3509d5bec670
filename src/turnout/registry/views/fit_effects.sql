-- One row per section, score (fit, forecast) and factor (speed, axle load): its effect on the score in points, the
-- others held fixed, with a 95 % interval that allows every passage its own variance (HC3); and raw_change_pct, what
-- groups show when they are compared as they are. No row where the other factors determine one to 99 %.
-- needs: fit_residuals
create or replace view fit_effects as
with factors as (
    select
        turnout_id, section_id, score, count(*) as n,
        any_value(has_speed) as has_speed, any_value(has_load) as has_load,
        any_value(per_speed) as per_speed, any_value(per_load) as per_load,
        sqrt(sum((left_out_pct * (i_vv * v + i_vp * p)) ** 2)) as per_speed_se,
        sqrt(sum((left_out_pct * (i_vp * v + i_pp * p)) ** 2)) as per_load_se,
        regr_slope(value_pct, speed_kmh / 10) as raw_speed, regr_slope(value_pct, axle_load_t) as raw_load,
        count(*) - any_value(n_types) - any_value(has_speed)::integer - any_value(has_load)::integer as freedom
    from fit_residuals group by turnout_id, section_id, score
),
listed as (
    select
        turnout_id, section_id, score, 'speed' as factor, '10 km/h' as per,
        case when has_load then 'train type, axle load' else 'train type' end as held_fixed,
        n, freedom, raw_speed as raw_change_pct, per_speed as change_pct, per_speed_se as change_se_pct
    from factors where has_speed
    union all
    select
        turnout_id, section_id, score, 'axle load', 'tonne',
        case when has_speed then 'train type, speed' else 'train type' end,
        n, freedom, raw_load, per_load, per_load_se
    from factors where has_load
)
select
    turnout_id, section_id, score, factor, per, held_fixed, n, raw_change_pct, change_pct, change_se_pct,
    -- quantile of Student's t after Cornish and Fisher, to 0.005 from five degrees of freedom on
    change_pct - change_se_pct * (1.96 + 2.3724 / freedom + 2.8225 / freedom ** 2 + 2.56 / freedom ** 3) as low_pct,
    change_pct + change_se_pct * (1.96 + 2.3724 / freedom + 2.8225 / freedom ** 2 + 2.56 / freedom ** 3) as high_pct
from listed;
