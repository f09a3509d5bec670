-- One row per section, cluster of like passages and week (Monday, UTC): the scores of like trains, week by week.
-- Standard errors are those of the passages, whose sensors are averaged first.
-- needs: section_scores
create or replace view fit_by_cluster_week as
select
    turnout_id, section_id, cluster_id, date_trunc('week', passed_at_utc)::timestamp as week_utc,
    sum(n)::bigint as n, count(*) as n_passages,
    avg(fit_pct) as fit_pct, stddev_samp(fit_pct) / sqrt(count(fit_pct)) as fit_se_pct,
    avg(forecast_pct) as forecast_pct, stddev_samp(forecast_pct) / sqrt(count(forecast_pct)) as forecast_se_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, avg(speed_kmh) as speed_kmh, avg(axle_load_t) as axle_load_t
from section_scores
group by turnout_id, section_id, cluster_id, date_trunc('week', passed_at_utc);

-- columns of fit_by_cluster_week
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- cluster_id | varchar | | cluster of like passages; empty = not clustered
-- week_utc | timestamp | UTC | Monday of the week, 00:00
-- n | bigint | | fits
-- n_passages | bigint | | passages
-- fit_pct | double | % | mean in-sample fit
-- fit_se_pct | double | % | standard error of the mean, passages taken as independent
-- forecast_pct | double | % | mean forecast skill
-- forecast_se_pct | double | % | its standard error
-- leave_one_out_pct | double | % | mean leave-one-wheel-out score
-- speed_kmh | double | km/h | mean speed
-- axle_load_t | double | t | mean axle load
