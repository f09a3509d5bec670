-- One row per turnout and group of sections whose newest visit differs from the simulation by an effect without a name.
-- needs: findings_newest, in_service
create or replace view mismatches_without_name as
select
    turnout_id, sections, verdict, term, rival_term, place_low_m, place_high_m, band_low_hz, band_high_hz, level_before,
    probability, next_measurement, found_at_utc, finding_id
from findings_newest where in_service(turnout_id) and verdict in ('unknown', 'a_or_b') order by level_before desc;

-- columns of mismatches_without_name
-- turnout_id | varchar | | turnout
-- sections | varchar | | sections diagnosed together, with commas between them
-- verdict | varchar | | the one answer
-- term | varchar | | physics left out
-- rival_term | varchar | | the other name of an 'a or b'
-- place_low_m | double | m | first sensor or impact
-- place_high_m | double | m | last sensor or impact
-- band_low_hz | double | Hz | lower edge of the band
-- band_high_hz | double | Hz | upper edge
-- level_before | double | | weighted mean square of the residual without the term, 1: noise and tolerance
-- probability | double | | stated probability of the verdict
-- next_measurement | varchar | | measurement that would tell more
-- found_at_utc | timestamp | UTC | time of the newest recording used
-- finding_id | varchar | | content id of the finding
