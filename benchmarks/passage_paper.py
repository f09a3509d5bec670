"""The score of the paper on simulated trains, and its trends with load and speed.

The paper re-estimates the initial state at an interval that it does not state, and scores on the same data.
"""

from collections.abc import Iterator

import numpy as np

from benchmarks.bar import Bar
from benchmarks.passage_truth import RATE, paper_model
from turnout.passage.channel_fit import fit_channel
from turnout.passage.model_tests import random_models
from turnout.passage.score_regression import effects
from turnout.passage.wheel_basis import apply_filter, band_pass

SENSOR, POSITION, LOCATION = 7, 24.6, "CP A7"
INTERVALS = (0.02, 0.005, 0.002, 0.001)


def reestimated_fit(data, model, interval: float) -> float:
    """Fit [%] of ``data`` (n,) at ``RATE`` with the state of the model re-estimated every ``interval`` [s]."""
    n = round(interval * RATE)
    rows, row = [], np.asarray(model.c, dtype=float)
    for _ in range(n):
        rows.append(row)
        row = row @ model.a
    windows = data[: len(data) // n * n].reshape(-1, n).T
    residual = windows - rows @ np.linalg.lstsq(np.array(rows), windows, rcond=None)[0]
    return float(100.0 * (1.0 - np.linalg.norm(residual) / np.linalg.norm(windows - windows.mean())))


def paper_trends(runs, settings, noise=0.2) -> Iterator[Bar]:
    """Fit by interval at A7 of the paper, for all trains of the main track, and effects of load and speed on ours."""
    rng, model = np.random.default_rng(9), paper_model(LOCATION)
    random = random_models(30, model.order, settings.band_low, settings.band_high, RATE, settings.null_seed)
    through = band_pass(settings.band_low, settings.band_high, settings.filter_order, RATE)
    by_interval, rows = {t: [] for t in INTERVALS}, []
    for run in (r for r in runs if r.route == "main"):
        samples = run.samples[SENSOR] + noise * rng.standard_normal(run.samples.shape[1])
        times = _passing_times(run, len(samples) / RATE)
        data = apply_filter(samples, through)[int(times[0] * RATE) : int((times[-1] + 0.05) * RATE)]
        for t in INTERVALS:
            null = [reestimated_fit(data, m, t) for m in random]
            by_interval[t].append((reestimated_fit(data, model, t), np.median(null), np.quantile(null, 0.95)))
        fit = fit_channel(samples, RATE, times, run.speed, model, settings)
        name = run.type.removesuffix(" double")
        rows.append({"train_type": name, "speed_kmh": 3.6 * run.speed, "axle_load_t": run.axle_load})
        rows[-1] |= {"fit_pct": fit.scores.fit, "null": fit.null.fit, "reestimated": by_interval[0.002][-1][0]}
    n = f"n={len(rows)}"
    for t, scores in by_interval.items():
        mean_fit, median, high = np.mean(scores, axis=0)
        note = f"random models: median {median:.0f}, 95 % {high:.0f}"
        yield Bar(f"paper's fit, state estimated again every {1e3 * t:g} ms, A7", mean_fit, None, "%", "", n, note)
    note = f"random models reach {np.mean([r['null'] for r in rows]):.1f} (95 %)"
    yield Bar("joint fit, one amplitude per wheel, A7", np.mean([r["fit_pct"] for r in rows]), None, "%", "", n, note)
    for score, words in (("fit_pct", "joint fit"), ("reestimated", "paper's fit at 2 ms")):
        for e in effects(rows, score):
            if e.factor != "train type":
                comparison = "others held fixed" if e.adjusted else "as compared"
                note = f"95 %: {e.low:+.2f} to {e.high:+.2f}, {comparison}"
                yield Bar(f"{words} with {e.factor}, per {e.per}", e.change, None, "points", "", n, note)


def _passing_times(run, duration):
    """Times at which the axles pass the sensor [s]. The first axle reaches the first sensor 1.2 s after the start."""
    from benchmarks.passage_fleet import SENSOR_POSITIONS

    distance = POSITION - min(SENSOR_POSITIONS) if run.direction == "facing" else max(SENSOR_POSITIONS) - POSITION
    times = 1.2 + (distance + run.offsets - run.offsets[0]) / run.speed
    return times[times < duration - 0.2]
