-- One row per section: how its score of the last days before asof differs from that of the year before them, the
-- cluster of the train held fixed. Difference of means per cluster, weighted by n1 n2 / (n1 + n2); worst first.
-- A cluster counts where both times have at least 5 passages, whose sensors are averaged first; passages of one week
-- are taken as independent.
-- needs: section_scores, in_service
create or replace macro sections_whose_scores_fell(days := 28, "asof" := null) as table
with sample as (
    select
        turnout_id, section_id, coalesce(cluster_id, train_type, 'none') as cluster_id, fit_pct,
        passed_at_utc > coalesce("asof", newest_measurement()) - to_days(days) as is_recent
    from section_scores
    where in_service(turnout_id) and fit_pct is not null and passed_at_utc <= coalesce("asof", newest_measurement())
        and passed_at_utc > coalesce("asof", newest_measurement()) - to_days(days + 365)
),
per_cluster as (
    select
        turnout_id, section_id, cluster_id,
        count(*) filter (is_recent) as n1, count(*) filter (not is_recent) as n0,
        avg(fit_pct) filter (is_recent) as m1, avg(fit_pct) filter (not is_recent) as m0,
        var_samp(fit_pct) filter (is_recent) as v1, var_samp(fit_pct) filter (not is_recent) as v0
    from sample group by turnout_id, section_id, cluster_id
),
weighted as (select *, n1 * n0 / (n1 + n0) as w from per_cluster where n1 >= 5 and n0 >= 5)
select
    turnout_id, section_id, count(*) as n_clusters, sum(n1)::bigint as n_recent, sum(n0)::bigint as n_before,
    sum(w * m0) / sum(w) as fit_before_pct, sum(w * m1) / sum(w) as fit_recent_pct,
    sum(w * (m1 - m0)) / sum(w) as change_pct,
    sqrt(sum(w * w * (v1 / n1 + v0 / n0))) / sum(w) as change_se_pct,
    sum(w * (m1 - m0)) / nullif(sqrt(sum(w * w * (v1 / n1 + v0 / n0))), 0) as z
from weighted
group by turnout_id, section_id
order by z, section_id;

-- columns of sections_whose_scores_fell(days := 28, asof := null)
-- turnout_id | varchar | | turnout
-- section_id | varchar | | section
-- n_clusters | bigint | | clusters compared
-- n_recent | bigint | | passages of the last days
-- n_before | bigint | | passages of the year before
-- fit_before_pct | double | % | score before, weighted over clusters
-- fit_recent_pct | double | % | score of the last days, weighted the same
-- change_pct | double | % | recent minus before, the cluster held fixed
-- change_se_pct | double | % | its standard error
-- z | double | | change over its standard error; chance gives below -3 once in 50 with 5 recent passages, once in 270 with 20
