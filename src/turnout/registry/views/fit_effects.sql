-- One row per section, score (fit, forecast) and factor (speed, axle load): its effect on the score in points, the
-- others held fixed, with a 95 % interval that allows every passage its own variance (HC3) and takes its sensors as one; and raw_change_pct, what
-- groups show when they are compared as they are. No row where the other factors determine one to 99 %.
-- needs: fit_residuals, students_t
create or replace view fit_effects as
with sections as (
    select
        turnout_id, section_id, score, sum(n_sensors)::bigint as n_scores,
        count(*) - any_value(n_types) - any_value(has_speed)::integer - any_value(has_load)::integer as freedom,
        unnest(['speed', 'axle load']) as factor, unnest(['10 km/h', 'tonne']) as per,
        unnest([any_value(has_speed), any_value(has_load)]) as known,
        unnest([
            case when any_value(has_load) then 'train type, axle load' else 'train type' end,
            case when any_value(has_speed) then 'train type, speed' else 'train type' end
        ]) as held_fixed,
        unnest([regr_slope(value_pct, speed_kmh / 10), regr_slope(value_pct, axle_load_t)]) as raw_change_pct,
        unnest([any_value(per_speed), any_value(per_load)]) as change_pct,
        unnest([
            sqrt(sum((left_out_pct * (i_vv * v + i_vp * p)) ** 2)), sqrt(sum((left_out_pct * (i_vp * v + i_pp * p)) ** 2))
        ]) as change_se_pct
    from fit_residuals group by turnout_id, section_id, score
)
select
    turnout_id, section_id, score, factor, per, held_fixed, n_scores as n, raw_change_pct, change_pct, change_se_pct,
    change_pct - change_se_pct * students_t(freedom) as low_pct,
    change_pct + change_se_pct * students_t(freedom) as high_pct
from sections where known;

-- columns of fit_effects
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- score | varchar | | fit or forecast
-- factor | varchar | | speed or axle load
-- per | varchar | | step that the changes are for: 10 km/h or a tonne
-- held_fixed | varchar | | what was held fixed
-- n | bigint | | scores
-- raw_change_pct | double | % | change per step with nothing held fixed
-- change_pct | double | % | change per step, the others held fixed
-- change_se_pct | double | % | standard error of change_pct (HC3)
-- low_pct | double | % | lower end of the 95 % interval of change_pct
-- high_pct | double | % | upper end
