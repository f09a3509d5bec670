-- One row per mode that does not continue the track of its section and band: another mode, or a sudden change.
-- A mode whose own error is so large that no such departure would show is listed as uncertain: divided by its own error,
-- its distance is small whatever it is. The usual error is that of the track: scatter and median error of the campaigns.
-- needs: modes_current
create or replace view modes_off_track as
with points as (
    select
        model_id, section_id, turnout_id, band, measured_at_utc, method, frequency_hz, frequency_se_hz,
        damping_ratio, damping_se, c_block[1] ^ 2 + c_block[2] ^ 2 as residue,
        shape_ratio[1] as shape_re, shape_ratio[2] as shape_im, shape_covariance as shape_cov, n_shape
    from modes_current where source = 'hammer'
),
history as (
    select
        p.model_id, p.band, count(*) as n_history,
        median(h.frequency_hz) as frequency_track_hz, median(h.damping_ratio) as damping_track,
        median(h.residue) as residue_track,
        median(h.frequency_se_hz) as usual_frequency_se_hz, median(h.damping_se) as usual_damping_se,
        (quantile_cont(h.frequency_hz, 0.75) - quantile_cont(h.frequency_hz, 0.25)) / 1.349 as frequency_sd_hz,
        (quantile_cont(h.damping_ratio, 0.75) - quantile_cont(h.damping_ratio, 0.25)) / 1.349 as damping_sd,
        count(h.shape_re) as n_shape_history,
        median(h.shape_re) as shape_track_re, median(h.shape_im) as shape_track_im,
        1.4826 * mad(h.shape_re) as shape_sd_re,
        1.4826 * mad(h.shape_im) as shape_sd_im,
        median(h.shape_cov[1] + h.shape_cov[3]) as usual_shape_variance
    from points p join points h
        on p.section_id = h.section_id and p.band = h.band and p.method is not distinct from h.method
        and h.measured_at_utc < p.measured_at_utc
    group by p.model_id, p.band
),
judged as (
    select
        p.*, h.* exclude (model_id, band),
        abs(p.frequency_hz - h.frequency_track_hz)
            / sqrt(h.frequency_sd_hz ^ 2 + coalesce(p.frequency_se_hz, 0.0) ^ 2 + 1e-12) as frequency_distance,
        abs(p.damping_ratio - h.damping_track)
            / sqrt(h.damping_sd ^ 2 + coalesce(p.damping_se, 0.0) ^ 2 + 1e-12) as damping_distance,
        coalesce(p.frequency_se_hz, 0.0)
            / sqrt(h.frequency_sd_hz ^ 2 + coalesce(h.usual_frequency_se_hz, 0.0) ^ 2 + 1e-12) as frequency_error,
        coalesce(p.damping_se, 0.0)
            / sqrt(h.damping_sd ^ 2 + coalesce(h.usual_damping_se, 0.0) ^ 2 + 1e-12) as damping_error,
        sqrt(
            (p.shape_cov[1] + p.shape_cov[3])
            / (h.shape_sd_re ^ 2 + h.shape_sd_im ^ 2 + h.usual_shape_variance + 1e-12)
        ) as shape_error
    from points p join history h on p.model_id = h.model_id and p.band = h.band
    where h.n_history >= 5
),
-- Hotelling's T² of the ratio: its covariance is estimated from n_shape impacts. Median deviations hold one mode even
-- where another had its name in a third of the campaigns, quartiles do not.
shapes as (
    select
        model_id, band, n_shape - 1.0 as freedom,
        (1.0 + shape_re * shape_track_re + shape_im * shape_track_im) ^ 2
            + (shape_im * shape_track_re - shape_re * shape_track_im) ^ 2 as overlap,
        (1.0 + shape_re ^ 2 + shape_im ^ 2) * (1.0 + shape_track_re ^ 2 + shape_track_im ^ 2) as norms,
        shape_re - shape_track_re as d_re, shape_im - shape_track_im as d_im, shape_cov[2] as c,
        shape_cov[1] + shape_sd_re ^ 2 + 1e-12 as v_re, shape_cov[3] + shape_sd_im ^ 2 + 1e-12 as v_im
    from judged where n_shape_history >= 5 and n_shape >= 3
),
shape_distances as (
    select
        model_id, band, overlap / norms as shape_mac,
        sqrt((freedom - 1.0) * ln(1.0
            + (d_re ^ 2 * v_im - 2.0 * d_re * d_im * c + d_im ^ 2 * v_re) / (v_re * v_im - c ^ 2) / freedom
        )) as shape_distance
    from shapes
)
select
    section_id, turnout_id, band, measured_at_utc, frequency_hz, frequency_track_hz, frequency_distance,
    damping_ratio, damping_track, damping_distance, residue / nullif(residue_track, 0.0) as residue_ratio, n_history,
    model_id, shape_mac, shape_distance, frequency_se_hz, damping_se,
    greatest(frequency_error, damping_error, case when n_shape_history >= 5 then shape_error end) as relative_error,
    case
        when frequency_distance > 5.0 or damping_distance > 5.0 or shape_distance > 5.0 then 'departs' else 'uncertain'
    end as verdict
from judged left join shape_distances using (model_id, band)
where frequency_distance > 5.0 or damping_distance > 5.0 or shape_distance > 5.0 or relative_error > 5.0
order by measured_at_utc, section_id, band;

-- columns of modes_off_track
-- section_id | varchar | | section
-- turnout_id | varchar | | turnout
-- band | varchar | | which resonance
-- measured_at_utc | timestamp | UTC | time of the campaign
-- frequency_hz | double | Hz | frequency of this mode
-- frequency_track_hz | double | Hz | median over the earlier campaigns of the section
-- frequency_distance | double | | distance from it in standard deviations, of the track (by quartiles) and of this mode together; above 5 the mode is listed
-- damping_ratio | double | | damping ratio of this mode
-- damping_track | double | | median over the earlier campaigns of the section
-- damping_distance | double | | the same distance of the damping ratio; above 5 the mode is listed
-- residue_ratio | double | | c1² + c2² of this mode over its median over the earlier campaigns: far from 1 for another mode
-- n_history | bigint | | earlier campaigns; at least five are needed
-- model_id | varchar | | model
-- shape_mac | double | | modal assurance criterion of the shape at both responses with the median shape of the earlier campaigns: 1 for the same shape; empty without a second response in this and in five earlier campaigns
-- shape_distance | double | | distance of shape_ratio from its median over the earlier campaigns by their median deviation and its own covariance, as that of two normal variables of the same probability (Hotelling); above 5 the mode is listed
-- frequency_se_hz | double | Hz | standard error of frequency_hz
-- damping_se | double | | standard error of damping_ratio
-- relative_error | double | | own standard error over the usual one of the track (scatter and median error of the earlier campaigns), largest of frequency, damping and shape; above 5 the mode is listed, too
-- verdict | varchar | | departs: the mode differs from the track by more than the errors allow; uncertain: its own error is so large that it cannot show whether it continues the track
