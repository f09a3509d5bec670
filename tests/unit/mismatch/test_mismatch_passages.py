"""Passages: columns against the simulation, a flat in the residual, and numerical errors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.errors import SimulationError
from turnout.mismatch import diagnose
from turnout.mismatch.engine.evidence import assess
from turnout.mismatch.engine.localization import locate
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase, passage_observation
from turnout.mismatch.turnout.candidates.wheel_flats import FlatEvidence, flat_candidates
from turnout.mismatch.turnout.passage_alignment import _best_alignment, align, low_pass
from turnout.mismatch.turnout.passage_band import limit_band, read_at
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.priors import ALIGNMENT, SIMULATION
from turnout.mismatch.turnout.screening import _passage_channel_changes
from turnout.physics.transfer import TransferTerm
from turnout.stages.finding_row import sentence


@pytest.fixture(scope="module")
def plan():
    return small_plan((15.0,), hammer_positions=(24.0,))


@pytest.fixture(scope="module")
def campaign(plan):
    return measured_campaign(plan, (), 7)


@pytest.fixture(scope="module")
def intact(campaign):
    case = TrackCase(campaign)
    return case, {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}


def test_the_column_of_a_linear_channel_is_the_change_that_the_case_predicts(intact):
    """For every start of every such effect, once beside a gain of the same channel. The error is that of the end of the
    record, where the case cuts the signal between channel and band."""
    case, values = intact
    (o,) = (o for o in case.observations if o.name == "heavy 2")
    chosen = [(c, k) for c in case.candidates if c.where.get("sensor") == "S3" for k in range(len(c.starts))]
    chosen = [(c, k) for c, k in chosen if isinstance(c.term(c.starts[k]), TransferTerm)]
    for terms in ((), (physics.SensorGain("S3", 0.6),)):
        (before,) = case.predict(values, terms, [o])
        columns = _passage_channel_changes(case, SimpleNamespace(values=values, terms=terms), o, before, chosen)
        for c, k in chosen:
            (after,) = case.predict(values, (*terms, c.term(c.starts[k])), [o])
            if c.family.startswith("hammer"):  # no fault of passages
                assert (c.key, k) not in columns and np.array_equal(after, before)
                continue
            error = np.linalg.norm(columns[c.key, k] - (after - before)) / np.linalg.norm(after - before)
            assert error < (1e-9 if c.family.endswith("gain") else 2e-3), (c.key, k)
    gains_and_delays = {"time_offset", "passage_delay", "hammer_delay", "sensor_gain", "passage_gain", "hammer_gain"}
    assert {c.family for c, _ in chosen} == gains_and_delays | {"low_pass", "high_pass", "mount_resonance"}


@pytest.mark.slow
@pytest.mark.parametrize("wavelength", [0.9, 0.5])
def test_the_derivative_by_a_wave_of_the_rail_has_the_direction_of_the_simulated_change(intact, wavelength):
    case, values = intact
    name = case.predictor.waves.names[2 * int(np.argmin(np.abs(case.predictor.waves.lengths - wavelength)))]
    index = [n.name for n in case.nuisances].index(name)
    seen = [o for o in case.observations if o.name == "heavy 2"]
    before = case.predict(values, (), seen)
    column = case.nuisance_jacobian(values, (), seen, before)[0][:, index]
    change = case.predict({**values, name: case.nuisances[index].sd}, (), seen)[0] - before[0]
    cosine = change @ column / np.sqrt((change @ change) * (column @ column))
    assert cosine > 0.9


@pytest.mark.slow
def test_the_derivative_by_a_wave_near_the_resonance_of_the_wheel_is_as_simulated(intact):
    """The wheel vibrates on over supports of other stiffness. Derivatives for a wheel at rest at each node err by 0.28
    at 50 Hz; with the sidebands of the moving wheel by 0.16, because of its neighbouring wheels."""
    case, values = intact
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    waves, (before,) = case.predictor.waves, case.predict(values, (), [seen])
    (jacobian,) = case.nuisance_jacobian(values, (), [seen], [before])
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    for wavelength in (1.4, 1.1, 0.9, 0.8, 0.7):  # 29 to 57 Hz
        wave = waves.names[2 * int(np.argmin(np.abs(waves.lengths - wavelength)))]
        (after,) = case.predict({**values, wave: values[wave] + 3e-6}, (), [seen])
        change, column = seen.whiten((after - before) / 3e-6), seen.whiten(jacobian[:, index[wave]])
        assert np.linalg.norm(column - change) < 0.2 * np.linalg.norm(change), wavelength


@pytest.mark.slow
@pytest.mark.parametrize(
    "term",
    [
        physics.SensorPosition("S3", 0.4),
        physics.TimeOffset("S3", 3e-3),
        physics.SensorGain("S3", 0.6),
        physics.UnsprungMass(2.5, "heavy"),
    ],
)
def test_derivatives_of_passages_include_the_terms(intact, term):
    """A wave of the rail and a pad, in S3 with position, time and gain of the term, under the wheels of the term."""
    case, values = intact
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    wave = case.predictor.waves.names[2 * int(np.argmin(np.abs(case.predictor.waves.lengths - 0.7)))]
    row = [s.name for s in case.aligned_passages["heavy 2"].sensors].index("S3")
    before = case.predict(values, (term,), [seen])[0]
    jacobian = case.nuisance_jacobian(values, (term,), [seen], [before])[0]
    for name, size in ((wave, 3e-5), ("pad_40", 0.05)):
        column = jacobian[:, [n.name for n in case.nuisances].index(name)]
        change = (case.predict({**values, name: values[name] + size}, (term,), [seen])[0] - before) / size
        a, b = (v.reshape(4, -1)[row] for v in (column, change))
        assert a @ b / np.sqrt((a @ a) * (b @ b)) > 0.9  # as that of an intact channel
        assert np.linalg.norm(a) == pytest.approx(np.linalg.norm(b), rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("hangs", [False, True])
def test_the_derivative_by_a_wave_has_the_simulated_level_on_uneven_supports(intact, hangs):
    """Waves of 50 to 75 Hz, whitened as in the fit. The force of a wheel depends on the rail under it, and a hanging
    sleeper gives way. Met are 0.93 and 14 %; with the rail of the middle alone the level is a third lower, with the
    hanging sleeper on its ballast a sixth."""
    case, values = intact
    middle = int(np.argmin(np.abs(case.predictor.track().support - 24.0)))
    term = (physics.HangingSleeper(middle, 1.5e-3, 0.05),) if hangs else ()
    values = values if term else {**values, f"ballast_{middle}": -1.5}
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    before = case.predict(values, term, [seen])[0]
    jacobian = case.nuisance_jacobian(values, term, [seen], [before])[0]
    for wavelength in (0.55, 0.45, 0.38):
        wave = case.predictor.waves.names[2 * int(np.argmin(np.abs(case.predictor.waves.lengths - wavelength)))]
        index = [n.name for n in case.nuisances].index(wave)
        change = case.predict({**values, wave: values[wave] + case.nuisances[index].sd}, term, [seen])[0] - before
        column, change = seen.whiten(jacobian[:, index]), seen.whiten(change) / case.nuisances[index].sd
        assert column @ change / np.sqrt((column @ column) * (change @ change)) > 0.9
        assert np.linalg.norm(column) == pytest.approx(np.linalg.norm(change), rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cosine", "size"),
    [
        ("pad_stiffness", 0.999, 0.02),
        ("ballast_stiffness", 0.999, 0.02),
        ("ballast_damping", 0.999, 0.02),
        ("sleeper_mass", 0.4, 0.4),
        ("ballast_damper_40", 0.9, 0.15),
        ("pad_damper_40", 0.6, 0.4),
    ],
)
def test_derivatives_by_supports_are_those_of_the_simulation(intact, name, cosine, size):
    """Whitened, against a difference of 0.01. Derivatives by stiffness and ballast damping of all supports are
    simulated. A mass acts by the second derivative of the motion at 1.8 kHz, for a wheel at rest: only the direction is
    right. Without derivatives by dampers of single supports, fits of a crossing ended 6 nats too low."""
    case, values = intact
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    before = case.predict(values, (), [seen])[0]
    jacobian = case.nuisance_jacobian(values, (), [seen], [before])[0]
    column = seen.whiten(jacobian[:, [n.name for n in case.nuisances].index(name)])
    change = seen.whiten(case.predict({**values, name: values[name] + 0.01}, (), [seen])[0] - before) / 0.01
    assert column @ change / np.sqrt((column @ column) * (change @ change)) > cosine
    assert np.linalg.norm(column) == pytest.approx(np.linalg.norm(change), rel=size)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "step", "error"), [("speed", 2e-3, 0.12), ("load", 1e-4, 0.03), ("wheels", 1e-4, 0.03)]
)
def test_derivatives_by_a_train_are_those_of_the_simulation(intact, name, step, error):
    """Against central differences. The derivative by the speed is a scale of time. Differences below 0.001 contain the
    grid of the simulation, a third of their size."""
    case, values = intact
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    name = "wheels_heavy" if name == "wheels" else f"{name}@heavy 2"
    (before,), (after,), (sooner,) = (
        case.predict({**values, name: values[name] + d}, (), [seen]) for d in (0.0, step, -step)
    )
    k = [n.name for n in case.nuisances].index(name)
    column = seen.whiten(case.nuisance_jacobian(values, (), [seen], [before])[0][:, k])
    change = seen.whiten(after - sooner) / (2.0 * step)
    assert np.linalg.norm(column - change) < error * np.linalg.norm(change)


@pytest.mark.slow
def test_a_flat_is_found_on_its_wheel_with_its_angle(plan):
    flat = physics.WheelFlat(2, 0.07, 0.43, 1.1, "heavy")
    case = TrackCase(measured_campaign(plan, (flat,), 7))
    found = flat_candidates(case, fit_jointly(case, iterations=12))
    assert found and found[0].where == {"train": "heavy", "axle": 3}
    turn = 2.0 * np.pi * 0.43
    for _, phase in found[0].term([0.07]).phases:
        way = (phase - 1.1 + 0.5 * turn) % turn - 0.5 * turn
        assert abs(way) < turn / 24.0  # the grid of phases
    assert found[0].starts[0][0] == pytest.approx(0.07, abs=0.015)


@pytest.mark.slow
def test_without_a_flat_no_wheel_is_named(plan, intact):
    case, _ = intact
    assert flat_candidates(case, fit_jointly(case, iterations=12)) == ()


@pytest.mark.slow
def test_a_too_coarse_step_gives_the_answer_numerics_and_no_name(plan):
    """With Gauss's scheme at 1.8 kHz the high modes of four elements per bay cause aliases in the band, see
    docs/decisions."""
    one_passage = replace(plan, trains=plan.trains[-1:])
    case = TrackCase(measured_campaign(one_passage, (), 7), solver=Track1D(1800.0, "gauss", 4))
    found = diagnose(case)
    assert found.verdict.answer == "numerics" and not found.names


def test_the_derivative_by_the_position_of_a_sensor_is_that_of_the_simulation(intact):
    case, values = intact
    observation = next(o for o in case.observations if o.name in case.aligned_passages)
    names = [n.name for n in case.nuisances]
    predicted = case.predict(values, (), [observation])
    column = case.nuisance_jacobian(values, (), [observation], predicted)[0]
    moved = next(n for n in names if n.startswith("seat_"))
    further = case.predict({**values, moved: values[moved] + 0.01}, (), [observation])[0]  # simulated again
    expected = (further - predicted[0]) / 0.01
    assert np.linalg.norm(expected) > 0.0
    # signals are solved to 1e-3 of the contact force; two runs with other probes may differ by rounding alone
    assert np.linalg.norm(column[:, names.index(moved)] - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("without_worst", [False, True])
def test_all_lags_together_give_the_results_of_single_lags(without_worst):
    """Correlations by transforms, of all sensors together, against sums of products for each sensor and lag."""
    rng = np.random.default_rng(3)
    low = limit_band(rng.normal(size=(3, 900)), 1800.0, high=ALIGNMENT.band_end)
    time = np.arange(0.0, 0.5, ALIGNMENT.sample_step)
    data = np.zeros((3, 500))
    data[:, 37 : 37 + time.size] = read_at(low, 1800.0, time * 1.005 - 0.005 * SIMULATION.lead_time)
    data[0] *= -1.0 if without_worst else 1.0
    by_hand = []
    for stretch in np.linspace(-ALIGNMENT.max_stretch, ALIGNMENT.max_stretch, ALIGNMENT.n_stretches):
        model = read_at(low, 1800.0, SIMULATION.lead_time + (time - SIMULATION.lead_time) * (1.0 + stretch))
        pairs = [(d / np.linalg.norm(d), m / np.linalg.norm(m)) for d, m in zip(data, model)]
        by_sensor = np.array([np.correlate(d, m, "full") for d, m in pairs])
        scores = (by_sensor.sum(axis=0) - without_worst * by_sensor.min(axis=0)) / (3 - without_worst)
        by_hand.append((scores.max(), int(np.argmax(scores)) - time.size + 1, stretch))
    found = _best_alignment(data, low, 1800.0)
    assert found == pytest.approx(max(by_hand), abs=1e-9) and found[1:] == pytest.approx((37, 0.005))


@pytest.fixture(scope="module")
def heavy_passage(intact):
    """Case, a passage of a heavy train, its sensors, and the simulated signals of this and of a light train."""
    case, values = intact
    sensors = case.aligned_passages["heavy 2"].sensors
    passage = next(p for p in case.campaign.passages if p.name == "heavy 2")
    simulator = case.predictor.passage_simulator(values, (), passage)
    vehicles = (passage.vehicle, case.aligned_passages["light 2"].passage.vehicle)
    signals, light = (simulator(passage, vehicle, passage.speed, sensors) for vehicle in vehicles)
    return case, passage, sensors, signals, light


@pytest.mark.parametrize("wrong", [0, 1])
def test_a_passage_with_one_wrong_sensor_is_used_and_one_of_a_wrong_train_is_not(heavy_passage, wrong):
    """With one reversed sign the correlation over four sensors is (3 - 1) / 4 at most; over the other three it is as
    before. With two reversed signs, or the wrong train, it is below the limit."""
    case, passage, sensors, signals, light = heavy_passage
    reference, speed, _ = align(passage, low_pass(passage.recording, sensors), signals, case.predictor.solver.rate)
    rows = [passage.recording.index(s.name) for s in sensors]

    def reversed_(*which):
        samples = passage.recording.samples.copy()
        samples[[rows[k] for k in which]] *= -1.0
        turned = replace(passage, recording=replace(passage.recording, samples=samples))
        return align(turned, low_pass(turned.recording, sensors), signals, case.predictor.solver.rate)

    found = reversed_(wrong)
    assert found[2] > ALIGNMENT.min_correlation and found[0] == pytest.approx(
        reference, abs=2.6e-3
    )  # two steps of the search
    assert found[1] == pytest.approx(speed, rel=0.003)
    assert reversed_(wrong, wrong + 2)[2] < ALIGNMENT.min_correlation
    assert (
        align(passage, low_pass(passage.recording, sensors), light, case.predictor.solver.rate)[2]
        < ALIGNMENT.min_correlation
    )


def test_impacts_much_stronger_than_any_axle_do_not_prevent_the_recognition_of_the_train(heavy_passage):
    """Three impacts of eight times the largest acceleration, 20 ms long and 160 ms apart. The correlation with and
    without them is low. The right train is still accepted and the wrong one is not."""
    case, passage, sensors, signals, light = heavy_passage
    quiet = low_pass(passage.recording, sensors)
    reference = align(passage, quiet, signals, case.predictor.solver.rate)[0]
    time = np.arange(quiet.shape[1]) / 800.0
    impacts = sum(np.exp(-(((time - reference - 0.02 - 0.16 * k) / 0.01) ** 2)) for k in range(3))
    with_impacts = quiet + 8.0 * np.max(np.abs(quiet), axis=1, keepdims=True) * impacts
    alike = np.sum(quiet * with_impacts, axis=1) / np.linalg.norm(quiet, axis=1) / np.linalg.norm(with_impacts, axis=1)
    assert np.max(np.abs(alike)) < 0.7 * ALIGNMENT.min_correlation
    assert align(passage, with_impacts, signals, case.predictor.solver.rate)[2] > ALIGNMENT.min_correlation
    assert align(passage, with_impacts, light, case.predictor.solver.rate)[2] < ALIGNMENT.min_correlation


def power(case, train):
    """Variance of a train's modes over the band below 60 Hz, by the passage first recorded."""
    o = next(o for o in case.observations if o.name in case.aligned_passages and o.name.startswith(train))
    made = case.aligned_passages[o.name]
    rows = np.asarray(o.modes, dtype=float).reshape(len(made.sensors), made.time.size, -1)
    spectrum = np.abs(np.fft.rfft(rows, axis=1)) ** 2
    inside = np.fft.rfftfreq(made.time.size, 1.0 / made.clock) < 60.0
    return float(spectrum[:, inside].sum())


@pytest.mark.slow
def test_errors_of_a_passage_are_those_of_wheels_with_the_fitted_mass(intact):
    """The prior of roughness depends on the mass of wheels. Twice the mass lowers the P2 frequency, by 1 / sqrt 2 if
    the rail is a spring, and raises the effect of roughness below 60 Hz; the errors of the other train stay."""
    case, values = intact
    fit = fit_jointly(case, values=values, iterations=1)
    assert case.with_updated_errors(fit) is case
    heavy = replace(fit, values={**fit.values, "wheels_heavy": np.log(2.0)}, covariance=1e-4 * np.eye(len(fit.values)))
    new = case.with_updated_errors(heavy)
    assert new is not case and new.with_updated_errors(heavy) is new
    assert power(new, "heavy") > 1.3 * power(case, "heavy")
    assert power(new, "light") == power(case, "light")
    assert case.log_mass_ratios == {} and set(new.log_mass_ratios) == {"heavy"}
    term = next(c for c in case.candidates if c.family == "unsprung_mass" and c.where["train"] == "heavy")
    named = replace(fit, candidates=(term,), psi=np.array([2.0]))
    assert case.with_updated_errors(named).log_mass_ratios["heavy"] == pytest.approx(np.log(2.0), abs=0.1)


@pytest.mark.slow
def test_passages_are_simulated_on_the_fitted_rail(intact):
    """The rail was calibrated by impacts with an effect; with the effect in the model the rail differs. Passages and
    their errors are then those of a case with the new rail, and impacts stay as they were."""
    case, values = intact
    fit = fit_jointly(case, values=values, iterations=1)
    bent = {name: at - 0.1 * (name == "rail_shear") for name, at in case.predictor.rail.items()}
    assert case.with_updated_errors(replace(fit, values={**fit.values, **bent})) is case
    bent["rail_shear"] -= 0.3
    softer = replace(fit, values={**fit.values, **bent})
    new, made = case.with_updated_errors(softer), case.predictor.recentre(bent)
    assert new.predictor.rail == bent and new.with_updated_errors(softer) is new and case.predictor.rail != bent
    seen = next(o for o in case.observations if o.name == "heavy 2")
    (before,), (found,), (exact,) = (c.predict(softer.values, (), [seen]) for c in (case, new, made))
    assert np.array_equal(found, exact) and np.linalg.norm(found - before) > 0.01 * np.linalg.norm(before)
    assert power(new, "light") != power(case, "light") and power(new, "heavy") != power(case, "heavy")
    for old, again in zip(case.observations, new.observations):
        assert (again is old) is (old.name in case.frf_pairs)


def test_a_train_that_differs_from_its_type_is_reported_and_localized(campaign):
    """The heavy train has other wheelsets than its file: none of its passages is used, and this is reported."""
    other = {p.train: p.vehicle for p in campaign.passages}
    swapped = [replace(p, vehicle=other["light"]) if p.train == "heavy" else p for p in campaign.passages]
    case = TrackCase(replace(campaign, passages=tuple(swapped)))
    assert (
        case.mismatched_trains == ("heavy",)
        and len([n for n in case.notes if "correlation with the simulation of heavy" in n]) == 2
    )
    at_file = {n.name: n.mean for n in case.nuisances}
    tolerances = np.diag([n.sd**2 for n in case.nuisances])
    common = {"values": at_file, "covariance": tolerances, "jacobian": {}}  # no derivatives: no local change
    fit = SimpleNamespace(level={"passage": 0.1}, white=[], candidates=(), **common)
    verdict, _ = assess(Search(case), fit, ())
    assert verdict.answer == "unknown" and "heavy" in verdict.reason
    where = locate(case, None, cause=verdict.cause)
    assert where.frame == "train" and where.train == "heavy"
    one = [p for p in campaign.passages if p.train == "light"] + [p for p in swapped if p.train == "heavy"][:1]
    assert (
        TrackCase(replace(campaign, passages=tuple(one))).mismatched_trains == ()
    )  # a single passage may be that of another train
    intact = [replace(p, name=f"{p.name} again") for p in campaign.passages if p.train == "heavy"][:1]
    most = TrackCase(replace(campaign, passages=(*swapped, *intact)))
    assert most.mismatched_trains == (
        "heavy",
    )  # a polygon that lifts its wheels shows at some speeds and not at others


def test_passages_left_out_because_of_their_axles_count_as_unlike_the_vehicle_file(campaign):
    """Impacts of a large flat are counted as axles: none of the three passages of a train could be compared."""
    light = tuple(p for p in campaign.passages if p.train == "light")
    for contradicted, expected in ((("heavy",) * 2, ("heavy",)), (("heavy",), ()), (("light",), ())):
        case = TrackCase(replace(campaign, passages=light, contradicted_trains=contradicted))
        assert case.aligned_passages and case.mismatched_trains == expected


def test_without_any_train_like_its_simulation_the_answer_is_not_none(campaign):
    """A dip of a millimetre, or wrong files of all vehicles: hammer tests alone agree, and no train was compared."""
    light, heavy = (next(p.vehicle for p in campaign.passages if p.train == t) for t in ("light", "heavy"))
    swapped = [replace(p, vehicle=heavy if p.train == "light" else light) for p in campaign.passages]
    case = TrackCase(replace(campaign, passages=tuple(swapped)))
    assert not case.aligned_passages and case.no_train_matches and case.mismatched_trains == ()
    diagnosis = diagnose(case)
    assert diagnosis.verdict.answer == "unknown" and "no_train_matches" in diagnosis.verdict.trail
    assert diagnosis.where is None and sentence(diagnosis).startswith("No passage resembles the simulation")
    assert locate(case, None, cause="all trains") is None  # with any residual of the hammer tests
    single = TrackCase(replace(campaign, passages=tuple(swapped[:1])))
    assert not single.aligned_passages and not single.no_train_matches  # it may be another train


def test_a_train_that_cannot_be_compared_is_not_reported_as_different(intact, monkeypatch):
    """Recordings that end too early or have too few samples give no information on the wheels: no alarm."""
    plain = passage_observation.observe_passage

    def cut_short(passage, *more):
        if passage.train == "heavy":
            raise SimulationError("the train lies outside the recording")
        return plain(passage, *more)

    monkeypatch.setattr(passage_observation, "observe_passage", cut_short)
    case = TrackCase(intact[0].campaign, families=())
    assert len([n for n in case.notes if "outside the recording" in n]) == 2
    assert case.aligned_passages and case.mismatched_trains == ()


@pytest.mark.parametrize(
    ("behind", "offered", "rivals"),
    [(2.9, [3, 1], {3: (1, 6), 1: (3, 6)}), (3.1, [3], {3: (1, 6)}), (5.9, [3], {3: (1, 6)}), (6.1, [3], {3: ()})],
)
def test_a_wheel_with_nearly_as_strong_impacts_is_a_candidate_as_well(intact, monkeypatch, behind, offered, rivals):
    """The fitted band may distinguish wheels that impacts do not: one of three rough wheels preceded the one with the
    flat. What the impacts cannot distinguish by 6 nats is stated."""
    case, _ = intact
    (made, *_), radius = case.aligned_passages.values(), 0.46
    train, phases = made.conditions["train"], ((made.name, 0.5),)
    nats = {2: 20.0, 0: 20.0 - behind, 5: 20.0 - behind}
    evidence = [FlatEvidence(n, train, wheel, radius, phases) for wheel, n in nats.items()]
    monkeypatch.setattr("turnout.mismatch.turnout.candidates.wheel_flats.flat_evidence", lambda case: evidence)
    monkeypatch.setattr(
        "turnout.mismatch.turnout.candidates.wheel_flats._fit_flat", lambda case, fit, impacts: (0.03, phases, 5.0)
    )
    found = flat_candidates(case, SimpleNamespace(candidates=()))
    assert [c.where["axle"] for c in found] == offered
    assert {c.where["axle"]: c.site.rival_axles for c in found} == rivals
    assert found[0].in_words.startswith(f"wheel flat at wheelset {' or '.join(map(str, (3, *rivals[3])))} of ")
    heavy, flat = (SimpleNamespace(where={"train": train, **more}) for more in ({}, {"axle": 3}))
    beside = flat_candidates(case, SimpleNamespace(candidates=(heavy,)))
    assert [c.where["axle"] for c in beside] == offered  # heavy wheels do not exclude a flat on one of them
    assert flat_candidates(case, SimpleNamespace(candidates=(flat,))) == ()
