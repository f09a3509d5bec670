-- One row per receptance that counts: without what was computed again since.
-- needs: superseded
create or replace view receptances_current as
select t.*
from receptances t anti join superseded s on t.model_id = s.old_id;

-- columns of receptances_current
-- model_id | varchar | | model it belongs to
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- campaign_id | varchar | | campaign
-- measured_at_utc | timestamp | UTC | time of the campaign
-- n_impacts | integer | | impacts averaged
-- gate | varchar | | gate used
-- gate_required | double | | coherence that the gate asks for; empty in rows of earlier versions
-- valid_to_hz | double | Hz | band edge of the hammer
-- window_decay_per_s | double | 1/s | decay a of the exponential window: the receptances are those at iω + a, resonances look damped by so much more; 0 or empty = none
-- frequency_hz | float[] | Hz | frequency lines
-- h1_real_m_n | float[] | m/N | receptance by H1, real part
-- h1_imag_m_n | float[] | m/N | receptance by H1, imaginary part
-- h2_abs_m_n | float[] | m/N | magnitude of the receptance by H2, upper end of the bracket
-- hv_abs_m_n | float[] | m/N | magnitude of the receptance by Hv
-- coherence | float[] | | coherence estimate
-- coherence_low | float[] | | lower two-sided 95 % limit
-- coherence_high | float[] | | upper two-sided 95 % limit
-- passed | boolean[] | | line passed the gate
-- decay_rate_hz | double | Hz | sampling rate of decay and decay_model
-- decay_ms2 | float[] | m/s² | free decay of one accepted impact
-- decay_model_ms2 | float[] | m/s² | the model's free decay fitted to it
-- stabilisation_json | varchar | | poles over model order for the stabilization diagram, JSON
-- run_id | varchar | | content id of the batch
-- response_density_m2_s3 | float[] | (m/s²)²/Hz | power spectral density of the response, averaged over the impacts, at frequency_hz
-- density_low_factor | double | | response_density_m2_s3 times it is the lower 95 % limit (chi-squared with two degrees of freedom per impact)
-- density_high_factor | double | | the same for the upper 95 % limit
