-- One row per passage, sensor and model that counts: its scores beside what the train was.
-- needs: passages_current, passage_fits_current
create or replace view passage_scores as
select
    f.turnout_id, f.section_id, f.channel, f.passed_at_utc, f.passage_id, f.model_id, f.status,
    f.fit_pct, f.fit_null_pct, f.forecast_pct, f.forecast_null_pct, f.leave_one_out_pct, f.leave_one_out_null_pct,
    f.chi_squared_failed_share, f.along_b_share, f.forecast_others_pct, f.n_wheels, f.peak_ms2,
    p.train_type, p.speed_kmh, p.axle_load_t, p.track, p.direction, p.n_axles, p.cluster_id, p.rail_temperature_c
from passage_fits_current f join passages_current p on f.passage_id = p.passage_id
where f.status <> 'rejected' and p.status <> 'rejected';
