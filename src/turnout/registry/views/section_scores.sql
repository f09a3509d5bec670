-- One row per train and section: the mean scores of its sensors. They record the same wheels: three sensors are not
-- three trains, nor are the recordings of two loggers two trains. A standard error over them would be too small.
-- needs: passage_scores, passage_trains
create or replace view section_scores as
select
    turnout_id, section_id, min(passage_id) as passage_id, min(passed_at_utc) as passed_at_utc, count(*) as n,
    avg(fit_pct) as fit_pct, count(fit_pct) as n_fit, avg(fit_null_pct) as fit_null_pct,
    avg(forecast_pct) as forecast_pct, count(forecast_pct) as n_forecast, avg(forecast_null_pct) as forecast_null_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, avg((status = 'null_explains')::integer) as null_share,
    coalesce(min(nullif(train_type, 'unknown')), min(train_type)) as train_type,  -- of recordings that know the type
    coalesce(avg(speed_kmh) filter (train_type <> 'unknown'), avg(speed_kmh)) as speed_kmh,
    coalesce(avg(axle_load_t) filter (train_type <> 'unknown'), avg(axle_load_t)) as axle_load_t,
    coalesce(min(cluster_id) filter (train_type <> 'unknown'), min(cluster_id)) as cluster_id,
    coalesce(min(nullif(track, 'unknown')), min(track)) as track
from passage_scores join passage_trains using (turnout_id, passage_id)
group by turnout_id, section_id, train_id;

-- columns of section_scores
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- passage_id | varchar | | passage, or one of those of the train
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
-- track | varchar | | track taken
