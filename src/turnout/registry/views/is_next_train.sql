-- Whether a recording is of another train than the one before it at the turnout, in the order of time: it begins more than
-- 15 s later, or its direction or track is another known one. Two loggers record a train in two files, and a train is
-- one unit in every count, mean and standard error. 15 s: MAX_LOGGER_DIFFERENCE.
create or replace macro is_next_train(later, direction, direction_before, track, track_before) as (
    coalesce(later > interval 15 second, true)
    or coalesce(direction <> direction_before and 'unknown' not in (direction, direction_before), false)
    or coalesce(track <> track_before and 'unknown' not in (track, track_before), false)
);
