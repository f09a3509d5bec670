"""Hammer tests of a campaign as observations of a case, with the reasons why some are rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput
from turnout.mismatch.turnout.chair_scatter import chair_errors, with_chair_errors
from turnout.mismatch.turnout.channel_identity import Comparison
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.lifting_chairs import count_alike, lifting_chairs, with_lifting_error
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Values
from turnout.mismatch.turnout.priors import CASE, RECEPTANCE
from turnout.mismatch.turnout.rail_parameters import with_rail
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.saturation import SaturationLimit
from turnout.mismatch.turnout.toe_position import with_toe
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.reasons import REASONS
from turnout.simulate.sensor import Sensor


@dataclass(frozen=True)
class ObservedTests:
    """Hammer tests as ``observations`` (name of the test, Observation), with their pairs and notes."""

    frf_pairs: Mapping[str, FrfPair]
    observations: tuple[tuple[str, Observation], ...]
    notes: tuple[str, ...]


def observe_tests(
    campaign: CampaignInput, tolerance: float, saturated: Mapping[str, SaturationLimit] | None = None
) -> ObservedTests:
    """Observation of every response channel of a hammer test with accepted impacts.

    Parameters
    ----------
    campaign : CampaignInput
    tolerance : float
        Relative error of a receptance by hammer, calibration and mounting. [-]
    saturated : mapping or None
        Sensors that are not used.

    Returns
    -------
    ObservedTests
    """
    pairs, observations, notes, rejected_channels = {}, [], [], []
    for test in campaign.hammer:
        sensors = [
            s
            for s in (*campaign.sensors, *_loose_sensors(test, campaign.sensors))
            if s.name not in (saturated or {}) and abs(s.place - test.place) <= CASE.max_hammer_distance
        ]
        pairs_of_test = receptance_observation.pairs_of_test(test, sensors, tolerance)
        if not pairs_of_test:
            notes.append(
                f"hammer test {test.name}: no channel within {CASE.max_hammer_distance:g} m with "
                f"{RECEPTANCE.min_impacts} accepted impacts"
            )
        for pair, observation in pairs_of_test:
            pairs[pair.name] = pair
            observations.append((test.name, observation))
        unused = {s.name for s in sensors} - {pair.channel for pair, _ in pairs_of_test}
        rejected_channels += [(c, r) for c in sorted(unused) if (r := _fault_of_channel(test, c))]
    notes += [
        f"channel {c} is not used in {n} of {len(campaign.hammer)} hammer tests ({r}: {REASONS[r]})"
        for (c, r), n in Counter(rejected_channels).items()
    ]
    return ObservedTests(pairs, tuple(observations), tuple(notes))


def _fault_of_channel(test: HammerInput, channel: str) -> str | None:
    """The reason of most rejections of the impacts of a test that concern this channel, None without any."""
    reasons = Counter(r.reason for i in test.impacts(channel) for r in i.rejections if r.channel == channel)
    return reasons.most_common(1)[0][0] if reasons else None


def compare_channels(predictor: Predictor, tests: ObservedTests) -> list[Comparison]:
    """Correlation of each channel of a hammer test with the simulation at each of its sensors, on the track as filed.

    Parameters
    ----------
    predictor : Predictor
        Of the site as filed.
    tests : ObservedTests
        Hammer tests of the campaign.

    Returns
    -------
    list of Comparison
        One per test.
    """
    values = {n.name: n.mean for n in predictor.site.shared_nuisances()}
    observations = {o.name: o for _, o in tests.observations}
    pairs_by_test: dict[str, list[FrfPair]] = {}
    for pair in tests.frf_pairs.values():
        pairs_by_test.setdefault(pair.test.name, []).append(pair)
    comparisons = []
    for pairs in pairs_by_test.values():
        names = tuple(p.channel for p in pairs)
        correlations, ratios = np.zeros((len(pairs), len(pairs), 1)), np.zeros(len(pairs))
        for i, measured in enumerate(pairs):
            at_sensors = [
                replace(measured, name=str(j), channel=p.channel, sensor=p.sensor) for j, p in enumerate(pairs)
            ]
            observation = observations[measured.name]
            trials = predictor.with_recordings({**tests.frf_pairs, **{p.name: p for p in at_sensors}}, {})
            simulated = trials.predict(values, (), [replace(observation, name=p.name) for p in at_sensors])
            for j, row in enumerate(simulated):
                correlations[i, j] = _correlation(measured, observation.data, row)
            ratios[i] = 1.0 / max(np.median(np.hypot(*simulated[i].reshape(2, -1))), 1e-12)
        comparisons.append(Comparison(names, names, correlations, ratios))
    return comparisons


def mean_correlation(predictor: Predictor, tests: ObservedTests, test: HammerInput, position: float) -> float:
    """Mean correlation of the channels of a test with the simulation of impacts at a position, on the track as filed.

    Parameters
    ----------
    predictor : Predictor
        Of the site as filed.
    tests : ObservedTests
        Hammer tests of the campaign.
    test : HammerInput
        One of them.
    position : float
        Of the impacts. [m]

    Returns
    -------
    float
    """
    return float(np.mean(correlations_at(predictor, tests, test, position)))


def correlations_at(predictor: Predictor, tests: ObservedTests, test: HammerInput, position: float) -> np.ndarray:
    """Correlation of each channel of a test with the simulation of impacts at a position, on the track as filed.

    Parameters
    ----------
    predictor : Predictor
        Of the site as filed.
    tests : ObservedTests
        Hammer tests of the campaign.
    test : HammerInput
        One of them.
    position : float
        Of the impacts. [m]

    Returns
    -------
    (n_channel,) array of float
    """
    values = {n.name: n.mean for n in predictor.site.shared_nuisances()}
    moved = replace(test, place=position)
    pairs = {n: replace(p, test=moved) for n, p in tests.frf_pairs.items() if p.test.name == test.name}
    observations = [o for _, o in tests.observations if o.name in pairs]
    trials = predictor.with_recordings({**tests.frf_pairs, **pairs}, {})
    simulated = trials.predict(values, (), observations)
    return np.array([_correlation(pairs[o.name], o.data, row) for o, row in zip(observations, simulated)])


def _correlation(pair: FrfPair, measured: np.ndarray, simulated: np.ndarray) -> float:
    """Correlation of two receptances, both over the magnitude of the measured one."""
    size = np.tile(pair.size, 2)
    a, b = measured * size, simulated * size
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-30))


def _loose_sensors(test: HammerInput, sensors: Sequence[Sensor]) -> list[Sensor]:
    """Accelerometers of a hammer test that are no installed sensors."""
    installed, accelerometers = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in installed and channel.position is not None:
                accelerometers[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return list(accelerometers.values())


def fit_hammer_start(
    predictor: Predictor, tests: ObservedTests, reserved: Collection[str]
) -> tuple[Predictor, ObservedTests, dict[str, float]]:
    """Fit of track and sensors to the hammer tests alone, the start of all fits.

    Chairs of a blade that open under impacts are simulated on the track of the file, then on that of the fit.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    tests : ObservedTests
        Hammer tests of the campaign.
    reserved : collection of str
        Names of the tests that no fit uses.

    Returns
    -------
    predictor : Predictor
        With the chairs that open.
    tests : ObservedTests
        With the errors of these chairs.
    values : dict
        Nuisances of track and sensors by name; empty without a test.
    """
    nuisances = predictor.site.shared_nuisances()
    values = {n.name: n.mean for n in nuisances}
    if all(name in reserved for name, _ in tests.observations):
        return predictor, tests, {}
    predictor, with_errors_of_chairs = _with_lifting_chairs(predictor, tests, values, reserved)
    for last in [False, True] if predictor.lifting else [True]:
        fitted = [o for name, o in with_errors_of_chairs.observations if name not in reserved]
        values = HammerCase(predictor, fitted, nuisances).fit_from_priors()
        if not last:
            predictor, with_errors_of_chairs = _with_lifting_chairs(predictor, tests, values, reserved)
    return predictor, with_errors_of_chairs, values


def _with_lifting_chairs(
    predictor: Predictor, tests: ObservedTests, values: Values, reserved: Collection[str]
) -> tuple[Predictor, ObservedTests]:
    """Predictor and tests with chairs that open and differ, on the track of ``values``; the same without chairs."""
    zone, pairs = predictor.site.nominal, list(tests.frf_pairs.values())
    track = track_with(with_rail(zone, values).turnout.track_of("main"), zone, values)
    lifting = lifting_chairs(with_toe(track, values), pairs)
    if lifting is None:
        return predictor, tests
    errors = chair_errors(predictor, values, pairs)
    observations = []
    for (name, o), pair in zip(tests.observations, pairs):
        n = count_alike(pair, pairs, reserved)
        lifted = with_lifting_error(o, pair, lifting.change(pair, ()), n)
        observations.append((name, with_chair_errors(lifted, pair, errors[pair.name], n)))
    return predictor.with_lifting(lifting), replace(tests, observations=tuple(observations))
