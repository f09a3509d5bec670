"""Recordings of a campaign as observations of a case, with the reasons why some are rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import passage_observation, receptance_observation
from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput, PassageInput
from turnout.mismatch.turnout.chair_scatter import chair_errors, with_chair_errors
from turnout.mismatch.turnout.disturbances import Disturbance, disturbances
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.lifting_chairs import count_alike, lifting_chairs, with_lifting_error
from turnout.mismatch.turnout.passage_alignment import PassageAligner, fit_surface
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Values
from turnout.mismatch.turnout.priors import ALIGNMENT, CASE, RECEPTANCE
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.saturation import SaturationLimit, raw_peak, saturated_channels, without_saturated
from turnout.mismatch.turnout.site import Site, site_of
from turnout.mismatch.turnout.track_parameters import track_with, with_rail
from turnout.mismatch.turnout.wheel_roughness import wheel_modes
from turnout.simulate.sensor import Sensor


@dataclass(frozen=True)
class CaseData:
    """What a case is made of; nothing of it changes in a diagnosis.

    Attributes
    ----------
    campaign : CampaignInput
        Without the saturated sensors.
    settings : MismatchSettings
    site : Site
        The track about sensors and impacts as filed, with its nuisances.
    frf_pairs : mapping
        Response channels of the hammer tests, by name.
    aligned_passages : mapping
        Passages that are used, by name.
    observations, reserved : tuple of Observation
        Those that are fitted, and those that no fit uses.
    start_values : mapping
        Nuisances of track, sensors and running surface where fits start.
    saturated : mapping
        Sensor -> estimated limit of its channel, for sensors that are not used.
    unmatched : tuple of PassageInput
        Passages that do not correlate with the simulation of their train.
    disturbed : tuple of Disturbance
        Passages in which another source shakes the sensors.
    notes : tuple of str
        What is not used, and why.
    """

    campaign: CampaignInput
    settings: MismatchSettings
    site: Site
    frf_pairs: Mapping[str, FrfPair]
    aligned_passages: Mapping[str, AlignedPassage]
    observations: tuple[Observation, ...]
    reserved: tuple[Observation, ...] = ()
    start_values: Mapping[str, float] = field(default_factory=dict)
    saturated: Mapping[str, SaturationLimit] = field(default_factory=dict)
    unmatched: tuple[PassageInput, ...] = ()
    disturbed: tuple[Disturbance, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def mismatched_trains(self) -> tuple[str, ...]:
        """Trains of which more passages contradict their vehicle file than match it, from two passages on.

        Either another train came, or the trains of this type differ. Passages that were disturbed or could not be
        simulated do not count.
        """
        unmatched = Counter(p.train for p in self.unmatched if p.train)
        matched = Counter(aligned.conditions["train"] for aligned in self.aligned_passages.values())
        disturbed_names = {d.name for d in self.disturbed}
        disturbed_trains = {p.train for p in self.campaign.passages if p.name in disturbed_names}
        return tuple(
            t
            for t, n in unmatched.items()
            if matched and n + matched[t] > 1 and n > matched[t] and t not in disturbed_trains
        )

    @property
    def measured_range(self) -> tuple[float, float]:
        """First and last position of sensors and impacts [m]."""
        positions = self.campaign.positions()
        return min(positions), max(positions)

    def band_peak(self, channel: str) -> float:
        """Largest value of a channel in the fitted passages, within their band; 0 where it has none. [m/s²]

        Parameters
        ----------
        channel : str
            Name of a channel.

        Returns
        -------
        float
        """
        peaks = [0.0]
        for o in self.observations:
            aligned = self.aligned_passages.get(o.name)
            names = [s.name for s in aligned.sensors] if aligned else []
            if channel in names:
                peaks.append(float(np.max(np.abs(o.data.reshape(len(names), -1)[names.index(channel)]))))
        return max(peaks)

    def raw_peak(self, channel: str) -> float:
        """Largest value of a channel at its full sampling rate, reserved recordings included. [m/s²]

        A planned campaign has no such signals: its ``band_peak``.

        Parameters
        ----------
        channel : str
            Name of a channel.

        Returns
        -------
        float
        """
        return raw_peak(self.campaign, channel) or self.band_peak(channel)


def case_data(campaign: CampaignInput, settings: MismatchSettings, solver: Track1D) -> tuple[CaseData, Predictor]:
    """Observations of a campaign, and the predictor of its recordings.

    The rail is first fitted to the hammer tests. On that rail passages are simulated, to align the recorded ones and
    to compute their errors.

    Parameters
    ----------
    campaign : CampaignInput
    settings : MismatchSettings
    solver : Track1D
        Settings of the simulation of passages.

    Returns
    -------
    data : CaseData
    predictor : Predictor
        With the rail that the hammer tests give.

    Raises
    ------
    SimulationError
        No recording can be used, or all of them are reserved.
    """
    saturated = saturated_channels(campaign, settings.threshold)
    campaign = without_saturated(campaign, saturated)
    site = site_of(campaign)
    tests = observe_tests(campaign, settings.pair_tolerance, saturated)
    predictor = Predictor(site, solver).with_recordings(tests.frf_pairs, {})
    predictor, tests, start_values = _fit_hammer_start(predictor, tests, campaign.reserved)
    predictor = predictor.recentre(start_values)
    passages = _observe_passages(campaign, settings.materiality, predictor, start_values)
    recordings = [*tests.observations, *passages.observations]
    notes = (*tests.notes, *passages.notes)
    if not recordings:
        raise SimulationError("nothing to diagnose: " + "; ".join(notes))
    data = CaseData(
        campaign,
        settings,
        site,
        tests.frf_pairs,
        passages.aligned,
        tuple(o for name, o in recordings if name not in campaign.reserved),
        tuple(o for name, o in recordings if name in campaign.reserved),
        {**start_values, **passages.surface_values},
        saturated,
        passages.unmatched,
        passages.disturbed,
        notes,
    )
    if not data.observations:
        raise SimulationError("every recording is reserved for the verification: nothing is left to fit.")
    return data, predictor.with_recordings(data.frf_pairs, data.aligned_passages)


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
    pairs, observations, notes = {}, [], []
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
    return ObservedTests(pairs, tuple(observations), tuple(notes))


def _loose_sensors(test: HammerInput, sensors: Sequence[Sensor]) -> list[Sensor]:
    """Accelerometers of a hammer test that are no installed sensors."""
    installed, accelerometers = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in installed and channel.position is not None:
                accelerometers[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return list(accelerometers.values())


def _fit_hammer_start(
    predictor: Predictor, tests: ObservedTests, reserved: Collection[str]
) -> tuple[Predictor, ObservedTests, dict[str, float]]:
    """Predictor, tests, and nuisances of track and sensors from the tests alone, the start of all fits.

    {} without a test. Chairs of a blade that open under impacts are simulated on the track of the file, then on that
    of the fit.
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
    lifting = lifting_chairs(track_with(with_rail(zone, values).turnout.track_of("main"), zone, values), pairs)
    if lifting is None:
        return predictor, tests
    errors = chair_errors(predictor, values, pairs)
    observations = []
    for (name, o), pair in zip(tests.observations, pairs):
        n = count_alike(pair, pairs, reserved)
        lifted = with_lifting_error(o, pair, lifting.change(pair, ()), n)
        observations.append((name, with_chair_errors(lifted, pair, errors[pair.name], n)))
    return predictor.with_lifting(lifting), replace(tests, observations=tuple(observations))


@dataclass(frozen=True)
class ObservedPassages:
    """Passages as ``observations`` (name, Observation), with those that are not used, and notes.

    ``surface_values`` are the nuisances of the running surface with which they were aligned.
    """

    aligned: Mapping[str, AlignedPassage]
    observations: tuple[tuple[str, Observation], ...]
    unmatched: tuple[PassageInput, ...]
    disturbed: tuple[Disturbance, ...]
    surface_values: Mapping[str, float]
    notes: tuple[str, ...]


def _observe_passages(
    campaign: CampaignInput, tolerance: float, predictor: Predictor, start_values: Values
) -> ObservedPassages:
    """Observations of the passages that correlate with the simulation of their train and are not disturbed."""
    if not campaign.passages:
        return ObservedPassages({}, (), (), (), {}, ())
    aligner = PassageAligner(campaign, predictor)
    values = {**{n.name: 0.0 for n in predictor.site.nuisances()}, **start_values}
    surface_values = fit_surface(aligner, values)
    values |= surface_values
    aligned, observations, unmatched, notes = {}, [], {}, []
    for passage in campaign.passages:
        outcome = _observe_passage(passage, aligner, values, tolerance)
        if isinstance(outcome, _Unmatched):
            unmatched[passage.name] = outcome
        if isinstance(outcome, (str, _Unmatched)):
            notes.append(f"passage {passage.name}: {outcome}")
            continue
        aligned[passage.name], observation = outcome
        owned = dict.fromkeys((n.name for n in passage_observation.passage_nuisances(passage)), 0.0)
        observations.append(
            (passage.name, with_errors(predictor, {**values, **owned}, aligned[passage.name], observation))
        )
    timed = {name: u.aligned for name, u in unmatched.items() if u.aligned is not None}
    disturbed = tuple(disturbances(aligned, timed))
    rejected = {d.name: d for d in disturbed if d.name in aligned}
    if len(observations) - len(rejected) < 2:  # too few would remain: all are used
        rejected = {}
    notes += [
        f"passage {name}: not used, {d.excess:.0f} dB louder {d.when} its train than the others"
        for name, d in rejected.items()
    ]
    return ObservedPassages(
        {name: a for name, a in aligned.items() if name not in rejected},
        tuple((name, o) for name, o in observations if name not in rejected),
        tuple(u.passage for u in unmatched.values()),
        disturbed,
        surface_values,
        tuple(notes),
    )


@dataclass(frozen=True)
class _Unmatched:
    """A passage that does not correlate with the simulation; ``aligned`` where its time is certain all the same."""

    passage: PassageInput
    correlation: float
    aligned: AlignedPassage | None

    def __str__(self) -> str:
        return (
            f"likeness {self.correlation:.2f} with the simulation of {self.passage.train or 'its train'}; "
            "wrong vehicle file, wrong sensor places or another turnout"
        )


def _observe_passage(
    passage: PassageInput, aligner: PassageAligner, values: Values, tolerance: float
) -> tuple[AlignedPassage, Observation] | _Unmatched | str:
    """The aligned passage and its observation without error modes, or the reason why it cannot be used."""
    sensors = aligner.campaign.sensors_of(passage)
    if not sensors:
        return "none of the sensors recorded it"
    try:
        reference, speed, correlation = aligner.align(values, passage)
    except SimulationError as error:
        return f"cannot be simulated: {error}"
    if correlation < ALIGNMENT.min_correlation:
        is_timed = correlation > CASE.min_timed_correlation
        timed = AlignedPassage(passage.name, passage, sensors, np.zeros(0), reference, speed) if is_timed else None
        return _Unmatched(passage, correlation, timed)
    try:
        aligned, observation = passage_observation.observe_passage(passage, sensors, reference, speed, tolerance)
    except SimulationError as error:
        return str(error)
    in_switch = aligner.predictor.track(passage.route).blade is not None
    return aligned, passage_observation.with_chatter(observation) if in_switch else observation


def with_errors(predictor: Predictor, values: Values, aligned: AlignedPassage, observation: Observation) -> Observation:
    """The observation with the error modes of its passage: track and wheels as ``values`` give them.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances, with those that the passage owns.
    aligned : AlignedPassage
        The passage.
    observation : Observation
        Of that passage.

    Returns
    -------
    Observation
        With the modes of wheels and amplifiers.
    """
    modes = (
        passage_observation.coupling_modes(aligned, observation.data).astype(np.float32),
        wheel_modes(predictor, values, aligned, observation.sigma),
    )
    return replace(observation, modes=np.column_stack(modes))
