-- One row per section and axle load class of 2.5 t: mean, spread and standard error of the scores, as in the paper's Table 4.
-- Train type, speed and axle load go together on a real line: a difference between classes is not yet their effect.
-- needs: fit_by_class
create or replace view fit_by_axle_load as
select turnout_id, section_id, class_from as axle_load_from_t, columns(* exclude (turnout_id, section_id, class_name, class_from))
from fit_by_class('axle_load');

-- columns of fit_by_axle_load
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- axle_load_from_t | double | t | lower edge of the class, 2.5 t wide; empty = load not available
-- n | bigint | | fits
-- n_passages | bigint | | passages
-- fit_pct | double | % | mean in-sample fit
-- fit_sd_pct | double | % | its spread between passages
-- fit_se_pct | double | % | standard error of the mean, passages taken as independent
-- fit_null_pct | double | % | mean of the null's 95 % quantile
-- forecast_pct | double | % | mean forecast skill
-- forecast_sd_pct | double | % | its spread
-- forecast_se_pct | double | % | its standard error
-- leave_one_out_pct | double | % | mean leave-one-wheel-out score
-- leave_one_out_sd_pct | double | % | its spread
-- leave_one_out_se_pct | double | % | its standard error
-- null_share | double | | share of fits that their null explains
