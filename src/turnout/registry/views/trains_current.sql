-- One row per train at a turnout, of the passages that count and were not rejected: recordings of one train by several
-- loggers are one row, with the means of those that know the type.
-- needs: passages_current, passage_trains
create or replace view trains_current as
select
    turnout_id, min(passed_at_utc) as passed_at_utc, count(*) as n_recordings, min(passage_id) as passage_id,
    coalesce(min(nullif(train_type, 'unknown')), min(train_type)) as train_type,  -- of recordings that know the type
    coalesce(avg(speed_kmh) filter (train_type <> 'unknown'), avg(speed_kmh)) as speed_kmh,
    coalesce(avg(axle_load_t) filter (train_type <> 'unknown'), avg(axle_load_t)) as axle_load_t
from passages_current join passage_trains using (turnout_id, passage_id)
where status <> 'rejected'
group by turnout_id, train_id;

-- columns of trains_current
-- turnout_id | varchar | | turnout
-- passed_at_utc | timestamp | UTC | time of its first recording
-- n_recordings | bigint | | recordings that count
-- passage_id | varchar | | one of its passages
-- train_type | varchar | | type of train, 'unknown' where no template fits
-- speed_kmh | double | km/h | speed halfway through the passage
-- axle_load_t | double | t | mean axle load; empty where not available
