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

-- columns of fit_adjusted
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- score | varchar | | fit or forecast
-- factor | varchar | | train type, speed or axle load
-- class | varchar | | class of it
-- class_from | double | | lower end of the class, km/h or t; empty for train types
-- n | bigint | | scores
-- n_passages | bigint | | passages
-- score_pct | double | % | mean of the scores
-- score_sd_pct | double | % | spread of the passages: standard deviation
-- score_se_pct | double | % | standard error of score_pct
-- null_pct | double | % | mean of the 95 % quantiles of random models
-- adjusted_pct | double | % | mean with the other two factors at the section's mean
-- adjusted_se_pct | double | % | standard error of adjusted_pct, without that of the slopes
