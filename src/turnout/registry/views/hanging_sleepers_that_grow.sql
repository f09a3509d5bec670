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
