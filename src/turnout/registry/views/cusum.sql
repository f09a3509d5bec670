-- One row per chart and campaign since a date: the sums that the alarms rest on, recomputed from z.
-- S = P - min(0, min P), P the running sum of the steps within an epoch; one campaign brings at most 0.75 h.
-- k and h NULL: those of the chart. Other values ask "what if".
create or replace macro cusum(since, k := null, h := null) as table
with steps as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.epoch, c.z, c.state,
        coalesce(k, b.allowance) as allowance,
        coalesce(h, b.threshold_down) as threshold_down,
        coalesce(h, b.threshold_up) as threshold_up,
        case when c.z is not null and c.state in ('ok', 'alarm_down', 'alarm_up') then 1 else 0 end as counts
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
    where c.measured_at_utc >= since
),
running as (
    select
        *,
        sum(counts * (least(-coalesce(z, 0), 0.75 * threshold_down + allowance) - allowance)) over history as p_down,
        sum(counts * (least(coalesce(z, 0), 0.75 * threshold_up + allowance) - allowance)) over history as p_up
    from steps
    window history as (
        partition by turnout_id, section_id, band, source, epoch order by measured_at_utc
        rows between unbounded preceding and current row
    )
)
select
    turnout_id, section_id, band, source, measured_at_utc, epoch, z,
    p_down - least(0, min(p_down) over history) as cusum_down,
    p_up - least(0, min(p_up) over history) as cusum_up,
    threshold_down, threshold_up, state
from running
window history as (
    partition by turnout_id, section_id, band, source, epoch order by measured_at_utc
    rows between unbounded preceding and current row
);
