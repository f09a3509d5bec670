-- One row per section, sensor and week (Monday, UTC): the scores of that week.
-- needs: passage_fits_current
create or replace view passage_fits_weekly as
select
    turnout_id, section_id, channel, date_trunc('week', passed_at_utc)::timestamp as week_utc,
    count(*) as n, avg(fit_pct) as fit_pct, median(fit_pct) as fit_median_pct, stddev_samp(fit_pct) as fit_sd_pct,
    stddev_samp(fit_pct) / sqrt(count(fit_pct)) as fit_se_pct, avg(fit_null_pct) as fit_null_pct,
    avg(forecast_pct) as forecast_pct, stddev_samp(forecast_pct) / sqrt(count(forecast_pct)) as forecast_se_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, avg((status = 'null_explains')::integer) filter (status <> 'peak_only') as null_share,
    avg(peak_ms2) as peak_ms2
from passage_fits_current
where status <> 'rejected'
group by turnout_id, section_id, channel, date_trunc('week', passed_at_utc);

-- columns of passage_fits_weekly
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- channel | varchar | | sensor
-- week_utc | timestamp | UTC | Monday of the week, 00:00
-- n | bigint | | fits
-- fit_pct | double | % | mean in-sample fit
-- fit_median_pct | double | % | median in-sample fit
-- fit_sd_pct | double | % | its spread between passages
-- fit_se_pct | double | % | standard error of the mean, passages taken as independent
-- fit_null_pct | double | % | mean of the null's 95 % quantile
-- forecast_pct | double | % | mean forecast skill
-- forecast_se_pct | double | % | its standard error
-- leave_one_out_pct | double | % | mean leave-one-wheel-out score
-- null_share | double | | share of fits that their null explains
-- peak_ms2 | double | m/s² | mean peak of the band-passed acceleration
