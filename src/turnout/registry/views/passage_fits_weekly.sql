-- One row per section, sensor and week (Monday, UTC): the scores of that week.
-- needs: passage_fits_current
create or replace view passage_fits_weekly as
select
    turnout_id, section_id, channel, date_trunc('week', passed_at_utc)::timestamp as week_utc,
    count(*) as n, avg(fit_pct) as fit_pct, median(fit_pct) as fit_median_pct, stddev_samp(fit_pct) as fit_sd_pct,
    stddev_samp(fit_pct) / sqrt(count(fit_pct)) as fit_se_pct, avg(fit_null_pct) as fit_null_pct,
    avg(forecast_pct) as forecast_pct, stddev_samp(forecast_pct) / sqrt(count(forecast_pct)) as forecast_se_pct,
    avg(leave_one_out_pct) as leave_one_out_pct, avg((status = 'null_explains')::integer) as null_share,
    avg(peak_ms2) as peak_ms2
from passage_fits_current
where status <> 'rejected'
group by turnout_id, section_id, channel, date_trunc('week', passed_at_utc);
