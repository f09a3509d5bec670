-- One row per event, section and resonance that it starts again. An event without a section concerns its whole turnout.
create or replace view reset_events as
select s.turnout_id, s.section_id, 'ballast' as band, e.event_at_utc, e.event_id, e.kind
from events e join sections s on s.turnout_id = e.turnout_id
where e.resets_ballast and coalesce(e.section_id, s.section_id) = s.section_id
union all
select s.turnout_id, s.section_id, 'railpad', e.event_at_utc, e.event_id, e.kind
from events e join sections s on s.turnout_id = e.turnout_id
where e.resets_railpad and coalesce(e.section_id, s.section_id) = s.section_id;

-- One row per chart and moment at which a new epoch of it starts; events at the same moment count once.
-- A chart is one resonance (ballast, railpad) of one section.
create or replace view resets as
select
    turnout_id, section_id, band, event_at_utc,
    min(event_id) as event_id,
    string_agg(distinct kind, ', ' order by kind) as kind,
    row_number() over (partition by section_id, band order by event_at_utc) as epoch
from reset_events
group by turnout_id, section_id, band, event_at_utc;

-- One row per mode of a chart: with the epoch it lies in, 0 before the first event that resets the chart.
-- Only the joint method: the values of method paper are biased and belong in no chart.
-- Without the columns of the shape, which no chart uses: with them DuckDB 1.5.0 may not end this join.
-- needs: modes_current
create or replace view epochs as
select
    m.* exclude (shape_ratio, shape_covariance, n_shape),
    coalesce(r.epoch, 0) as epoch,
    r.event_at_utc as epoch_start_utc,
    r.event_id as epoch_event_id,
    r.kind as epoch_kind
from modes_current m
    asof left join resets r
    on m.section_id = r.section_id and m.band = r.band and m.measured_at_utc >= r.event_at_utc
where coalesce(m.method, 'joint') = 'joint';

-- columns of epochs
-- model_id | varchar | | model
-- band | varchar | | which resonance
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- measured_at_utc | timestamp | UTC | time of the campaign
-- method | varchar | | method of its model; charts use joint only
-- frequency_hz | double | Hz | undamped natural frequency, mean over impacts
-- frequency_se_hz | double | Hz | standard error of frequency_hz from the spread of its impacts and the choice among explanations
-- frequency_sd_hz | double | Hz | between-impact spread beyond the estimation error
-- damping_ratio | double | | damping ratio, mean over impacts
-- damping_se | double | | standard error of damping_ratio
-- rail_temperature_c | double | °C | rail temperature of the campaign
-- n_impacts | integer | | impacts (method frf: responses) behind the value
-- source | varchar | | what it was identified from
-- run_id | varchar | | content id of the batch
-- frequency_repeatability_hz | double | Hz | part of frequency_se_hz from the scatter of the impacts of the campaign
-- frequency_systematic_hz | double | Hz | part of frequency_se_hz from what the modes leave of all impacts alike, the choice among explanations, and a second pole that is not resolved
-- damping_repeatability | double | | part of damping_se from the scatter of the impacts of the campaign
-- damping_systematic | double | | part of damping_se from what the modes leave of all impacts alike, the choice among explanations, and a second pole that is not resolved
-- stiffness_mn_m | double | MN/m | dynamic stiffness at the resonance; empty where the line fails the gate, and behind an exponential window
-- stiffness_low_mn_m | double | MN/m | lower 95 % limit of stiffness_mn_m
-- stiffness_high_mn_m | double | MN/m | upper 95 % limit of stiffness_mn_m; empty where there is none
-- a_block | double[] | | a11, a12, a21, a22 of this mode (Tables 1 and 2 of the paper)
-- a_block_se | double[] | | their standard errors
-- c_block | double[] | | c1, c2 of this mode (Tables 1 and 2 of the paper)
-- c_block_se | double[] | | their standard errors; empty without a fitted receptance
-- epoch | bigint | | epoch of the chart, 0 before the first event that resets it
-- epoch_start_utc | timestamp | UTC | event that started the epoch; empty for epoch 0
-- epoch_event_id | varchar | | that event
-- epoch_kind | varchar | | what was done then

-- columns of reset_events
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | resonance that starts again
-- event_at_utc | timestamp | UTC | when it was done
-- event_id | varchar | | event
-- kind | varchar | | what was done

-- columns of resets
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- band | varchar | | resonance that starts again
-- event_at_utc | timestamp | UTC | when it was done
-- event_id | varchar | | event; of several at one moment the first id
-- kind | varchar | | what was done
-- epoch | bigint | | number of the epoch that it starts, from 1
