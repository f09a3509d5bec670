-- One row per model whose fit lies far below the history of its section: its modes are doubtful, measure again.
-- needs: models_current
create or replace view models_below_history as
with fits as (
    select model_id, section_id, turnout_id, campaign_id, measured_at_utc, method, status, hammer_fit_pct
    from models_current where hammer_fit_pct is not null and status <> 'rejected'
),
history as (
    select f.model_id, median(h.hammer_fit_pct) as history_median_pct,
        quantile_cont(h.hammer_fit_pct, 0.75) - quantile_cont(h.hammer_fit_pct, 0.25) as quartile_distance,
        count(*) as n_history
    from fits f join fits h
        on f.section_id = h.section_id and f.method = h.method and h.measured_at_utc < f.measured_at_utc
    group by f.model_id
),
judged as (
    select f.*, h.history_median_pct,
        -- three standard deviations by the quartiles of a normal distribution; at least five points of fit
        h.history_median_pct - greatest(5.0, 3.0 * h.quartile_distance / 1.349) as limit_pct, h.n_history
    from fits f join history h on f.model_id = h.model_id
    where h.n_history >= 5
)
select
    section_id, turnout_id, campaign_id, measured_at_utc, method, hammer_fit_pct, history_median_pct, limit_pct,
    n_history, 'fit_below_history' as reason, model_id
from judged where hammer_fit_pct < limit_pct
order by measured_at_utc, section_id;

-- columns of models_below_history
-- section_id | varchar | | section
-- turnout_id | varchar | | turnout
-- campaign_id | varchar | | campaign
-- measured_at_utc | timestamp | UTC | time of the campaign
-- method | varchar | | method of the model
-- hammer_fit_pct | double | % | fit of this model on the hammer decays left out
-- history_median_pct | double | % | median of the same fit over the earlier campaigns of the section
-- limit_pct | double | % | fit below which the model is doubtful: three standard deviations, at least five points, below the median
-- n_history | bigint | | earlier campaigns; at least five are needed
-- reason | varchar | | fit_below_history
-- model_id | varchar | | model
