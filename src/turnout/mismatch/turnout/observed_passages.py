"""Passages of a campaign as observations of a case, with the reasons why some are rejected."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import passage_observation
from turnout.mismatch.turnout.amplitude_scale import wrong_scale
from turnout.mismatch.turnout.campaign import CampaignInput, PassageInput
from turnout.mismatch.turnout.channel_identity import channel_faults
from turnout.mismatch.turnout.disturbances import Disturbance, disturbances
from turnout.mismatch.turnout.layout_fault import LayoutFault
from turnout.mismatch.turnout.passage_alignment import PassageAligner, fit_surface
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Values
from turnout.mismatch.turnout.priors import ALIGNMENT, CASE
from turnout.mismatch.turnout.wheel_roughness import wheel_modes


@dataclass(frozen=True)
class ObservedPassages:
    """Passages as ``observations`` (name, Observation), with those that are not used, and notes.

    ``surface_values`` are the nuisances of the running surface with which they were aligned. ``layout_faults`` are
    channels that do not record their sensor, and a wrong unit; nothing else holds where there is one.
    """

    aligned: Mapping[str, AlignedPassage]
    observations: tuple[tuple[str, Observation], ...]
    unmatched: tuple[PassageInput, ...]
    disturbed: tuple[Disturbance, ...]
    surface_values: Mapping[str, float]
    notes: tuple[str, ...]
    layout_faults: tuple[LayoutFault, ...] = ()


def observe_passages(
    campaign: CampaignInput, tolerance: float, predictor: Predictor, start_values: Values, upright: Container[str]
) -> ObservedPassages:
    """Observations of the passages that correlate with the simulation of their train and are not disturbed.

    Parameters
    ----------
    campaign : CampaignInput
    tolerance : float
        Share of the local amplitude below which a difference causes no action. [-]
    predictor : Predictor
        With the rail that the hammer tests give.
    start_values : mapping
        Nuisances of track and sensors from the hammer tests, by name.
    upright : container of str
        Channels that have the right polarity in the hammer tests.

    Returns
    -------
    ObservedPassages
    """
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
        f"passage {name}: not used, its vibration {d.when} the train is {d.excess:.0f} dB above that of other passages"
        for name, d in rejected.items()
    ]
    comparisons = list(filter(None, map(aligner.comparison, campaign.passages)))
    return ObservedPassages(
        {name: a for name, a in aligned.items() if name not in rejected},
        tuple((name, o) for name, o in observations if name not in rejected),
        tuple(u.passage for u in unmatched.values()),
        disturbed,
        surface_values,
        tuple(notes),
        (
            channel_faults("passages", comparisons, upright),
            wrong_scale("passages", comparisons if start_values else ()),
        ),
    )


@dataclass(frozen=True)
class _Unmatched:
    """A passage that does not correlate with the simulation; ``aligned`` where its time is certain all the same."""

    passage: PassageInput
    correlation: float
    aligned: AlignedPassage | None

    def __str__(self) -> str:
        return (
            f"not used, its correlation with the simulation of {self.passage.train or 'its train'} is "
            f"{self.correlation:.2f}, and {ALIGNMENT.min_correlation:g} is needed; the vehicle file, the positions of "
            "sensors or the turnout may be wrong"
        )


def _observe_passage(
    passage: PassageInput, aligner: PassageAligner, values: Values, tolerance: float
) -> tuple[AlignedPassage, Observation] | _Unmatched | str:
    """The aligned passage and its observation without error modes, or the reason why it cannot be used."""
    sensors = aligner.campaign.sensors_of(passage)
    if not sensors:
        return "not used, no sensor recorded it"
    try:
        reference, speed, correlation = aligner.align(values, passage)
    except SimulationError as error:
        return f"not used, it cannot be simulated: {error}"
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
