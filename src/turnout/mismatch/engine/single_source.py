"""Single sources: the one recording, position of impacts or sensor without which a name has no support."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.cross_validation import effect_energy, effect_signature, sums_by_sensor
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search

REPETITION = "the repetition of impacts at the same positions"


def single_source(
    search: Search, fit: Fit, candidate: Candidate, gain: float, by_condition: Mapping[str, float]
) -> str:
    """The condition whose gain alone supports a name while the gain of all others together does not.

    "" if there is none.

    A real effect shows wherever it acts. A gain in one recording that others do not share belongs to that recording, if
    at least two others show the effect with half its energy. Two are needed, since nuisances may absorb the gain of
    one. Trains are exempt: speed and roughness differ at each passage.

    No held-out condition shows the prior penalty that nuisances pay to imitate an effect. If that penalty is most of
    the ``gain``, and all other conditions support the name, no single recording or position is the source.

    Impacts at one position are one source, however often they are repeated. They share the fittings, the twist of the
    rail and the mark on it. Passages share none of these faults: if they are enough for a name without any impact, they
    are a second source.
    What other impacts lose by the name is a question of its own (``is_contradicted``).

    The error of a receptance is that of the model, so it is the same at each visit. Tests that repeat impacts at one
    position therefore count as one, so far as the effect changes them alike. Where it differs between them, as an
    effect of the temperature does, that error cannot imitate the difference. A name that needs each of them as evidence
    of its own rests on the repetition.

    Parameters
    ----------
    search : Search
    fit : Fit
        It has ``candidate`` in it.
    candidate : Candidate
    gain : float
        Of all conditions together. [nats]
    by_condition : dict
        Condition -> gain when it is left out. [nats]
    """
    case, threshold = search.case, search.settings.threshold
    hammer_positions = case.hammer_positions()
    if position := _single_hammer_position(hammer_positions, gain, by_condition, threshold):
        return position
    if _rests_on_repetition(case, fit, candidate, gain, by_condition, threshold):
        return REPETITION
    strongest = max(by_condition, key=lambda c: by_condition[c], default="")
    if not strongest or by_condition[strongest] <= threshold or "train" in candidate.where:
        return ""
    other_gain = sum(by_condition.values()) - by_condition[strongest]
    if other_gain >= threshold or _is_mostly_penalty(gain, by_condition[strongest], other_gain):
        return ""
    energies = effect_energy(case, fit, candidate)
    min_energy = THRESHOLDS.min_energy_ratio * energies.pop(strongest, np.inf)
    return (
        strongest
        if sum(energy >= min_energy for energy in energies.values()) >= THRESHOLDS.min_confirming_recordings
        else ""
    )


def impact_repetitions(hammer_positions: Mapping[str, float]) -> dict[str, int]:
    """Number of tests with impacts at the same position.

    Parameters
    ----------
    hammer_positions : mapping
        Condition -> position of its impacts. [m]

    Returns
    -------
    dict of str to int
        For each condition, at least 1.

    Examples
    --------
    >>> impact_repetitions({"2.1 m in March": 2.1, "4.2 m in March": 4.2, "2.1 m in May": 2.1})
    {'2.1 m in March': 2, '4.2 m in March': 1, '2.1 m in May': 2}
    """
    counts = Counter(hammer_positions.values())
    return {condition: counts[position] for condition, position in hammer_positions.items()}


def _rests_on_repetition(
    case: Case, fit: Fit, candidate: Candidate, gain: float, by_condition: Mapping[str, float], threshold: float
) -> bool:
    """Whether the gain is below the threshold if the tests at each position of impacts count as one."""
    hammer_positions = case.hammer_positions()
    repetitions = impact_repetitions({c: p for c, p in hammer_positions.items() if c in by_condition})
    shares = {condition: 1.0 / n for condition, n in repetitions.items()}
    if not _counted_gain(gain, by_condition, shares) < threshold <= gain:
        return False
    changes = case.changes_by_line(effect_signature(case, fit, candidate))
    for position in {hammer_positions[condition] for condition in changes}:
        repeated = [c for c in changes if hammer_positions[c] == position]
        share = share_without_repetition(np.array([changes[c] for c in repeated]))
        shares |= dict.fromkeys(repeated, share)
    return _counted_gain(gain, by_condition, shares) < threshold


def _counted_gain(gain: float, by_condition: Mapping[str, float], shares: Mapping[str, float]) -> float:
    """The gain if of each repeated test only this share counts [nats]."""
    return gain - sum((1.0 - share) * by_condition[condition] for condition, share in shares.items())


def share_without_repetition(changes: np.ndarray) -> float:
    r"""Share of the evidence of repeated tests that remains if their error is the same in all of them.

    .. math:: 1 - (n - 1)\, |\bar s|^2 / \sum_k |s_k|^2

    with the change :math:`s_k` of test k and their mean: what they have in common counts once, what differs counts in
    full.

    Parameters
    ----------
    changes : (n, m) array of float
        Change of each test by the effect, over its error; nan where it has no such line.

    Returns
    -------
    float
        1/n for equal changes, 1 if they cancel each other, and 1/n without a common line.

    Examples
    --------
    >>> [share_without_repetition(np.array(rows)) for rows in ([[3.0], [3.0]], [[3.0], [-3.0]], [[3.0], [0.0]])]
    [0.5, 1.0, 0.75]
    """
    n, common = len(changes), changes[:, np.all(np.isfinite(changes), axis=0)]
    energy = float(np.sum(np.square(common)))
    return 1.0 - (n - 1) * float(np.sum(np.square(common.mean(axis=0)))) / energy if energy else 1.0 / n


def _single_hammer_position(
    hammer_positions: Mapping[str, float], gain: float, by_condition: Mapping[str, float], threshold: float
) -> str:
    """Position, in words, whose impacts alone support half of a name or more, while all others do not.

    "" if there is none, or if recordings without impacts support the name. Half of a name is enough to confirm one:
    the threshold of a name is for a search among many effects, and others need to confirm only the one that was found.
    """
    gains: dict[float, float] = {}
    for condition, condition_gain in by_condition.items():
        if condition in hammer_positions:
            gains[hammer_positions[condition]] = gains.get(hammer_positions[condition], 0.0) + condition_gain
    if len(gains) < THRESHOLDS.min_hammer_positions:
        return ""
    strongest = max(gains, key=lambda position: gains[position])
    other_gain = sum(by_condition.values()) - gains[strongest]
    gain_without_impacts = sum(g for condition, g in by_condition.items() if condition not in hammer_positions)
    if gain_without_impacts >= threshold:
        return ""
    if _is_mostly_penalty(gain, gains[strongest], other_gain):
        return ""
    is_alone = gains[strongest] > THRESHOLDS.min_confirmation * threshold > other_gain
    return f"all impacts at {strongest:g} m" if is_alone else ""


def _is_mostly_penalty(gain: float, strongest_gain: float, other_gain: float) -> bool:
    """Whether most of a gain is the prior penalty of nuisances, and the conditions beside the strongest support it."""
    return other_gain > 0.0 and strongest_gain + other_gain < THRESHOLDS.min_held_out_share * gain


def single_sensor(search: Search, without: Fit, score: Score) -> str:
    """The sensor that alone supports an effect of track or train, though others would show it at least half as plainly.

    What only one channel shows belongs to this channel. A real effect gains where its change has energy. The test is
    made if the change has half as much energy in all other channels together as in that one. They confirm a name with
    half of the evidence that it needs, as other positions confirm that of impacts at one position. No sensor shows the
    prior penalty that nuisances pay to imitate an effect: if that is most of the gain, no sensor is the only source.

    Parameters
    ----------
    search : Search
    without : Fit
        The fit without the candidate.
    score : Score
        The candidate, with its fit.

    Returns
    -------
    str
        "the sensor NAME", or "" if there is none. An effect of a sensor has none.
    """
    fit, candidate, threshold = score.fit, score.candidate, search.settings.threshold
    if "sensor" in candidate.where:
        return ""
    gains: dict[str, float] = {}
    energies: dict[str, float] = {}
    changes = effect_signature(search.case, fit, candidate)
    for o, change, before, after in zip(search.case.observations, changes, without.predictions, fit.predictions):
        weight = 0.5 * o.effective / fit.scale[o.data_type]
        squares = (np.square(o.whiten(o.data - p)) for p in (before, after))
        lost, left = (sums_by_sensor(o, weight * s) for s in squares)
        for sensor, energy in sums_by_sensor(o, weight * np.square(change)).items():
            gains[sensor] = gains.get(sensor, 0.0) + lost[sensor] - left[sensor]
            energies[sensor] = energies.get(sensor, 0.0) + energy
    strongest = max(gains, key=lambda sensor: gains[sensor], default="")
    if not strongest or sum(gains.values()) < THRESHOLDS.min_held_out_share * score.gain:
        return ""
    gain, energy = gains.pop(strongest), energies.pop(strongest)
    is_alone = gain > THRESHOLDS.min_confirmation * threshold > sum(gains.values())
    would_show = sum(energies.values()) >= THRESHOLDS.min_energy_ratio * energy
    return f"the sensor {strongest}" if is_alone and would_show else ""
