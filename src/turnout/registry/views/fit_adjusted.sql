-- One row per section, score (fit, forecast), factor (train type, speed, axle load) and class: the bars of the paper's
-- charts. score_pct with spread and standard error of the passages as measured; adjusted_pct what it would be if every class had the
-- section's mean of the other two factors, its standard error without that of their slopes (see fit_effects).
-- Classes are 20 km/h and 2.5 t wide.
-- needs: fit_residuals
create or replace view fit_adjusted as
with classes as (
    select
        turnout_id, section_id, score, n_sensors, value_pct, null_pct,
        unnest(['train type', 'speed', 'axle load']) as factor,
        unnest([
            train_type, printf('%d-%d km/h', 20 * floor(speed_kmh / 20)::integer, 20 * floor(speed_kmh / 20)::integer + 20),
            printf('%.1f-%.1f t', 2.5 * floor(axle_load_t / 2.5), 2.5 * floor(axle_load_t / 2.5) + 2.5)
        ]) as class,
        unnest([null, 20 * floor(speed_kmh / 20), 2.5 * floor(axle_load_t / 2.5)]) as class_from,
        unnest([of_type_pct, of_speed_pct, of_load_pct]) + residual_pct as adjusted_pct
    from fit_residuals
)
select
    turnout_id, section_id, score, factor, class, any_value(class_from) as class_from,
    sum(n_sensors)::bigint as n, count(*) as n_passages,
    avg(value_pct) as score_pct, stddev_samp(value_pct) as score_sd_pct,
    stddev_samp(value_pct) / sqrt(count(*)) as score_se_pct, avg(null_pct) as null_pct,
    avg(adjusted_pct) as adjusted_pct, stddev_samp(adjusted_pct) / sqrt(count(*)) as adjusted_se_pct
from classes where class is not null
group by turnout_id, section_id, score, factor, class;
