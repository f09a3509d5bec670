-- Weight of a campaign in a mean: the inverse of the variance of its value, 1 where its error is the usual one or less.
-- The standard deviation of a campaign is its residual divided by z; z is rounded, so a small one does not give it.
create or replace macro campaign_weight(z_value, residual, usual_sd) as (
    case when abs(z_value) > 0.05 then least(1, (usual_sd * z_value / residual) ** 2) else 1 end
);
-- Weight of a value in least squares from its standard error and the usual one: the inverse of its variance, where the
-- values scatter by the usual error beyond their own; 1 for the usual error, or without one.
create or replace macro error_weight(value_se, usual_se) as (
    coalesce(2 / (1 + (value_se / nullif(usual_se, 0)) ** 2), 1)
);
-- Whether a campaign lies so far from the median of the campaigns beside it that it counts only if another one confirms
-- it: the limit of the chart, in standard deviations that hold its own error (weight).
create or replace macro is_outlier(value_pct, middle_pct, usual_sd, weight, z_limit) as (
    coalesce(abs(value_pct - middle_pct) * sqrt(weight) > z_limit * usual_sd, false)
);
