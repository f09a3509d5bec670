-- One row per passage and section: the mean scores of its sensors. They record the same wheels: three sensors are not
-- three trains, and a standard error over sensors instead of trains is too small.
-- needs: passage_scores
create or replace view section_scores as
select
    turnout_id, section_id, passage_id, passed_at_utc, count(*) as n,
    avg(fit_pct) as fit_pct, count(fit_pct) as n_fit, avg(fit_null_pct) as fit_null_pct,
    avg(forecast_pct) as forecast_pct, count(forecast_pct) as n_forecast, avg(forecast_null_pct) as forecast_null_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, avg((status = 'null_explains')::integer) as null_share,
    any_value(train_type) as train_type, any_value(speed_kmh) as speed_kmh, any_value(axle_load_t) as axle_load_t,
    any_value(cluster_id) as cluster_id
from passage_scores
group by turnout_id, section_id, passage_id, passed_at_utc;

-- columns of section_scores
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- passage_id | varchar | | passage
-- passed_at_utc | timestamp | UTC | when it passed
-- n | bigint | | fits: sensors and models
-- fit_pct | double | % | mean in-sample fit of the sensors
-- n_fit | bigint | | fits that have one
-- fit_null_pct | double | % | mean of the 95 % quantiles of random models
-- forecast_pct | double | % | mean forecast skill
-- n_forecast | bigint | | fits that have one
-- forecast_null_pct | double | % | mean of the 95 % quantiles of random models
-- leave_one_out_pct | double | % | mean leave-one-wheel-out score
-- null_share | double | | share of the fits that random models explain as well
-- train_type | varchar | | type of train
-- speed_kmh | double | km/h | speed
-- axle_load_t | double | t | mean axle load
-- cluster_id | varchar | | cluster of like passages
