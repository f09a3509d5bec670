-- One row per passage, sensor and model that counts: neither passage nor model was computed again since.
-- needs: superseded
create or replace view passage_fits_current as
select * from passage_fits_settled
union all
select t.*
from passage_fits_touched t
    anti join superseded s on t.passage_id = s.old_id
    anti join superseded m on t.model_id = m.old_id;

-- columns of passage_fits_current
-- passage_id | varchar | | passage
-- section_id | varchar | | section of the sensor
-- channel | varchar | | sensor
-- model_id | varchar | | model that predicted
-- turnout_id | varchar | | turnout
-- passed_at_utc | timestamp | UTC | time of the passage
-- status | varchar | | result of the fit: accepted = beyond its null band, null_explains = inside it, not_an_impulse = beyond it, but the wheels do not act as impulses
-- fit_pct | double | % | in-sample fit, the paper's equation 22 repaired
-- fit_null_pct | double | % | 95 % quantile of the same fit with random pole pairs
-- forecast_pct | double | % | forecast skill
-- forecast_null_pct | double | % | 95 % quantile of the null
-- leave_one_out_pct | double | % | leave-one-wheel-out score
-- leave_one_out_null_pct | double | % | 95 % quantile of the null
-- parameters_per_s | double | 1/s | parameters re-estimated per second
-- chi_squared_failed_share | double | | share of wheels whose free jump is not along b, p < 0.01
-- along_b_share | double | | share of the free jumps' power along b: near 1 where a wheel acts as an impulse
-- forecast_others_pct | double | % | best forecast skill of the other sections' models at this sensor
-- n_wheels | integer | | wheels fitted
-- peak_ms2 | double | m/s² | largest band-passed acceleration while the train passes
-- run_id | varchar | | content id of the batch
-- wheel_times_s | double[] | s | time of each wheel's impact from the start of the recording; empty where not scored
-- wheel_amplitudes | double[] | | amplitude g of each wheel
-- wheel_amplitudes_se | double[] | | standard errors of wheel_amplitudes
