-- One row per sensor with a wrong gain at the newest visit; 1 is the right gain.
-- needs: parameter_growth, in_service
create or replace view sensors_with_wrong_gain as
select
    turnout_id, channel, value as gain, value_se as gain_se, value - 1.959964 * value_se as gain_low,
    value + 1.959964 * value_se as gain_high, n_visits, found_at_utc, finding_id
from parameter_growth
where in_service(turnout_id) and term = 'sensor_gain' and parameter = 'gain' and is_open and abs(value - 1) > 1.959964 * value_se
order by abs(value - 1) desc;

-- columns of sensors_with_wrong_gain
-- turnout_id | varchar | | turnout
-- channel | varchar | | sensor
-- gain | double | | what it reads over what it should
-- gain_se | double | | its standard error
-- gain_low | double | | lower end of the 95 % interval
-- gain_high | double | | upper end
-- n_visits | integer | | visits behind it
-- found_at_utc | timestamp | UTC | time of the newest visit
-- finding_id | varchar | | newest finding with it
