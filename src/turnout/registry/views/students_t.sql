-- 97.5 % quantile of Student's t after Cornish and Fisher: half a 95 % interval in standard errors, to 0.005 from five
-- degrees of freedom on; fewer than one count as one.
create or replace macro students_t(freedom) as (
    1.96 + 2.3724 / greatest(freedom, 1) + 2.8225 / greatest(freedom, 1) ** 2 + 2.56 / greatest(freedom, 1) ** 3
);
