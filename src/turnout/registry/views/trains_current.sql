-- One row per train at a turnout, of the passages that count and were not rejected: recordings of one train by several
-- loggers are one row, with the means of those that know the type.
-- needs: passages_current, is_next_train
create or replace view trains_current as
with marked as (
    select
        *, is_next_train(
            passed_at_utc - lag(passed_at_utc) over passing, direction, lag(direction) over passing,
            track, lag(track) over passing
        )::integer as is_next
    from passages_current where status <> 'rejected'
    window passing as (partition by turnout_id order by passed_at_utc)
),
numbered as (select *, sum(is_next) over (partition by turnout_id order by passed_at_utc) as train_no from marked)
select
    turnout_id, min(passed_at_utc) as passed_at_utc, count(*) as n_recordings, min(passage_id) as passage_id,
    coalesce(min(nullif(train_type, 'unknown')), min(train_type)) as train_type,  -- of recordings that know the type
    coalesce(avg(speed_kmh) filter (train_type <> 'unknown'), avg(speed_kmh)) as speed_kmh,
    coalesce(avg(axle_load_t) filter (train_type <> 'unknown'), avg(axle_load_t)) as axle_load_t
from numbered
group by turnout_id, train_no;

-- columns of trains_current
-- turnout_id | varchar | | turnout
-- passed_at_utc | timestamp | UTC | time of its first recording
-- n_recordings | bigint | | recordings that count
-- passage_id | varchar | | passage, or one of those of the train
-- train_type | varchar | | type of train, 'unknown' where no template fits
-- speed_kmh | double | km/h | speed halfway through the passage
-- axle_load_t | double | t | mean axle load; empty where not available
