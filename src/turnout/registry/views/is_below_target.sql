-- Whether the 95 % interval of a change lies within the target: too small to send anybody out.
create or replace macro is_below_target(low_pct, high_pct, target_pct) as (
    coalesce(greatest(abs(low_pct), abs(high_pct)) < target_pct, false)
);
