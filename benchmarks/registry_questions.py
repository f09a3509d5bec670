"""SQL queries whose time is measured, as a user would write them."""

NETWORK = {
    "one section, all its campaigns": "from section_trend('t0100/S3', 'ballast')",
    "network ranked by 90-day slope": """
        select section_id, band, regr_slope(frequency_hz, epoch(measured_at_utc)) as slope from modes_current
        where measured_at_utc > newest_measurement() - to_days(90) group by all order by slope limit 20""",
    "the same with all that resonance_drift says": """
        select * from resonance_drift(90) order by raw_pct_per_year limit 20""",
    "before and after every tamping": """
        select e.event_id, m.section_id, m.band,
            avg(m.frequency_hz) filter (m.measured_at_utc < e.event_at_utc) as before,
            avg(m.frequency_hz) filter (m.measured_at_utc >= e.event_at_utc) as after
        from events e join modes_current m on m.turnout_id = e.turnout_id
            and m.measured_at_utc >= e.event_at_utc - to_days(90) and m.measured_at_utc < e.event_at_utc + to_days(90)
        where e.kind = 'tamping' group by all""",
    "worst 20 against their first year": """
        select section_id, band, avg(frequency_hz) filter (measured_at_utc > timestamp '2025-10-01')
            / median(frequency_hz) filter (measured_at_utc < timestamp '2017-01-01') as ratio
        from modes_current where measured_at_utc < timestamp '2017-01-01' or measured_at_utc > timestamp '2025-10-01'
        group by all order by ratio limit 20""",
    "drift of all, temperature held fixed, 3 years": "select * from resonance_drift(1095) order by t limit 20",
    "newest value of all 56,000": """
        select section_id, band, arg_max(frequency_hz, measured_at_utc), max(measured_at_utc) from modes_current
        where measured_at_utc > newest_measurement() - to_days(400) group by all""",
    "Theil-Sen slope of all, 90 days": """
        with m as (select section_id, band, frequency_hz as f, epoch(measured_at_utc) as t from modes_current
            where measured_at_utc > newest_measurement() - to_days(90))
        select a.section_id, a.band, median((b.f - a.f) / (b.t - a.t)) as slope
        from m a join m b on a.section_id = b.section_id and a.band = b.band and a.t < b.t group by all""",
}
# The sum S = max(0, S + z) is a loop over the list of each chart; it takes half the time of two window functions.
CUSUM = """
with m as (select section_id, band, measured_at_utc, frequency_hz from modes_current
    where measured_at_utc > newest_measurement() - to_days(1461)),
b as (select row_number() over () as chart, * from (
    select section_id, band, avg(frequency_hz) as f0, stddev_samp(frequency_hz) as sd from m
    where measured_at_utc < newest_measurement() - to_days(1096) group by section_id, band)),
z as (
    select chart, list({'s': (f0 - frequency_hz) / sd - 1.0, 'highest': 0e0} order by measured_at_utc) as steps
    from m join b using (section_id, band) group by chart
),
s as (
    select chart, list_reduce(list_prepend({'s': 0e0, 'highest': 0e0}, steps), lambda now, step: {
        's': greatest(0e0, now.s + step.s), 'highest': greatest(now.highest, now.s + step.s)}).highest as highest
    from z order by highest desc limit 20
)
select section_id, band, highest from s join b using (chart) order by highest desc
"""
PASSAGES = {
    "weekly summary of the fleet": "from passage_fits_weekly",
    "one section, weekly median, a year": "select week_utc, fit_median_pct from passage_fits_weekly "
    "where section_id = 'p003/S2' order by 1",
    "fit by type x speed x axle load, one section": """
        select train_type, 20 * floor(speed_kmh / 20) as speed, 2.5 * floor(axle_load_t / 2.5) as load, avg(fit_pct)
        from passage_scores where section_id = 'p003/S2' group by all""",
    "fit by type x speed x axle load, fleet": """
        select train_type, 20 * floor(speed_kmh / 20) as speed, 2.5 * floor(axle_load_t / 2.5) as load, avg(fit_pct)
        from passage_scores group by all""",
    "last 7 days, all sections": "select section_id, avg(fit_pct) from passage_fits_current "
    "where passed_at_utc > newest_measurement() - to_days(7) group by 1",
    "one passage by id": "select * from passage_scores where passage_id = "
    "(select passage_id from passages order by passed_at_utc limit 1)",
    "fit by cluster and week": "from fit_by_cluster_week",
    "sections whose scores fell": "from sections_whose_scores_fell(28)",
    "passages behind a number": "from passages_behind('p003/S2', '2026-03-02', '2026-03-09')",
    "quarantined passages by reason": "from quarantine_by_reason",
}
