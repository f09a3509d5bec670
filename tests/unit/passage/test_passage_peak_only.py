"""Passages without a score have a peak and count in the weekly values alone; wheels have their state."""

import sys
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from benchmarks.passage_truth import paper_model

from turnout.config import load_configuration
from turnout.config.settings.passage import PassageSettings
from turnout.passage.channel_fit import find_peak, fit_channel
from turnout.passage.result import PassageSensor
from turnout.registry.database import open_registry
from turnout.stages.passage_rows import fit_row
from turnout.workflow.batches import UnitResult

sys.path.insert(0, str(Path(__file__).parents[1] / "registry"))

from registry_rows import Bench, hammer_result

RATE = 5000.0
AXLES = np.array([0.8, 0.86, 1.2, 1.26])


def record():
    """Noise, and an impact at each axle."""
    samples = 0.2 * np.random.default_rng(5).standard_normal(10000)
    decay = np.exp(-200.0 * np.arange(250) / RATE) * np.sin(2 * np.pi * 600.0 * np.arange(250) / RATE)
    for k, axle in enumerate(AXLES):
        samples[int(axle * RATE) : int(axle * RATE) + 250] += (10.0 + k) * decay
    return samples, RATE, AXLES


RECORD = record()


@pytest.fixture(scope="module")
def fits():
    """(scored, not scored) of the same record."""
    model, settings = paper_model("CP A7"), replace(PassageSettings(), null_models=5)
    return fit_channel(*RECORD, 40.0, model, settings), find_peak(*RECORD, settings)


def test_the_peak_is_that_of_the_scored_passage(fits):
    scored, peak_only = fits
    assert peak_only.status == "peak_only" and peak_only.scores is None and scored.scores is not None
    assert peak_only.peak == scored.peak and 6.0 < scored.peak < 15.0
    assert len(scored.times) == len(scored.amplitudes) == len(AXLES) and len(peak_only.times) == len(AXLES)
    assert np.allclose(scored.times, AXLES, atol=0.005)


@pytest.mark.parametrize("error", [-0.006, -0.003, 0.003, 0.006])
def test_an_error_of_the_acceleration_of_a_train_does_not_change_the_peak(error):
    """A wrong acceleration moves the axle times against each other. A window behind each wheel would cut the burst."""
    axle_times = AXLES + np.linspace(-error, error, len(AXLES))
    samples, settings = RECORD[0].copy(), PassageSettings()
    burst = int((AXLES[0] - 0.004) * RATE) + np.arange(10)  # before the first wheel arrives
    samples[burst] += 60.0 * np.sin(2 * np.pi * 500.0 * burst / RATE)
    exact, shifted = find_peak(samples, RATE, AXLES, settings), find_peak(samples, RATE, axle_times, settings)
    assert shifted.status == "peak_only" and shifted.scores is None
    assert np.allclose(shifted.times, axle_times, rtol=0, atol=1e-9)
    fitted = fit_channel(samples, RATE, axle_times, 40.0, paper_model("CP A7"), settings, with_null=False)
    assert exact.peak > 15.0 and shifted.peak == pytest.approx(exact.peak, rel=1e-9)  # rounding of the filter
    assert fitted.peak == shifted.peak


def test_views_count_a_peak_without_scores_and_give_the_state_of_each_wheel(tmp_path):
    (tmp_path / "work").mkdir()
    bench, results = Bench(tmp_path), [hammer_result(section="A7", day="2017-10-02", file="f", key="f")]
    model = results[0].tables["models"][0] | {"b_vector": [2.0, -1.0]}
    results[0].tables["models"] = [model]
    for k in range(6):
        at = datetime(2017, 11, 6, 8 + k)  # one week
        passage = {
            "passage_id": f"p{k}", "turnout_id": "t1", "recording_id": f"r{k}", "passed_at_utc": at, "n_axles": 2,
            "status": "accepted", "train_type": "IC3", "speed_kmh": 160.0, "track": "main", "rail_temperature_c": 10.0,
        }  # fmt: skip
        fit = {
            "passage_id": f"p{k}", "section_id": "t1/A7", "channel": "A7", "model_id": model["model_id"],
            "turnout_id": "t1", "passed_at_utc": at, "n_wheels": 2, "status": "peak_only", "peak_ms2": 100.0,
        }  # fmt: skip
        if k == 0:
            fit |= {
                "status": "null_explains", "fit_pct": 5.0, "wheel_times_s": [0.8, 0.9],
                "wheel_amplitudes": [3.0, 5.0], "wheel_amplitudes_se": None,
            }  # fmt: skip
        tables = {"passages": [passage], "passage_fits": [fit]}
        results.append(UnitResult(f"t1/p{k}", "t1", "passage", f"p{k}", "1", "ok", tables))
    bench.register(*results)
    with open_registry(bench.registry) as connection:
        ask = lambda sql: connection.execute(sql).fetchall()  # noqa: E731
        assert ask("select count(*), any_value(frequency_hz) from passage_values where band = 'amplitude'") == [
            (1, pytest.approx(100.0))
        ]
        assert ask("select passage_id from passage_scores") == [("p0",)]
        assert ask("select null_share, n from passage_fits_weekly") == [(1.0, 6)]
        assert ask("select count(*) from rejected where what = 'fit'") == [(1,)]
        wheels = ask("select wheel, time_s, amplitude, initial_state from passage_wheels order by wheel")
        assert wheels == [(1, 0.8, 3.0, [6.0, -3.0]), (2, 0.9, 5.0, [10.0, -5.0])]


def test_a_list_with_a_value_that_is_not_finite_is_left_out(fits):
    """Without a quiet second before the train there is no noise, and no error of an amplitude."""
    scored, _ = fits
    base = load_configuration("config").turnout("tommerup_s1")
    identity = {"passed_at_utc": datetime(2025, 1, 1)}
    sensor = PassageSensor("A7", "A7", 24.6)
    row = fit_row(replace(scored, amplitudes_se=np.array([0.1, np.nan, 0.1, 0.1])), sensor, "m", base, identity)
    assert row["wheel_amplitudes_se"] is None and len(row["wheel_amplitudes"]) == len(row["wheel_times_s"]) == 4
    assert row["peak_ms2"] == scored.peak
