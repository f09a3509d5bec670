-- One row per wheel, sensor and scored passage: when its impact begins, how large it is, and the initial state g b of
-- the section's model (equation 17 of the paper) in the coordinates of models.a_matrix, b_vector and c_vector.
-- needs: passage_fits_current
create or replace view passage_wheels as
with wheels as (
    select
        turnout_id, section_id, channel, passage_id, passed_at_utc, model_id,
        unnest(range(1, len(wheel_times_s) + 1)) as wheel, unnest(wheel_times_s) as time_s,
        unnest(wheel_amplitudes) as amplitude, unnest(wheel_amplitudes_se) as amplitude_se
    from passage_fits_current where wheel_times_s is not null
),
vectors as (select model_id, any_value(b_vector) as b_vector from models group by model_id)
select w.*, list_transform(v.b_vector, lambda b: b * w.amplitude) as initial_state
from wheels w left join vectors v using (model_id);

-- columns of passage_wheels
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section of the sensor
-- channel | varchar | | sensor
-- passage_id | varchar | | passage
-- passed_at_utc | timestamp | UTC | time of the passage
-- model_id | varchar | | model that predicted
-- wheel | bigint | | number of the wheel in order of time
-- time_s | double | s | time of its impact from the start of the recording
-- amplitude | double | | amplitude g
-- amplitude_se | double | | standard error of the amplitude
-- initial_state | double[] | | initial state g b, the jump of the model that the wheel causes
