-- Whether the 95 % interval of a change of frequency or damping lies within the target: too small to send anybody out.
create or replace macro is_below_target(band, low_pct, high_pct, target_pct) as (
    coalesce(band in ('ballast', 'railpad', 'ballast_damping', 'railpad_damping') and greatest(abs(low_pct), abs(high_pct)) < target_pct, false)
);
