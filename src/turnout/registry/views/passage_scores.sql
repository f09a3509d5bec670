-- One row per scored passage, sensor and model that counts: its scores beside what the train was.
-- needs: passages_current, passage_fits_current
create or replace view passage_scores as
select
    f.turnout_id, f.section_id, f.channel, f.passed_at_utc, f.passage_id, f.model_id, f.status,
    f.fit_pct, f.fit_null_pct, f.forecast_pct, f.forecast_null_pct, f.leave_one_out_pct, f.leave_one_out_null_pct,
    f.chi_squared_failed_share, f.along_b_share, f.forecast_others_pct, f.n_wheels, f.peak_ms2,
    p.train_type, p.speed_kmh, p.axle_load_t, p.track, p.direction, p.n_axles, p.cluster_id, p.rail_temperature_c
from passage_fits_current f join passages_current p on f.passage_id = p.passage_id
where f.status not in ('rejected', 'peak_only') and p.status <> 'rejected';

-- columns of passage_scores
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section of the sensor
-- channel | varchar | | sensor
-- passed_at_utc | timestamp | UTC | time of the passage
-- passage_id | varchar | | passage
-- model_id | varchar | | model that predicted
-- status | varchar | | result of the fit: accepted = beyond its null band, null_explains = inside it, not_an_impulse = beyond it, but the wheels do not act as impulses
-- fit_pct | double | % | in-sample fit, the paper's equation 22 repaired
-- fit_null_pct | double | % | 95 % quantile of the same fit with random pole pairs
-- forecast_pct | double | % | forecast skill
-- forecast_null_pct | double | % | 95 % quantile of the null
-- leave_one_out_pct | double | % | leave-one-wheel-out score
-- leave_one_out_null_pct | double | % | 95 % quantile of the null
-- chi_squared_failed_share | double | | share of wheels whose free jump is not along b, p < 0.01
-- along_b_share | double | | share of the free jumps' power along b: near 1 where a wheel acts as an impulse
-- forecast_others_pct | double | % | best forecast skill of the other sections' models at this sensor
-- n_wheels | integer | | wheels fitted
-- peak_ms2 | double | m/s² | largest band-passed acceleration while the train passes
-- train_type | varchar | | type of train, 'unknown' where no template fits
-- speed_kmh | double | km/h | speed halfway through the passage
-- axle_load_t | double | t | mean axle load; empty where not available
-- track | varchar | | track taken
-- direction | varchar | | direction of travel through the turnout
-- n_axles | integer | | axles counted
-- cluster_id | varchar | | cluster of like passages
-- rail_temperature_c | double | °C | rail temperature
