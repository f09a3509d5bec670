-- One row per chart and campaign since a date: the sums that the alarms rest on, recomputed from z from the start of
-- the epoch on.
-- S = S + gain within an epoch, 0 where that is not above max(0, H - h), H the highest S since it was 0.
-- A campaign with |z| beyond the smaller of outlier_limit and single_share * h + k is held: it counts only if the next
-- one is beyond it on the same side.
-- k and h NULL: those of the chart. Other values ask "what if"; state stays that of the chart with its own.
create or replace macro cusum(since, k := null, h := null) as table
with steps as (
    select
        c.turnout_id, c.section_id, c.band, c.source, c.measured_at_utc, c.epoch, c.z, c.state,
        coalesce(k, b.allowance) as allowance,
        coalesce(h, b.threshold_down) as threshold_down,
        coalesce(h, b.threshold_up) as threshold_up,
        coalesce(b.single_share, 0.6) as share,
        coalesce(b.outlier_limit, 3) as outlier_limit,
        case when c.z is not null and c.state in ('ok', 'alarm_down', 'alarm_up') then 1 else 0 end as counts
    from charts c
    join baselines b using (turnout_id, section_id, band, source, epoch)
),
sides as (
    select
        *,
        case when counts = 0 or abs(z) <= least(share * threshold_down + allowance, outlier_limit) then 0 else sign(z)
        end as side_down,
        case when counts = 0 or abs(z) <= least(share * threshold_up + allowance, outlier_limit) then 0 else sign(z)
        end as side_up
    from steps
),
neighbours as (
    select
        *,
        coalesce(lag(side_down) over judged, 0) as before_down, coalesce(lag(side_down, 2) over judged, 0) as second_down,
        coalesce(lag(side_up) over judged, 0) as before_up, coalesce(lag(side_up, 2) over judged, 0) as second_up,
        lag(z) over judged as z_before
    from sides
    window judged as (
        partition by turnout_id, section_id, band, source, epoch, counts order by measured_at_utc
    )
),
gains as (
    select
        *,
        case
            when counts = 0 or (side_down <> 0 and side_down <> before_down) then 0
            when side_down < 0 then share * threshold_down * (1 + (before_down <> second_down)::integer)
            when side_down > 0 then -z - allowance
                + case when before_down <> second_down then -z_before - allowance else 0 end
            else -z - allowance
        end as gain_down,
        case
            when counts = 0 or (side_up <> 0 and side_up <> before_up) then 0
            when side_up > 0 then share * threshold_up * (1 + (before_up <> second_up)::integer)
            when side_up < 0 then z - allowance
                + case when before_up <> second_up then z_before - allowance else 0 end
            else z - allowance
        end as gain_up
    from neighbours
),
chart_gains as (
    select
        turnout_id, section_id, band, source, epoch, threshold_down, threshold_up,
        list(struct_pack(measured_at_utc := measured_at_utc, z := z, state := state) order by measured_at_utc) as campaigns,
        list([[gain_down]] order by measured_at_utc) as gains_down,
        list([[gain_up]] order by measured_at_utc) as gains_up
    from gains
    group by all
),
-- [S, H] before the first campaign and after every campaign
paths as (
    select
        *,
        list_reduce(gains_down, lambda path, gain: list_append(path,
            case when path[-1][1] + gain[1][1] > greatest(0, path[-1][2] - threshold_down)
            then [path[-1][1] + gain[1][1], greatest(path[-1][1] + gain[1][1], path[-1][2])] else [0, 0] end
        ), [[0.0::double, 0.0::double]]) as path_down,
        list_reduce(gains_up, lambda path, gain: list_append(path,
            case when path[-1][1] + gain[1][1] > greatest(0, path[-1][2] - threshold_up)
            then [path[-1][1] + gain[1][1], greatest(path[-1][1] + gain[1][1], path[-1][2])] else [0, 0] end
        ), [[0.0::double, 0.0::double]]) as path_up
    from chart_gains
),
numbered as (select *, unnest(range(1, len(campaigns) + 1)) as n from paths),
sums as (
    select
        turnout_id, section_id, band, source, campaigns[n].measured_at_utc as measured_at_utc, epoch,
        campaigns[n].z as z, path_down[n + 1][1] as cusum_down, path_up[n + 1][1] as cusum_up,
        threshold_down, threshold_up, campaigns[n].state as state
    from numbered
)
select * from sums where measured_at_utc >= since;

-- columns of cusum(since, k := null, h := null)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section; * = median of the turnout's sections
-- band | varchar | | which resonance
-- source | varchar | | hammer or passage: never mixed in one chart
-- measured_at_utc | timestamp | UTC | start of the campaign
-- epoch | integer | | epoch of the chart, 0 from the first campaign
-- z | double | | residual in its guarded standard deviations with memory
-- cusum_down | double | | sum for a loss of stiffness
-- cusum_up | double | | sum for a gain
-- threshold_down | double | | limit of cusum_down
-- threshold_up | double | | limit of cusum_up
-- state | varchar | | state of the chart after this campaign
