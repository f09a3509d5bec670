-- Half the width of the 95 % band of one campaign [%]: 1.96 guarded standard deviations, from residual, z and memory.
create or replace macro half_band_pct(residual_pct, z, phi, guard, sd_pct) as (
    -- z is rounded, so a small one does not give the standard deviation of its campaign
    1.959964 * case when abs(z) > 0.05 then abs(residual_pct / z) * sqrt((1 - phi) / (1 + phi)) else guard * sd_pct end
);
