-- One row per passage and sensor behind a number: those of one section from one time up to, not including, another.
-- needs: passage_scores
create or replace macro passages_behind(section, from_utc, to_utc) as table
select s.*, r.path, r.recording_id
from passage_scores s join passages_current p on s.passage_id = p.passage_id
    left join recordings r on r.recording_id = p.recording_id and r.result_id = p.result_id
where s.section_id = section and s.passed_at_utc >= from_utc::timestamp and s.passed_at_utc < to_utc::timestamp
order by s.passed_at_utc, s.channel;

-- columns of passages_behind(section, from_utc, to_utc)
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
-- path | varchar | | file of the passage, relative to the raw root
-- recording_id | varchar | | content id of that file
