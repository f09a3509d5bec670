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
-- needs: modes_current
create or replace view epochs as
select
    m.*,
    coalesce(r.epoch, 0) as epoch,
    r.event_at_utc as epoch_start_utc,
    r.event_id as epoch_event_id,
    r.kind as epoch_kind
from modes_current m
    asof left join resets r
    on m.section_id = r.section_id and m.band = r.band and m.measured_at_utc >= r.event_at_utc
where coalesce(m.method, 'joint') = 'joint';
