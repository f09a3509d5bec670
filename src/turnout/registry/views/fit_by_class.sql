-- One row per section and class of trains: mean, spread and standard error of the scores, as in the paper's Table 4.
-- kind_of_class is 'type', 'speed' (20 km/h wide) or 'axle_load' (2.5 t wide): the first has names, the others lower edges.
-- Train type, speed and axle load go together on a real line: a difference between classes is not yet their effect.
-- Means, spread and errors are those of the passages, whose sensors are averaged first.
-- needs: section_scores
create or replace macro fit_by_class(kind_of_class) as table
select
    turnout_id, section_id,
    case when kind_of_class = 'type' then train_type end as class_name,
    case kind_of_class
        when 'speed' then 20 * floor(speed_kmh / 20)
        when 'axle_load' then 2.5 * floor(axle_load_t / 2.5)
    end as class_from,
    sum(n)::bigint as n, count(*) as n_passages,
    avg(fit_pct) as fit_pct, stddev_samp(fit_pct) as fit_sd_pct, stddev_samp(fit_pct) / sqrt(count(fit_pct)) as fit_se_pct,
    avg(fit_null_pct) as fit_null_pct,
    avg(forecast_pct) as forecast_pct, stddev_samp(forecast_pct) as forecast_sd_pct,
    stddev_samp(forecast_pct) / sqrt(count(forecast_pct)) as forecast_se_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, stddev_samp(leave_one_out_pct) as leave_one_out_sd_pct,
    stddev_samp(leave_one_out_pct) / sqrt(count(leave_one_out_pct)) as leave_one_out_se_pct,
    avg(null_share) as null_share
from section_scores
group by turnout_id, section_id, class_name, class_from;

-- columns of fit_by_class(kind_of_class)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- class_name | varchar | | name of the class; empty for classes of speed or axle load
-- class_from | double | | lower edge of the class [km/h, t]; empty for types, and where it is not known
-- n | bigint | | fits
-- n_passages | bigint | | passages
-- fit_pct | double | % | mean in-sample fit
-- fit_sd_pct | double | % | its spread between passages
-- fit_se_pct | double | % | standard error of the mean, passages taken as independent
-- fit_null_pct | double | % | mean of the null's 95 % quantile
-- forecast_pct | double | % | mean forecast skill
-- forecast_sd_pct | double | % | its spread
-- forecast_se_pct | double | % | its standard error
-- leave_one_out_pct | double | % | mean leave-one-wheel-out score
-- leave_one_out_sd_pct | double | % | its spread
-- leave_one_out_se_pct | double | % | its standard error
-- null_share | double | | share of fits that their null explains
