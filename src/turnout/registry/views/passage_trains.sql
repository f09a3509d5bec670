-- One row per passage that counts: the train that it recorded. Two loggers record a train in two
-- files, and a train is one unit in every count, mean and standard error. A recording is of another train than the one
-- before it at the turnout if it begins more than 15 s later (MAX_LOGGER_DIFFERENCE), or if its direction or track is
-- another known one.
-- needs: passages_current
create or replace view passage_trains as
with marked as (
    select
        turnout_id, passage_id, passed_at_utc,
        coalesce(passed_at_utc - lag(passed_at_utc) over passing > interval 15 second, true)
        or coalesce(
            direction <> lag(direction) over passing and 'unknown' not in (direction, lag(direction) over passing), false
        )
        or coalesce(track <> lag(track) over passing and 'unknown' not in (track, lag(track) over passing), false)
        as is_next
    from passages_current
    window passing as (partition by turnout_id order by passed_at_utc, passage_id)
)
select
    turnout_id, passage_id,
    last_value(case when is_next then passage_id end ignore nulls) over (
        partition by turnout_id order by passed_at_utc, passage_id
    ) as train_id
from marked;

-- columns of passage_trains
-- turnout_id | varchar | | turnout
-- passage_id | varchar | | passage
-- train_id | varchar | | passage_id of the first recording of this train
