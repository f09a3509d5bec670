-- Weight of a campaign in a mean: the inverse of the variance of its value, 1 where its error is the usual one or less.
-- The standard deviation of a campaign is its residual divided by z; z is rounded, so a small one does not give it.
create or replace macro campaign_weight(z_value, residual, usual_sd) as (
    case when abs(z_value) > 0.05 then least(1, (usual_sd * z_value / residual) ** 2) else 1 end
);
