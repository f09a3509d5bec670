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
