"""Every view against an independent computation from the rows with pandas, numpy or statsmodels."""

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from registry_rows import hammer_result

from turnout.workflow.batches import UnitResult

YEAR = 31557600.0
CHART = ["turnout_id", "section_id", "band", "source"]
# SQL and the independent computation do the same arithmetic in another order; every view must agree to 1e-8.
SAME = {"rtol": 1e-8, "atol": 1e-8}


@pytest.fixture(scope="module")
def modes(fleet):
    return fleet.frame("from modes_current").sort_values(["section_id", "band", "measured_at_utc"], ignore_index=True)


@pytest.fixture(scope="module")
def scores(fleet):
    passages, fits = fleet.frame("from passages"), fleet.frame("from passage_fits")
    both = fits.merge(passages.drop(columns=["turnout_id", "passed_at_utc", "status", "run_id"]), on="passage_id")
    rejected = passages.passage_id[passages.status == "rejected"]
    return both[~both.passage_id.isin(rejected)]


def resets_of(fleet, section, band):
    """Times of the events that reset a chart, from the table of events only."""
    events = fleet.frame("from events")
    own = (events.turnout_id == section.split("/")[0]) & (events.section_id.isna() | (events.section_id == section))
    return sorted(set(events.event_at_utc[own & events[f"resets_{band}"]]))


def test_epochs_begin_at_the_last_event_that_resets_the_band(fleet, modes):
    epochs = fleet.frame("from epochs").sort_values(["section_id", "band", "measured_at_utc"], ignore_index=True)
    assert len(epochs) == len(modes) == 898
    for (section, band), rows in epochs.groupby(["section_id", "band"]):
        resets = resets_of(fleet, section, band)
        number = np.searchsorted(
            np.array(resets, dtype="datetime64[us]"), rows.measured_at_utc.to_numpy(), side="right"
        )
        assert list(rows.epoch) == list(number)
        begun = [resets[n - 1] if n else pd.NaT for n in number]
        assert [a == b or (pd.isna(a) and pd.isna(b)) for a, b in zip(rows.epoch_start_utc, begun)] == [True] * len(
            rows
        )
    assert epochs.groupby(["section_id", "band"]).epoch.max().to_dict() == {
        ("north_1/OT", "ballast"): 1, ("north_1/OT", "railpad"): 0, ("north_1/A7", "ballast"): 1,
        ("north_1/A7", "railpad"): 1, ("north_1/A9", "ballast"): 1, ("north_1/A9", "railpad"): 0,
        **{(f"south_2/{s}", b): 2 if b == "ballast" else 1 for s in ("OT", "A7", "A9") for b in ("ballast", "railpad")},
    }  # fmt: skip
    both = epochs[(epochs.turnout_id == "south_2") & (epochs.band == "ballast")].epoch_kind.dropna().unique()
    assert set(both) == {"tamping", "sensor_change, tamping"}


def test_section_trend_is_one_chart_in_order_of_time(fleet, modes):
    trend = fleet.frame("from section_trend('south_2/A9', 'railpad')")
    own = modes[(modes.section_id == "south_2/A9") & (modes.band == "railpad")]
    assert list(trend.frequency_hz) == list(own.frequency_hz) and len(trend) == 74
    assert trend.measured_at_utc.is_monotonic_increasing


@pytest.mark.parametrize(
    ("days", "asof", "verdicts"),
    [(200, None, {"season not separable"}), (1200, None, {"ok"}), (700, "2025-06-30", {"ok", "season not separable"})],
)
def test_resonance_drift_is_ordinary_least_squares(fleet, modes, days, asof, verdicts):
    call = f"resonance_drift({days}" + (f", asof := timestamp '{asof}')" if asof else ")")
    drift = fleet.frame(f"from {call}").set_index(CHART)
    newest = fleet.ask("select max(measured_at_utc) from modes")[0][0]
    until = pd.Timestamp(asof) if asof else pd.Timestamp(max(newest, fleet.ask("select newest_measurement()")[0][0]))
    assert len(drift) == 12
    for key, row in drift.iterrows():
        _, section, band, _ = key
        own = modes[(modes.section_id == section) & (modes.band == band) & (modes.measured_at_utc <= until)]
        own = own[own.measured_at_utc > until - pd.Timedelta(days=days)]
        begun = [r for r in resets_of(fleet, section, band) if r <= until]
        own = own[own.measured_at_utc >= begun[-1]] if begun else own
        years = (own.measured_at_utc - until).dt.total_seconds() / YEAR
        warm = own.rail_temperature_c.notna()
        raw = sm.OLS(own.frequency_hz[warm], sm.add_constant(years[warm].to_numpy())).fit()
        mean = own.frequency_hz[warm].mean()
        design = np.column_stack([np.ones(warm.sum()), years[warm], own.rail_temperature_c[warm]])
        fit = sm.OLS(own.frequency_hz[warm].to_numpy(), design).fit()
        assert (row.n, row.n_without_temperature) == (warm.sum(), (~warm).sum())
        np.testing.assert_allclose(
            [row.frequency_hz, row.raw_pct_per_year, row.raw_se_pct_per_year, row.drift_pct_per_year,
             row.drift_se_pct_per_year, row.t, row.hz_per_c, row.hz_per_c_se, row.residual_sd_pct],
            [mean, 100 * raw.params.iloc[1] / mean, 100 * raw.bse.iloc[1] / mean, 100 * fit.params[1] / mean,
             100 * fit.bse[1] / mean, fit.tvalues[1], fit.params[2], fit.bse[2], 100 * np.sqrt(fit.scale) / mean],
            **SAME,
        )  # fmt: skip
        span = own.measured_at_utc.max() - own.measured_at_utc.min()
        expected = "too few" if warm.sum() < 12 else "season not separable" if span.days < 300 else "ok"
        assert row.verdict == expected
    assert set(drift.verdict) == verdicts


def test_a_campaign_with_a_large_error_has_little_weight_in_a_drift(bench, hammer):
    """The weights are 2 / (1 + (se / median se)²), compared with weighted least squares of statsmodels."""
    days = pd.date_range("2025-01-05", periods=26, freq="14D")
    warm, error = np.round(10.0 + 8.0 * np.sin(np.arange(26)), 1), np.where(np.arange(26) % 3, 0.4, 0.6)
    frequency = 150.0 - 0.1 * np.arange(26) + 0.1 * np.cos(3.0 * np.arange(26))
    frequency = np.round(frequency, 3)
    frequency[20], error[20] = 307.0, 78.0
    bench.register(*(
        hammer(section="A1", day=f"{d:%Y-%m-%d}", frequency=f, frequency_se_hz=e, rail_temperature_c=c)
        for d, f, e, c in zip(days, frequency, error, warm, strict=True)
    ))  # fmt: skip
    (row,) = bench.frame("from resonance_drift(400)").itertuples()
    weight = 2.0 / (1.0 + (error / np.median(error)) ** 2)
    mean = np.average(frequency, weights=weight)
    years = (days - days[-1]).total_seconds().to_numpy() / YEAR
    fit = sm.WLS(frequency, np.column_stack([np.ones(26), years, warm]), weight).fit()
    np.testing.assert_allclose(
        [row.drift_pct_per_year, row.drift_se_pct_per_year, row.frequency_hz, row.residual_sd_pct],
        [100 * fit.params[1] / mean, 100 * fit.bse[1] / mean, mean, 100 * np.sqrt(fit.scale) / mean],
        rtol=1e-6,
    )
    assert abs(row.drift_pct_per_year - 100 * (-0.1 * 365.25 / 14.0) / mean) < 3.0 * row.drift_se_pct_per_year < 3.0


def test_the_drift_of_short_charts_and_of_charts_without_varying_temperature_is_unknown(bench, hammer):
    flat = [
        hammer(section="flat", day=f"2026-01-{d:02d}", frequency=150.0, rail_temperature_c=5.0) for d in range(1, 20)
    ]
    none = [
        hammer(section="none", day=f"2026-01-{d:02d}", rail_temperature_c=None, frequency=100.0 + d)
        for d in range(1, 20)
    ]
    three = [
        hammer(section="three", day=f"2026-01-{d:02d}", rail_temperature_c=c) for d, c in ((1, 9.0), (4, 1.0), (9, 4.0))
    ]
    bench.register(*flat, *none, *three)
    rows = bench.frame("from resonance_drift(365) order by section_id")
    assert list(rows.verdict) == ["season not separable", "too few", "too few"]
    assert rows.drift_pct_per_year.isna().tolist() == [True, True, False]
    assert rows.t.isna().all() and not np.isinf(rows.select_dtypes("number")).any().any()
    assert list(rows.n) == [19, 0, 3] and list(rows.n_without_temperature) == [0, 19, 0]


def test_the_view_rejected_lists_everything_that_was_not_used(fleet):
    counts = dict(fleet.ask("select what || ' ' || reason_code, count(*) from rejected group by all"))
    fits = fleet.ask("select count(*) from passage_fits where status <> 'accepted'")[0][0]
    assert counts == {
        "impact double_hit": 6, "model low_coherence": 1, "passage train_cut_off": 1, "recording truncated": 2,
        "recording not_finite": 1, "fit null_explains": fits,
    }  # fmt: skip
    row = fleet.ask("select section_id, measured_value, limit_value, reason from rejected where what = 'model'")
    assert row[0][:3] == ("south_2/A9", 0.41, 0.8) and row[0][3].startswith("the lower confidence limit")
    assert fleet.ask("select count(*) from rejected where what = 'impact' and at_utc = '2023-03-20'") == [(6,)]


def test_quarantine_by_reason_has_the_number_of_files_per_reason(fleet):
    rows = fleet.ask("select reason_code, n, first_path from quarantine_by_reason order by 1")
    assert rows == [
        ("not_finite", 1, "south_2/hammer/2026-01-05/OT_1.uff"), ("truncated", 2, "south_2/hammer/2026-01-05/OT_0.uff"),
    ]  # fmt: skip


def test_fleet_state_has_the_numbers_of_each_turnout(fleet):
    rows = fleet.frame("from fleet_state order by turnout_id").set_index("turnout_id")
    assert list(rows.n_sections) == list(rows.n_sections_measured) == [3, 3]
    assert list(rows.n_campaigns) == [75, 75] and list(rows.n_models) == [225, 224]
    assert list(rows.n_models_rejected) == [0, 1] and list(rows.n_quarantine) == [0, 3]
    assert list(rows.n_passages) == [399, 0] and rows.last_event["north_1"] == "pad_exchange"


def test_campaigns_of_a_turnout(fleet, modes):
    rows = fleet.frame("from campaigns_of('south_2')")
    assert len(rows) == 225 and rows.measured_at_utc.is_monotonic_decreasing
    gone = rows[rows.status == "rejected"]
    assert len(gone) == 1 and gone.ballast_hz.isna().all()
    expected = modes[(modes.turnout_id == "south_2") & (modes.band == "railpad")].frequency_hz.sum()
    np.testing.assert_allclose(rows.railpad_hz.sum(), expected, **SAME)


def summary(groups, column):
    values = groups[column]
    return values.mean(), values.std(ddof=1), values.std(ddof=1) / np.sqrt(values.count())


@pytest.mark.parametrize(
    ("view", "key", "classes"),
    [
        ("fit_by_type", "train_type", lambda s: s.train_type),
        ("fit_by_speed", "speed_from_kmh", lambda s: 20 * np.floor(s.speed_kmh / 20)),
        ("fit_by_axle_load", "axle_load_from_t", lambda s: 2.5 * np.floor(s.axle_load_t / 2.5)),
    ],
)
def test_scores_by_class_are_means_with_spread_and_error(fleet, scores, view, key, classes):
    rows = fleet.frame(f"from {view}").set_index(["section_id", key]).sort_index()
    groups = scores.assign(**{key: classes(scores)}).groupby(["section_id", key], dropna=False)
    assert len(rows) == groups.ngroups >= 6
    np.testing.assert_array_equal(rows.n, groups.size())
    for column in ("fit_pct", "forecast_pct", "leave_one_out_pct"):
        stem = column.removesuffix("_pct")
        for made, expected in zip((column, f"{stem}_sd_pct", f"{stem}_se_pct"), summary(groups, column)):
            np.testing.assert_allclose(rows[made], expected, **SAME)
    share = groups.status.apply(lambda s: (s == "null_explains").mean())
    np.testing.assert_allclose(rows.null_share, share, **SAME)


def test_weekly_scores(fleet):
    fits = fleet.frame("from passage_fits")
    fits["week_utc"] = fits.passed_at_utc.dt.to_period("W-SUN").dt.start_time
    groups = fits.groupby(["section_id", "channel", "week_utc"])
    rows = fleet.frame("from passage_fits_weekly").set_index(["section_id", "channel", "week_utc"]).sort_index()
    assert len(rows) == groups.ngroups > 100
    np.testing.assert_array_equal(rows.n, groups.size())
    np.testing.assert_allclose(rows.fit_median_pct, groups.fit_pct.median(), **SAME)
    np.testing.assert_allclose(rows.fit_sd_pct, groups.fit_pct.std(), **SAME)
    assert (rows.index.get_level_values("week_utc").day_of_week == 0).all()


def test_scores_by_cluster_and_week(fleet, scores):
    scores = scores.assign(week_utc=scores.passed_at_utc.dt.to_period("W-SUN").dt.start_time)
    keys = ["section_id", "cluster_id", "week_utc"]
    groups = scores.groupby(keys)
    rows = fleet.frame("from fit_by_cluster_week").set_index(keys).sort_index()
    assert len(rows) == groups.ngroups > 300
    np.testing.assert_allclose(rows.fit_pct, groups.fit_pct.mean(), **SAME)
    np.testing.assert_allclose(rows.forecast_se_pct, groups.forecast_pct.std() / np.sqrt(groups.size()), **SAME)


def test_sections_whose_scores_fell_compares_trains_of_the_same_cluster(fleet, scores):
    asof = scores.passed_at_utc.max() + pd.Timedelta(minutes=1)
    rows = fleet.frame(f"from sections_whose_scores_fell(28, asof := timestamp '{asof}')").set_index("section_id")
    since = asof - pd.Timedelta(days=28)
    for section, own in scores.groupby("section_id"):
        total = variance = weight = 0.0
        for _, like in own.groupby("cluster_id"):
            new = like.fit_pct[like.passed_at_utc > since]
            old = like.fit_pct[(like.passed_at_utc <= since) & (like.passed_at_utc > since - pd.Timedelta(days=365))]
            if min(len(new), len(old)) < 5:
                continue
            w = len(new) * len(old) / (len(new) + len(old))
            total, weight = total + w * (new.mean() - old.mean()), weight + w
            variance += w**2 * (new.var() / len(new) + old.var() / len(old))
        expected = [total / weight, np.sqrt(variance) / weight, total / np.sqrt(variance)]
        np.testing.assert_allclose(
            rows.loc[section, ["change_pct", "change_se_pct", "z"]].astype(float), expected, **SAME
        )
    assert list(rows.index) == ["north_1/A9", "north_1/A7"], "the section whose scores fell is first"


def test_passages_behind_returns_the_passages_of_a_period_with_their_files(fleet, scores):
    rows = fleet.frame("from passages_behind('north_1/A9', '2023-06-01', '2023-07-01')")
    own = scores[
        (scores.section_id == "north_1/A9") & scores.passed_at_utc.between("2023-06-01", "2023-06-30 23:59:59.99")
    ]
    assert sorted(rows.passage_id) == sorted(own.passage_id) and len(rows) > 10
    assert rows.path.str.startswith("north_1/passages/202306").all()


def test_values_by_the_method_of_the_paper_are_in_no_chart(bench, hammer):
    paper = hammer(section="A7", frequency=140.0, file="p")
    paper.tables["models"][0]["method"] = "paper"
    both = hammer(section="A7", frequency=150.0)
    for table in ("models", "modes", "recordings"):
        both.tables[table] += paper.tables[table]
    bench.register(both)
    assert bench.ask("select method, frequency_hz from modes_current order by 1") == [
        ("joint", 150.0),
        ("paper", 140.0),
    ]
    assert bench.ask("select frequency_hz from epochs") == [(150.0,)]


def test_a_passage_with_a_future_date_does_not_change_the_newest_date_of_the_fleet(bench):
    """The last thirty days are counted back from the last run, not from a future year."""
    passage = {"turnout_id": "t1", "passage_id": "p", "recording_id": "r", "passed_at_utc": "2099-01-05T10:00:00"}
    passage |= {"status": "accepted", "n_axles": 8, "track": "main", "axle_load_source": "unavailable"}
    late = UnitResult("t1/passage/20990105T100000Z.h5", "t1", "passage", "k", "1", "ok", {"passages": [passage]})
    bench.register(hammer_result(), late)
    ((newest, ended),) = bench.ask("select newest_measurement(), (select max(ended_at_utc) from runs)")
    assert newest == ended and newest.year < 2099
    assert bench.ask("select newest_measurement_at_utc from registry_info") == [(newest,)]


def test_a_corrected_date_no_longer_affects_the_newest_date_of_the_fleet(bench):
    """The first entry has the year 2097; the file with the correct day replaces it."""
    campaign = {"campaign_id": "t1/2097-01-05", "turnout_id": "t1", "started_at_utc": "2097-01-05T10:00:00"}
    wrong = hammer_result(day="2097-01-05")
    bench.register(wrong, hammer_result(day="2026-01-05"), tables={"campaigns": [campaign]})
    assert str(bench.ask("select newest_measurement()")[0][0]) == "2097-01-05 10:00:00"
    bench.register(UnitResult(wrong.unit, "t1", "hammer", "withdrawn", "1", "vanished", {}), tables={"campaigns": []})
    assert str(bench.ask("select newest_measurement()")[0][0]) == "2026-01-05 10:00:00"


def test_the_date_of_a_campaign_is_accepted_if_the_clock_of_the_server_is_late(bench):
    """People write the date of a campaign, so it does not depend on a clock."""
    campaign = {"campaign_id": "t1/2098-01-05", "turnout_id": "t1", "started_at_utc": "2098-01-05T10:00:00"}
    bench.register(hammer_result(day="2098-01-05"), tables={"campaigns": [campaign]})
    assert str(bench.ask("select newest_measurement()")[0][0]) == "2098-01-05 10:00:00"


def test_a_future_campaign_of_one_turnout_does_not_change_the_newest_date_of_the_fleet(bench):
    """One of three turnouts has a campaign of 2098: the year is mistyped, and the clock of this server is not late."""
    days = {"t1": "2026-01-05", "t2": "2098-01-05", "t3": "2026-01-07"}
    campaigns = [
        {"campaign_id": f"{turnout}/{day}", "turnout_id": turnout, "started_at_utc": f"{day}T10:00:00"}
        for turnout, day in days.items()
    ]
    results = [hammer_result(turnout=turnout, day=day) for turnout, day in days.items()]
    bench.register(*results, tables={"campaigns": campaigns})
    ((newest, ended),) = bench.ask("select newest_measurement(), (select max(ended_at_utc) from runs)")
    assert newest == ended
