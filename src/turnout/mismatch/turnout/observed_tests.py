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
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.lifting_chairs import count_alike, lifting_chairs, with_lifting_error
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Values
from turnout.mismatch.turnout.priors import CASE, RECEPTANCE
from turnout.mismatch.turnout.rail_parameters import with_rail
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.saturation import SaturationLimit
from turnout.mismatch.turnout.support_scatter import support_errors
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
    highest = _highest_frequency(campaign)
    for test in campaign.hammer:
        sensors = [
            s
            for s in (*campaign.sensors, *_loose_sensors(test, campaign.sensors))
            if s.name not in (saturated or {}) and abs(s.place - test.place) <= CASE.max_hammer_distance
        ]
        pairs_of_test = receptance_observation.pairs_of_test(test, sensors, tolerance, highest)
        if not pairs_of_test:
            notes.append(
                f"hammer test {test.name}: no channel within {CASE.max_hammer_distance:g} m with "
                f"{RECEPTANCE.min_impacts} accepted impacts{_usual_rejection(test, sensors)}"
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


def _highest_frequency(campaign: CampaignInput) -> float:
    """Highest frequency at which receptances are compared, below the pinned-pinned resonance of the track [Hz].

    There the rail between two sleepers resonates, and hardly anything damps it. Small errors of sleeper positions and
    of the rail change the receptance by more than any tolerance.
    """
    track = campaign.turnout.track
    positions = [s.place for s in campaign.sensors] + [test.place for test in campaign.hammer]
    reach = CASE.max_hammer_distance
    near = track.support[(track.support > min(positions) - reach) & (track.support < max(positions) + reach)]
    if near.size < 2:
        return RECEPTANCE.highest_line
    pinned_pinned = track.rail.pinned_pinned_frequency(float(np.median(np.diff(near))))
    return min(RECEPTANCE.highest_line, RECEPTANCE.pinned_pinned_share * pinned_pinned)


def _fault_of_channel(test: HammerInput, channel: str) -> str | None:
    """The reason of most rejections of the impacts of a test that concern this channel, None without any."""
    reasons = Counter(r.reason for i in test.impacts(channel) for r in i.rejections if r.channel == channel)
    return reasons.most_common(1)[0][0] if reasons else None


def _usual_rejection(test: HammerInput, sensors: Sequence[Sensor]) -> str:
    """How many of all impacts were rejected for the most frequent reason, in words; "" if none was."""
    impacts = [impact for sensor in sensors for impact in test.impacts(sensor.name)]
    reasons = Counter(reason for impact in impacts for reason in {r.reason for r in impact.rejections})
    if not reasons:
        return ""
    reason, n = reasons.most_common(1)[0]
    return f" ({n} of {len(impacts)} rejected, counted for each channel: {reason}, {REASONS[reason]})"


def _loose_sensors(test: HammerInput, sensors: Sequence[Sensor]) -> list[Sensor]:
    """Accelerometers of a hammer test that are no installed sensors."""
    installed, accelerometers = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in installed and channel.position is not None:
                accelerometers[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return list(accelerometers.values())


@dataclass(frozen=True)
class HammerStart:
    """Fit of track and sensors to the hammer tests alone, the start of all fits.

    ``predictor`` has the chairs of a blade that open, and ``tests`` the errors of these chairs. ``values`` are the
    nuisances of track and sensors by name, and ``mean_cost`` minus twice the log probability for each fitted sample
    [nats]: both are empty without a fitted test ({} and None).
    """

    predictor: Predictor
    tests: ObservedTests
    values: dict[str, float]
    mean_cost: float | None


def fit_hammer_start(predictor: Predictor, tests: ObservedTests, reserved: Collection[str]) -> HammerStart:
    """Fit of track and sensors to the hammer tests alone.

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
    HammerStart
    """
    nuisances = predictor.site.shared_nuisances()
    values = {n.name: n.mean for n in nuisances}
    if all(name in reserved for name, _ in tests.observations):
        return HammerStart(predictor, tests, {}, None)
    tests = _with_support_errors(predictor, tests, values, reserved)
    predictor, with_errors_of_chairs = _with_lifting_chairs(predictor, tests, values, reserved)
    for last in [False, True] if predictor.lifting else [True]:
        fitted = [o for name, o in with_errors_of_chairs.observations if name not in reserved]
        fit = HammerCase(predictor, fitted, nuisances).fit_from_priors()
        if not last:
            predictor, with_errors_of_chairs = _with_lifting_chairs(predictor, tests, fit.values, reserved)
    return HammerStart(predictor, with_errors_of_chairs, fit.values, fit.cost / sum(o.data.size for o in fitted))


def _with_support_errors(
    predictor: Predictor, tests: ObservedTests, values: Values, reserved: Collection[str]
) -> ObservedTests:
    """Tests with the errors by single supports beside their positions, on the track of ``values``."""
    pairs = list(tests.frf_pairs.values())
    all_errors = support_errors(predictor, values, [o for _, o in tests.observations])
    observations = [
        (name, o.with_errors(errors, count_alike(pair, pairs, reserved)))
        for (name, o), pair, errors in zip(tests.observations, pairs, all_errors)
    ]
    return replace(tests, observations=tuple(observations))


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
