"""Benchmarks of the passage analysis: the paper's models, simulated trains, real axle times, clusters, cost."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from scipy import stats
from sklearn.metrics import adjusted_rand_score

from benchmarks import passage_fleet, passage_truth
from benchmarks.bar import Bar, stopwatch
from benchmarks.passage_paper import paper_trends
from benchmarks.passage_truth import IC3, RATE, impact_record, impact_train, paper_model
from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.axle_load import axle_load, calibrate, quasi_static, train_amplitude
from turnout.passage.axle_patterns import read_patterns
from turnout.passage.channel_fit import fit_channel
from turnout.passage.clusters import fit_clusters
from turnout.passage.impact_timing import impact_times
from turnout.passage.impulse_fit import onsets
from turnout.passage.model_tests import NullBand, direction_test, null_bases, null_scores
from turnout.passage.score_regression import effects
from turnout.passage.scores import fit_percent, score
from turnout.passage.segmentation import cut_passages
from turnout.passage.train_type import find_type
from turnout.passage.wheel_basis import apply_filter, band_pass, wheel_basis

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = PassageSettings()
LOCATIONS = ("OT", "SP", "CLP", "CP A7", "CP A8", "CP A9", "AS main", "AS diverging")
SPEEDS = {"IC3": (40, 100, 180), "IC3 double": (60, 160), "intercity": (50, 120, 160), "freight": (45, 80, 110)}
NOISE_LEVELS = (0.05, 0.2, 1.0)  # m/s²: a quiet sensor, 0.02 g as data sheets have it, and five times that
SENSOR_SUBSETS = ((7,), (4, 5), (2, 5, 9), tuple(range(12)))


def bars() -> Iterator[Bar]:
    yield from scores_and_times()
    yield from noise_passages()
    yield from null_level()
    yield from partial_trains()
    yield from real_axle_times()
    yield from axle_geometry()
    yield from simulated_fleet()
    yield from cluster_bars()
    yield from cost()


def shipped_patterns():
    """The axle patterns in config/vehicles."""
    return read_patterns(YAML(typ="safe").load(ROOT / "config" / "vehicles" / "axle_patterns.yaml"))


def scores_and_times() -> Iterator[Bar]:
    """True model, 40 dB, from detected axles; impact times at 40 and 26 dB."""
    rng = np.random.default_rng(1)
    fits = {}
    for location in LOCATIONS:
        for _ in range(5):
            p = impact_record(rng, location, start=1.2)
            detected = p.times / RATE + rng.normal(0.004, 0.001, p.times.size)
            fit = fit_channel(p.samples, RATE, detected, 44.4, paper_model(location), SETTINGS, with_null=False)
            fits.setdefault(location, []).append((fit.scores.fit, fit.scores.forecast, *_attainable_scores(p)))
    median = {k: np.median(v, axis=0) for k, v in fits.items()}
    for k, name in enumerate(("in-sample fit", "forecast")):
        worst = min(median, key=lambda location: median[location][k])
        yield Bar(f"{name} of the true model, 40 dB, A7", median["CP A7"][k], 95.0, "%", ">=", "n=5")
        note = f"{worst}; the noise allows {median[worst][2 + k]:.1f}"
        yield Bar(f"{name}, 40 dB, worst of 8 places", median[worst][k], None, "%", "", "n=5", note)
        shortfall = max(m[2 + k] - m[k] for m in median.values())
        yield Bar(f"{name}, 40 dB, furthest below what the noise allows", shortfall, 2.0, "points", "<=", "8 places")
    basis = wheel_basis(paper_model("CP A7"), None, RATE)
    for snr in (40.0, 26.0):
        errors, bound, n_unflagged, n_flagged = [], [], 0, 0
        for _ in range(60):
            p = impact_record(rng, snr_db=snr)
            expected = p.times + rng.normal(0.0, 10.0, p.times.size)
            timing = impact_times(p.samples, expected, basis, 60.0, p.noise, 20.0)
            is_wrong = np.ceil(timing.times) != np.ceil(p.times)
            n_unflagged += int(np.sum(is_wrong & ~timing.ambiguous))
            n_flagged += int(timing.ambiguous.sum())
            errors += list((timing.times - p.times)[~timing.ambiguous])
            _, phi = onsets(p.times)
            for g, f in zip(p.amplitudes, phi):
                rows = np.stack([basis.coefficients(f) @ basis.columns, g * (basis.slopes(f) @ basis.columns)])
                bound.append(p.noise * np.sqrt(np.linalg.inv(rows @ rows.T)[1, 1]))
        ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(bound)))
        yield Bar(f"impact time rms over the Cramér-Rao bound, {snr:g} dB", ratio, 1.5, "", "<=", "n=480 wheels")
        yield Bar(
            f"wrong intervals without a flag, {snr:g} dB", n_unflagged, 0, "", "<=", "n=480", f"{n_flagged} flagged"
        )
    p_values = []
    for _ in range(60):
        p = impact_record(rng)
        p_values += list(direction_test(p.samples, p.times, basis, p.noise).p_value)
    share = float(np.mean(np.array(p_values) < 0.01))
    limit = float(stats.binom.ppf(0.999, 480, 0.01) / 480)
    yield Bar("chi-squared test along b rejects intact wheels at level 0.01", share, limit, "", "<=", "n=480")


def _attainable_scores(passage):
    """Fit and forecast that the true response reaches on the noisy data [%]."""
    through = band_pass(80, 800, 4, RATE)
    data, clean = apply_filter(passage.samples, through), apply_filter(passage.clean, through)
    scores = []
    for first, last in ((0.0, SETTINGS.score_window), (SETTINGS.forecast_train, 0.020)):
        rows = [np.arange(int(t + first * RATE), int(t + last * RATE)) for t in passage.times]
        rows = np.concatenate(rows)
        scores.append(fit_percent(data[rows], clean[rows]))
    return scores


def noise_passages() -> Iterator[Bar]:
    """40 records of noise."""
    rng = np.random.default_rng(2)
    through = band_pass(80, 800, 4, RATE)
    basis, random = wheel_basis(paper_model("CP A7"), through, RATE), null_bases(4, through, RATE, SETTINGS)
    forecasts, null_best, leave_one_out, null_left = [], [], [], []
    for _ in range(40):
        times = (0.3 + IC3 / 44.4) * RATE
        data = apply_filter(rng.standard_normal(int(times[-1] + 5000)), through)
        result, null = score(data, times, basis, SETTINGS), null_scores(data, times, random, SETTINGS)
        forecasts.append(result.forecast)
        leave_one_out.append(result.leave_one_out)
        null_best.append(max(s.forecast for s in null))
        null_left += [s.leave_one_out for s in null]
    yield Bar("noise: median forecast with the section's model", np.median(forecasts), 0.0, "%", "<=", "n=40")
    yield Bar("noise: largest forecast with the section's model", max(forecasts), 3.0, "%", "<=", "n=40")
    yield Bar("noise: largest forecast with the best of 30 random models", max(null_best), 7.0, "%", "<=", "n=40")
    above = float(np.mean(np.array(leave_one_out) > np.quantile(null_left, 0.95)))
    yield Bar("noise: leave-one-out above the 95 % quantile of its null", above, 0.15, "", "<=", "n=40")


def null_level() -> Iterator[Bar]:
    """Random models against null bands of 30 others, on four records each of noise, rolling wheels and impacts."""
    rng, through = np.random.default_rng(12), band_pass(80, 800, 4, RATE)
    bases = null_bases(4, through, RATE, replace(SETTINGS, null_models=200, null_seed=12))
    above = []
    for k in range(12):
        speed = rng.uniform(20.0, 45.0)
        record, times = impact_record(rng, LOCATIONS[k % len(LOCATIONS)], speed=speed), (0.6 + IC3 / speed) * RATE
        samples = record.samples
        if k % 3 == 1:
            samples, times = rng.standard_normal(samples.size), record.times
        elif k % 3 == 2:
            samples = passage_truth.rolling_noise(rng, IC3, speed, (0.0,), lead=0.6).samples[0]
        scores = null_scores(apply_filter(samples, through), times, bases, SETTINGS)
        for _ in range(100):
            order = rng.permutation(len(scores))
            band = NullBand.of([scores[i] for i in order[:30]])
            above += [
                (
                    scores[i].fit > band.fit,
                    scores[i].forecast > band.forecast,
                    scores[i].leave_one_out > band.leave_one_out,
                )
                for i in order[30:60]
            ]
    for name, share in zip(("fit", "forecast", "leave-one-out"), np.mean(above, axis=0)):
        yield Bar(f"random models above the null of 30 others, {name}", 100 * share, 5.5, "%", "<=", "12 records")


def partial_trains() -> Iterator[Bar]:
    """Recordings that begin or end within the train, six sensors over 48 m."""
    rng, positions = np.random.default_rng(13), (-12.0, 3.6, 13.8, 24.6, 26.4, 36.0)
    coaches = (26.4 * np.arange(6)[:, None] + [2.5, 5.0, 21.5, 24.0]).ravel()
    tally = {"clock_drift": 0, "two_trains": 0, "train_cut_off": 0}
    for k in range(36):
        offsets, direction, speed = (IC3, coaches)[k % 2], (1, -1)[k // 2 % 2], rng.uniform(12.0, 30.0)
        recording = passage_truth.rolling_noise(rng, offsets, speed, positions, direction, lead=2.0)
        begin, stop = (2.0 + share * offsets[-1] / speed for share in (rng.uniform(0.2, 0.4), rng.uniform(0.6, 0.8)))
        part = slice(int(begin * RATE) if k % 3 else None, int(stop * RATE) if k % 3 != 1 else None)
        recording = replace(recording, samples=recording.samples[:, part])
        passage = analyse(recording, passage_truth.sensors_for(recording), shipped_patterns(), SETTINGS)
        for reason in tally:
            tally[reason] += reason in {f.reason for f in passage.findings}
    yield Bar("parts of trains: marked as cut off", tally["train_cut_off"], None, "of 36", "")
    yield Bar(
        "parts of trains: clocks or second trains reported", tally["clock_drift"] + tally["two_trains"], 2, "", "<="
    )


def real_axle_times() -> Iterator[Bar]:
    """Fifteen trains at two sections near Bern."""
    path = ROOT.parent / "shared" / "data" / "track_sbb_niederwangen" / "results.json"
    if not path.exists():
        return
    trains, patterns, rng = json.loads(path.read_text()), shipped_patterns(), np.random.default_rng(3)
    n_named = n_counted = 0
    worst = 0.0
    for k in range(15):
        train = trains[str(k)]
        for location in ("Q1", "Q4"):
            times = np.array(train[location]["tPeaks"])
            match = find_type(times, patterns, SETTINGS)
            n_named += match.type == train["Zugstyp"]
            mean_speed = match.speed + match.acceleration * (times[-1] - times[0]) / 2
            worst = max(worst, abs(3.6 * mean_speed - train[location]["vAv"]))
            n_counted += _count_bursts(train[location], rng) == train["axleN"]
    yield Bar("real: type IC or Regio from the axle times", n_named, 30, "of 30", ">=")
    yield Bar("real: largest difference of mean speed", worst, 0.7, "km/h", "<=", "n=30")
    yield Bar("real: axles counted in bursts at the measured times, one sensor", n_counted, 30, "of 30", ">=")


def _count_bursts(train, rng):
    times = np.array(train["tPeaks"]) - train["tPeaks"][0] + 1.0
    time = np.arange(int((times[-1] + 1.0) * RATE)) / RATE
    power = sum(np.exp(-np.abs(time - t) * (train["vAv"] / 3.6) / 0.4) for t in times)
    samples = np.sqrt(power) * rng.standard_normal(time.size) + 0.02 * rng.standard_normal(time.size)
    recording = passage_truth.recording_of(samples[None], [0.0])
    return analyse(recording, passage_truth.sensors_for(recording), shipped_patterns(), SETTINGS).n_axle


def axle_geometry() -> Iterator[Bar]:
    """Thirty train types, each with and without its template."""
    from importlib.util import module_from_spec, spec_from_file_location

    folder = ROOT.parent / "shared" / "data" / "train_axle_geometry" / "data"
    if not folder.is_dir():
        return
    spec = spec_from_file_location("geometry", ROOT / "tests" / "published" / "test_passage_axle_geometry.py")
    tools = module_from_spec(spec)
    spec.loader.exec_module(tools)
    cars = {p.stem: tools.read_vehicle(p) for p in sorted((folder / "cars").glob("*.txt"))}
    types = [tools.read_train(p, cars) for p in sorted((folder / "trains").glob("*.txt"))]
    rng, n_named, n_unknown, total = np.random.default_rng(4), 0, 0, 0
    for pattern in types:
        without_own = tools.both_ways([p for p in types if p is not pattern])
        for _ in range(10):
            times = tools.passing_times(pattern, rng)
            total += 1
            n_named += find_type(times, tools.both_ways(types), SETTINGS, position_se=0.03).type == pattern.type
            n_unknown += find_type(times, without_own, SETTINGS, position_se=0.03).type == "unknown"
    yield Bar("30 types: named, speed unknown, axles 3 cm off", 100 * n_named / total, 99.0, "%", ">=", f"n={total}")
    yield Bar("30 types: unknown without the own template", 100 * n_unknown / total, 95.0, "%", ">=", f"n={total}")


def simulated_fleet(runs=None, unlisted=None) -> Iterator[Bar]:
    """Four types, 40 to 180 km/h, empty and loaded, three noise levels, 1 to 12 sensors."""
    rng, patterns = np.random.default_rng(5), shipped_patterns()
    runs = list(runs if runs is not None else passage_fleet.fleet(SPEEDS))
    yield from paper_trends(runs, SETTINGS)
    cases = [(r, rows, noise) for r in runs for noise in NOISE_LEVELS for rows in SENSOR_SUBSETS]
    tally = {"axles": 0, "speed": 0, "place": 0, "type": 0, "given": 0, "named_wrong": 0, "sure_wrong": 0}
    loads, n_several = {}, 0
    for run, rows, noise in cases:
        recording, sensors = passage_fleet.sensor_recording(run, rows, noise, rng)
        passage = analyse(recording, sensors, patterns, SETTINGS)
        is_several = len(rows) > 1
        n_several += is_several
        is_right = passage.n_axle == len(run.offsets)
        tally["axles"] += is_right
        name = run.type.removesuffix(" double")
        if passage.n_axle:
            tally["type"] += passage.type.type == name
            tally["named_wrong"] += passage.type.type not in (name, "unknown")
            tally["sure_wrong"] += not is_right and "axles_uncertain" not in {f.reason for f in passage.findings}
            tally["given"] += passage.speed.source != "bogie"
            tally["speed"] += abs(passage.speed.speed / run.speed - 1) <= 0.003 and passage.speed.source != "bogie"
            tally["place"] += is_several and passage.direction == run.direction and passage.track == run.route
        if rows == SENSOR_SUBSETS[-1] and is_right and noise == NOISE_LEVELS[1]:
            loads.setdefault((run.type, run.axle_load, run.speed), (recording, passage, run))
    n = len(cases)
    yield Bar("simulated: axles exact", 100 * tally["axles"] / n, 99.5, "%", ">=", f"n={n}")
    yield Bar("simulated: axle count wrong and not flagged", tally["sure_wrong"], None, "", "", f"n={n}")
    yield Bar(
        "simulated: speed within 0.3 %, where one is given",
        100 * tally["speed"] / max(tally["given"], 1),
        99.5,
        "%",
        ">=",
        f"n={tally['given']}",
    )
    yield Bar(
        "simulated: direction and track, two sensors or more",
        100 * tally["place"] / n_several,
        100.0,
        "%",
        ">=",
        f"n={n_several}",
    )
    yield Bar(
        "simulated: type", 100 * tally["type"] / n, 99.0, "%", ">=", f"n={n}", f"{tally['named_wrong']} named wrongly"
    )
    n_unknown = total = 0
    for run in unlisted if unlisted is not None else passage_fleet.unlisted_runs():
        for noise in NOISE_LEVELS:
            for rows in SENSOR_SUBSETS:
                recording, sensors = passage_fleet.sensor_recording(run, rows, noise, rng)
                passage = analyse(recording, sensors, patterns, SETTINGS)
                total += 1
                n_unknown += passage.type is None or passage.type.type == "unknown"
    yield Bar(
        "simulated: trains without template called unknown", 100 * n_unknown / total, 95.0, "%", ">=", f"n={total}"
    )
    yield from _load_bars(list(loads.values()))


def _load_bars(cases) -> Iterator[Bar]:
    """Axle load of each train after calibration on the others."""
    amplitude = [
        {
            c.name: train_amplitude(quasi_static(recording.signal(c.name), RATE, passage, c.position))
            for c in recording.channels
            if c.name in passage.at_sensor
        }
        for recording, passage, _ in cases
    ]
    errors, relative_errors = [], []
    for k, (recording, passage, run) in enumerate(cases):
        calibrations = {}
        for name in amplitude[k]:
            reference_cases = [i for i in range(len(cases)) if i != k and name in amplitude[i]]
            calibration = calibrate(
                [amplitude[i][name][0] for i in reference_cases],
                [cases[i][2].axle_load for i in reference_cases],
                [cases[i][1].motion.speed for i in reference_cases],
                SETTINGS.load_trains_minimum,
                [amplitude[i][name][1] for i in reference_cases],
            )
            if calibration is not None:
                calibrations[name] = calibration
        load = axle_load(recording, passage, calibrations, replace(SETTINGS, load_relative_error_maximum=0.5))
        if load is not None:
            errors.append(load.mean / run.axle_load - 1)
            relative_errors.append(load.se / load.mean)
    errors, relative_errors = np.abs(errors), np.array(relative_errors)
    is_given = relative_errors <= SETTINGS.load_relative_error_maximum
    n = f"n={is_given.sum()} of {len(cases)}"
    if is_given.any():
        within = 100 * float(np.mean(errors[is_given] <= 0.05))
        yield Bar("simulated: load within 5 % where given", within, 95.0, "%", ">=", n)
    else:
        yield Bar("simulated: loads given", 0, None, "", "", n, "none: every standard error is above the limit")
    if errors.size:
        note = (
            f"median standard error {100 * np.median(relative_errors):.1f} %, "
            f"{np.mean(errors < 2 * relative_errors):.0%} within two of them"
        )
        yield Bar(
            "simulated: median error of all loads, given or not", 100 * np.median(errors), None, "%", "", "", note
        )


def cluster_bars() -> Iterator[Bar]:
    """Clusters of traffic with known types, clusters after one more night, and effects on a score with known causes."""
    from importlib.util import module_from_spec, spec_from_file_location

    spec = spec_from_file_location("traffic", ROOT / "tests" / "unit" / "passage" / "test_passage_clusters.py")
    tools = module_from_spec(spec)
    spec.loader.exec_module(tools)
    rng = np.random.default_rng(6)
    rows, truth = tools.night(rng, 1500)
    clusters = fit_clusters(rows, SETTINGS)
    rand = adjusted_rand_score(truth, tools.labels(clusters, rows))
    yield Bar(
        "clusters: adjusted Rand index", rand, 0.95, "", ">=", "n=1500", f"{len(clusters.clusters)} found, 5 true"
    )
    more, _ = tools.night(rng, 80)
    again = fit_clusters(rows + more, SETTINGS, clusters)
    same = np.mean(np.array(tools.labels(again, more)) == np.array(tools.labels(clusters, more)))
    yield Bar("clusters: same id after a night is added and fitted", 100 * same, 97.0, "%", ">=", "n=80")
    covered = total = 0
    for _ in range(200):
        for e in effects(tools.confounded(rng)):
            if e.adjusted:
                total += 1
                covered += e.low <= (-2.0 if e.factor == "axle load" else 0.0) <= e.high
    yield Bar(
        "effects, others held fixed: coverage of the 95 % interval",
        100 * covered / total,
        92.0,
        "%",
        ">=",
        f"n={total}",
    )


def cost() -> Iterator[Bar]:
    """One passage of 10 s, 12 sensors, 8 axles; ten minutes of a logger."""
    rng = np.random.default_rng(7)
    positions = [3.0 * k for k in range(12)]
    locations = [LOCATIONS[k % 8] if k % 8 != 4 else "OT" for k in range(12)]
    recording, _ = impact_train(rng, locations, positions, speed=30.0, lead=6.2)
    recording = passage_truth.recording_of(recording.samples[:, : int(10 * RATE)], positions)
    sensors, patterns = passage_truth.sensors_for(recording), shipped_patterns()
    models = {s.name: paper_model(location) for s, location in zip(sensors, locations)}
    other_models = {location: paper_model(location) for location in LOCATIONS[1:]}
    for nulls, limit in ((False, 0.3), (True, 1.5)):
        least_cpu = np.inf
        for _ in range(3):
            with stopwatch() as watch:
                passage = analyse(recording, sensors, patterns, SETTINGS)
                for name, times in passage.at_sensor.items():
                    samples, speed = recording.signal(name), passage.motion.speed
                    fit_channel(
                        samples, RATE, times, speed, models[name], SETTINGS, other_models if nulls else None, nulls
                    )
            least_cpu = min(least_cpu, watch.cpu)
        words = "all scores, null bands, 7 other models" if nulls else "all scores, no null bands"
        note = f"{passage.n_axle} axles, {len(passage.at_sensor)} sensors"
        yield Bar(f"cost: 12 sensors, 8 axles, 10 s, {words}", least_cpu, limit, "CPU s", "<=", "best of 3", note)
    yield from _logger_bars(rng)


def _logger_bars(rng) -> Iterator[Bar]:
    import tracemalloc

    def blocks():
        for _ in range(120):
            yield (0.02 * rng.standard_normal((12, int(5 * RATE)))).astype(np.float32)

    with stopwatch() as watch:
        n_passages = len(list(cut_passages(blocks(), RATE, SETTINGS)))
    tracemalloc.start()
    list(cut_passages(blocks(), RATE, SETTINGS))
    peak = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    whole = 12 * 600 * RATE * 8 / 2**20
    note = f"{n_passages} passages; the file as float64 is {whole:.0f} MiB; CPU with making the data {watch.cpu:.0f} s"
    yield Bar("cost: 10 min x 12 channels x 20 kHz, peak memory of the cut", peak, 200.0, "MiB", "<=", "", note)
    yield from _logger_file_bars(rng)


CHILD_CODE = """
import sys, time
from pathlib import Path
from turnout.passage.analysis import analyse
from turnout.stages.passage import trains_in
from turnout.readers import read
from turnout.records import RawChannel, RawDescription
from benchmarks.bench_passage import SETTINGS, passage_truth
channels = tuple(RawChannel(f"c{i}", f"c{i}", "acceleration", unit="1e-3 m/s²", position=3.0 * i) for i in range(12))
described = RawDescription(channels, kind="passage", rate=20000.0)
def peak():  # of this program: ru_maxrss begins with what its parent had
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024
import h5py, turnout.readers.hdf5
before, began = peak(), time.process_time()
result = read(sys.argv[2], sys.argv[1], described, SETTINGS.longest)
axles = []
for record in (*result.recordings, *result.long_recordings):
    for part, _, _ in trains_in(record, SETTINGS):
        axles.append(analyse(part, passage_truth.sensors_for(part), passage_truth.PATTERNS, SETTINGS).n_axle)
print(peak() - before, time.process_time() - began, *axles)
"""


def _logger_file_bars(rng) -> Iterator[Bar]:
    """Files of 200 s and 600 s of 2-byte integers, read, cut and analysed in a separate process."""
    import subprocess
    import sys
    import tempfile

    import h5py

    positions = [3.0 * k for k in range(12)]
    train = 1e3 * passage_truth.rolling_noise(rng, IC3, 33.0, positions, noise=0.0).samples
    peaks = []
    for seconds, starts in ((200, (60,)), (600, (60, 287, 452))):
        with tempfile.TemporaryDirectory() as folder:
            with h5py.File(Path(folder) / "logger.h5", "w") as file:
                file.attrs["rate"] = RATE
                for i, row in enumerate(train):
                    samples = np.tile(rng.normal(0.0, 20.0, int(20 * RATE)), seconds // 20)
                    for start in starts:
                        samples[int(start * RATE) :][: row.size] += row
                    file.create_dataset(f"c{i}", data=np.round(samples).astype(np.int16), chunks=(2**16,))
            command = [sys.executable, "-c", CHILD_CODE, folder, "logger.h5"]
            output = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
        peaks.append(float(output[0]))
        whole = 12 * seconds * RATE * 8 / 2**20
        note = f"axles {' '.join(output[2:])}; {float(output[1]):.0f} CPU s; whole as float64 {whole:.0f}"
        yield Bar(
            f"cost: logger file of {seconds} s, resident memory of reading to axles",
            peaks[-1],
            400.0,
            "MiB",
            "<=",
            "",
            note,
        )
    yield Bar("cost: ... three times the file", peaks[1] / peaks[0], 1.2, "times", "<=")
