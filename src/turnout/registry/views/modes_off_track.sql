-- One row per mode that does not continue the track of its section and band: another mode, or a sudden change.
-- needs: modes_current
create or replace view modes_off_track as
with points as (
    select
        model_id, section_id, turnout_id, band, measured_at_utc, method, frequency_hz, frequency_se_hz,
        damping_ratio, damping_se, c_block[1] ^ 2 + c_block[2] ^ 2 as residue
    from modes_current where source = 'hammer'
),
history as (
    select
        p.model_id, p.band, count(*) as n_history,
        median(h.frequency_hz) as frequency_track_hz, median(h.damping_ratio) as damping_track,
        median(h.residue) as residue_track,
        (quantile_cont(h.frequency_hz, 0.75) - quantile_cont(h.frequency_hz, 0.25)) / 1.349 as frequency_sd_hz,
        (quantile_cont(h.damping_ratio, 0.75) - quantile_cont(h.damping_ratio, 0.25)) / 1.349 as damping_sd
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
            / sqrt(h.damping_sd ^ 2 + coalesce(p.damping_se, 0.0) ^ 2 + 1e-12) as damping_distance
    from points p join history h on p.model_id = h.model_id and p.band = h.band
    where h.n_history >= 5
)
select
    section_id, turnout_id, band, measured_at_utc, frequency_hz, frequency_track_hz, frequency_distance,
    damping_ratio, damping_track, damping_distance, residue / nullif(residue_track, 0.0) as residue_ratio, n_history,
    model_id
from judged where frequency_distance > 5.0 or damping_distance > 5.0
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
