-- One row per hanging sleeper whose gap is above a size [m] and grows: the lower 95 % limit of its growth is above 0.
-- needs: parameter_growth, in_service
create or replace macro hanging_sleepers_that_grow(above := 0.0003) as table
select
    turnout_id, position_m, value as gap_m, value_se as gap_se_m, per_year as gap_m_per_year,
    per_year_se as gap_se_m_per_year, n_visits, first_at_utc, found_at_utc, finding_id
from parameter_growth
where in_service(turnout_id) and term = 'hanging_sleeper' and parameter = 'gap' and is_open and value > above
    and per_year > 1.959964 * per_year_se
order by gap_m_per_year desc;

-- columns of hanging_sleepers_that_grow(above := 0.0003)
-- turnout_id | varchar | | turnout
-- position_m | double | m | position of the sleeper, to 0.1 m
-- gap_m | double | m | gap at the newest visit
-- gap_se_m | double | m | its standard error
-- gap_m_per_year | double | m/a | growth of the gap
-- gap_se_m_per_year | double | m/a | its standard error
-- n_visits | integer | | visits behind it
-- first_at_utc | timestamp | UTC | time of the first visit
-- found_at_utc | timestamp | UTC | time of the newest
-- finding_id | varchar | | newest finding with it
