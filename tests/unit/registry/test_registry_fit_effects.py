"""SQL views of the effects of train type, speed and axle load on scores, compared with statsmodels."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from registry_fleet import passage_results
from scipy import stats

from turnout.registry.ids import content_id
from turnout.registry.view_texts import view_files
from turnout.workflow.notes import MAX_LOGGER_DIFFERENCE

SAME = {"rtol": 1e-8, "atol": 1e-8}


@pytest.fixture(scope="module")
def scored(fleet):
    rows = fleet.frame("from passage_scores where axle_load_t is not null order by section_id, passage_id")
    return {section: part for section, part in rows.groupby("section_id")}


def least_squares(rows, column):
    """Result of statsmodels (HC3) with one level per type, speed in 10 km/h and load in t, and the design matrix."""
    design = pd.get_dummies(rows.train_type, dtype=float)
    design["speed"], design["load"] = rows.speed_kmh / 10, rows.axle_load_t
    return sm.OLS(rows[column], design).fit(cov_type="HC3"), design


@pytest.mark.parametrize("score", ["fit", "forecast"])
@pytest.mark.parametrize("factor", ["speed", "axle load"])
def test_adjusted_effects_equal_those_of_a_design_matrix(fleet, scored, score, factor):
    rows = fleet.frame(f"from fit_effects where score = '{score}' and factor = '{factor}'").set_index("section_id")
    assert set(rows.index) == set(scored)
    for section, own in scored.items():
        found, _ = least_squares(own, f"{score}_pct")
        name = "speed" if factor == "speed" else "load"
        row = rows.loc[section]
        np.testing.assert_allclose([row.change_pct, row.change_se_pct], [found.params[name], found.bse[name]], **SAME)
        half = stats.t.ppf(0.975, len(own) - 5) * found.bse[name]
        np.testing.assert_allclose([row.low_pct, row.high_pct], row.change_pct + np.array([-half, half]), rtol=1e-4)
        x = own.speed_kmh / 10 if factor == "speed" else own.axle_load_t
        np.testing.assert_allclose(row.raw_change_pct, np.polyfit(x, own[f"{score}_pct"], 1)[0], **SAME)
        assert row.n == len(own)


@pytest.mark.parametrize("freedom", [5, 8, 12, 40, 400])
def test_the_quantile_of_the_intervals_is_that_of_students_t(freedom):
    made = 1.96 + 2.3724 / freedom + 2.8225 / freedom**2 + 2.56 / freedom**3
    assert made == pytest.approx(stats.t.ppf(0.975, freedom), abs=0.005)


def test_adjusted_bars_are_means_of_partial_residuals(fleet, scored):
    rows = fleet.frame("from fit_adjusted where score = 'fit'").set_index(["section_id", "factor", "class"])
    for section, own in scored.items():
        found, design = least_squares(own, "fit_pct")
        speed = found.params["speed"] * (design.speed - design.speed.mean())
        load = found.params["load"] * (design.load - design.load.mean())
        of_type = own.fit_pct - speed - load
        level = own.train_type.map(found.params[sorted(set(own.train_type))])
        mean = own.fit_pct.mean()
        for name, values in of_type.groupby(own.train_type):
            row = rows.loc[(section, "train type", name)]
            np.testing.assert_allclose(row.adjusted_pct, values.mean(), **SAME)
            np.testing.assert_allclose(row.score_pct, own.fit_pct[values.index].mean(), **SAME)
        of_speed = mean + speed + found.resid
        first = 20 * np.floor(own.speed_kmh / 20).astype(int)
        for low, values in of_speed.groupby(first):
            row = rows.loc[(section, "speed", f"{low}-{low + 20} km/h")]
            np.testing.assert_allclose(row.adjusted_pct, values.mean(), **SAME)
            assert row.n == len(values) and row.class_from == low
        assert (level + speed + load + found.resid).corr(own.fit_pct) > 0.5


def test_without_loads_the_speed_is_adjusted_only_for_the_type(bench):
    """Half of the loads are unknown: no effect of the load; the speed effect holds only the type fixed."""
    results = passage_results(n=120)
    for result in results[::2]:
        result.tables["passages"][0]["axle_load_t"] = None
    bench.register(*results)
    rows = bench.frame("from passage_scores where section_id = 'north_1/A7'")
    found = bench.frame("from fit_effects where section_id = 'north_1/A7' and score = 'fit'")
    assert list(found.factor) == ["speed"] and list(found.held_fixed) == ["train type"]
    design = pd.get_dummies(rows.train_type, dtype=float)
    design["speed"] = rows.speed_kmh / 10
    made = sm.OLS(rows.fit_pct, design).fit(cov_type="HC3")
    np.testing.assert_allclose(
        [found.change_pct[0], found.change_se_pct[0]], [made.params.speed, made.bse.speed], **SAME
    )
    bars = bench.frame("from fit_adjusted where section_id = 'north_1/A7' and score = 'fit'").groupby("factor").n.sum()
    assert bars.to_dict() == {"train type": len(rows), "speed": len(rows), "axle load": rows.axle_load_t.count()}


def test_one_type_at_one_speed_has_bars_and_no_effects(bench):
    results = passage_results(n=40)
    for result in results:
        result.tables["passages"][0] |= {"train_type": "IC", "speed_kmh": 120.0, "axle_load_t": 15.0}
    bench.register(*results)
    assert bench.ask("select count(*) from fit_effects") == [(0,)]
    bars = bench.frame("from fit_adjusted where section_id = 'north_1/A7' and score = 'fit'")
    assert len(bars) == 3
    np.testing.assert_allclose(bars.adjusted_pct, bars.score_pct, **SAME)


def without_channels(registry):
    """Columns that depend on the number of passages, of every view that compares scores."""
    of = {
        "fit_effects": ("score, factor", "change_pct, change_se_pct, low_pct, high_pct, raw_change_pct"),
        "fit_adjusted": (
            "score, factor, class",
            "score_pct, score_sd_pct, score_se_pct, adjusted_pct, adjusted_se_pct, n_passages",
        ),
        "fit_by_cluster_week": (
            "cluster_id, week_utc",
            "fit_pct, fit_se_pct, forecast_pct, forecast_se_pct, n_passages",
        ),
        "fit_by_speed": (
            "speed_from_kmh",
            "fit_pct, fit_sd_pct, fit_se_pct, leave_one_out_se_pct, null_share, n_passages",
        ),
        "sections_whose_scores_fell(200)": ("section_id", "change_pct, change_se_pct, z, n_recent, n_before"),
    }
    ask = "select {1} from {0} where section_id = 'north_1/A9' order by {2}"
    return {v: registry.frame(ask.format(v, values, keys)) for v, (keys, values) in of.items()}


def test_several_sensors_of_one_passage_count_as_one_passage(bench, tmp_path):
    """Two more sensors at each section with the same scores change no mean and reduce no error."""
    once, thrice = passage_results(n=200), passage_results(n=200)
    for result in thrice:
        fits = result.tables["passage_fits"]
        result.tables["passage_fits"] = [f | {"channel": f"{f['channel']}{k}"} for f in fits for k in range(3)]
    more = type(bench)(tmp_path / "more")
    bench.register(*once)
    more.register(*thrice)
    expected, found = without_channels(bench), without_channels(more)
    for view, frame in expected.items():
        assert len(frame) and frame.notna().any().all(), view
        pd.testing.assert_frame_equal(found[view], frame, rtol=1e-9, obj=view)
    assert more.ask("select sum(n) from fit_by_cluster_week") == [
        (3 * bench.ask("select sum(n) from fit_by_cluster_week")[0][0],)
    ]


def of_another_logger(result, k, seconds=3.0, **changed):
    """A second recording of a train by a logger with sensors of its own."""
    passage, fits = result.tables["passages"][0], result.tables["passage_fits"]
    at = passage["passed_at_utc"] + timedelta(seconds=seconds)
    shared = {"passage_id": content_id("second", k), "passed_at_utc": at}
    second = passage | shared | {"recording_id": content_id("second recording", k)} | changed
    tables = {
        "passages": [second],
        "passage_fits": [f | shared | {"channel": f"b_{f['section_id'][-2:]}"} for f in fits],
    }
    return replace(result, unit=f"{result.unit}-b", tables=tables)


def counts_of_trains(registry):
    """What every view says that counts trains, or has an error from their number."""
    queries = {
        "weeks": "select section_id, measured_at_utc, frequency_hz, frequency_se_hz from passage_values order by all",
        "trains": "select train_type, count(*) as n from trains_current group by all order by all",
    }
    return without_channels(registry) | {name: registry.frame(query) for name, query in queries.items()}


def test_recordings_of_a_train_by_two_loggers_count_as_one_train(bench, tmp_path):
    """The second logger knows neither track nor type. It changes no mean, and reduces no error."""
    trains = passage_results(n=400)
    for k, result in enumerate(trains):
        fits = [f | {"peak_ms2": 100.0 + k % 7} for f in result.tables["passage_fits"]]
        result.tables["passage_fits"] = fits
    second = [of_another_logger(r, k, track="unknown", train_type="unknown") for k, r in enumerate(trains)]
    both = type(bench)(tmp_path / "both")
    bench.register(*trains)
    both.register(*trains, *second)
    of_one, of_both = counts_of_trains(bench), counts_of_trains(both)
    for view, frame in of_one.items():
        assert len(frame), view
        pd.testing.assert_frame_equal(of_both[view], frame, rtol=1e-9, obj=view)
    assert both.ask("select distinct n_recordings from trains_current") == [(2,)]


@pytest.mark.parametrize(
    ("seconds", "changed", "n"),
    [
        (15.0, {}, 1),
        (15.1, {}, 2),
        (3.0, {"direction": "trailing"}, 2),
        (3.0, {"track": "diverging"}, 2),
        (3.0, {"track": "unknown", "direction": "unknown"}, 1),
    ],
)
def test_a_train_that_follows_or_comes_the_other_way_is_another_one(bench, seconds, changed, n):
    first = passage_results(n=1)[0]
    turnouts = [{"turnout_id": "north_1", "layout": "l", "config_hash": "h"}]
    bench.register(first, of_another_logger(first, 0, seconds, **changed), tables={"turnouts": turnouts})
    assert bench.ask("select n_passages from fleet_state") == [(n,)]
    assert bench.ask("select n_passages from fit_by_type where section_id = 'north_1/A7'") == [(n,)]
    assert bench.ask("select count(*) from passage_scores where section_id = 'north_1/A7'") == [(2,)]


def test_views_and_train_data_have_one_limit_between_loggers():
    text = view_files()["passage_trains"]
    assert f"interval {MAX_LOGGER_DIFFERENCE:.0f} second" in text


def test_errors_are_computed_from_passages_if_the_scores_of_sensors_are_correlated(bench):
    """Three sensors share four fifths of their scatter: the errors are those of the means of each passage."""
    rng, results = np.random.default_rng(5), passage_results(n=150)
    for result in results:
        fits, common = [f for f in result.tables["passage_fits"] if f["channel"] == "a_A7"], rng.normal(0, 4)
        result.tables["passage_fits"] = [
            f | {"channel": f"c{k}", "fit_pct": f["fit_pct"] + common + rng.normal(0, 2)}
            for f in fits for k in range(int(rng.integers(1, 4)))
        ]  # fmt: skip
    bench.register(*results)
    rows = bench.frame("from passage_scores where axle_load_t is not null")
    own = rows.groupby("passage_id").agg(
        {"fit_pct": "mean", "train_type": "first", "speed_kmh": "first", "axle_load_t": "first"}
    )
    made, _ = least_squares(own, "fit_pct")
    found = bench.frame("from fit_effects where score = 'fit' order by factor")
    np.testing.assert_allclose(found.change_se_pct, [made.bse.load, made.bse.speed], **SAME)
    np.testing.assert_allclose(found.change_pct, [made.params.load, made.params.speed], **SAME)
    assert list(found.n) == [len(rows)] * 2
    bars = bench.frame("from fit_adjusted where score = 'fit' and factor = 'train type'").set_index("class")
    for name, values in own.fit_pct.groupby(own.train_type):
        np.testing.assert_allclose(bars.score_se_pct[name], values.sem(), **SAME)
