-- One row per turnout and group of sections whose newest visit differs from the simulation, and nobody can say by what.
-- needs: findings_newest, in_service
create or replace view mismatches_without_name as
select
    turnout_id, sections, verdict, term, rival_term, place_low_m, place_high_m, band_low_hz, band_high_hz, level_before,
    probability, next_measurement, found_at_utc, finding_id
from findings_newest where in_service(turnout_id) and verdict in ('unknown', 'a_or_b') order by level_before desc;
