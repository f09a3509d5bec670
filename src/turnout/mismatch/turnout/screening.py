"""Screening of candidates: estimated change of each prediction, without a simulation, which orders the candidate queue.

A support effect acts as a pseudo-force of the base simulation, and in receptances as an exact change of one link. A dip
is a path that all wheels follow. Effects of the whole track use derivatives of the base fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.observation import Whitened
from turnout.mismatch.turnout import passage_band, receptance_observation
from turnout.mismatch.turnout.added_links import AddedLinks
from turnout.mismatch.turnout.priors import PASSAGE
from turnout.mismatch.turnout.pseudo_forces import PAD, RAIL, SLEEPER, force_responses, support_motion
from turnout.mismatch.turnout.receptance_model import tangent_links
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.physics.hypothesis import SupportMotion
from turnout.physics.term import PhysicsTerm
from turnout.physics.transfer import TransferTerm
from turnout.simulate.blade import is_on_blade
from turnout.simulate.links import links_of

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.predicted_case import PredictedCase
    from turnout.simulate.links import Link

    Starts: TypeAlias = Sequence[tuple[Candidate, int]]  # candidates with the number of one of their starts
    Changes: TypeAlias = dict[tuple[str, int], np.ndarray]  # by key of the candidate and number of the start
    Columns: TypeAlias = dict[tuple[str, int], list[np.ndarray]]  # the same for every observation

TARGETS = {"rail": RAIL, "sleeper": SLEEPER, "pad": PAD}
FIRST_ORDER_TYPES = ("support", "path", "channel")  # column types whose changes are zero where they are not computed


def screen_columns(case: PredictedCase, fit: Fit, observations: Sequence[Observation]) -> Columns:
    """Change of the predictions when a candidate takes one of its starts.

    ``fit`` is of ``observations``, all of the case or some. In single precision; zero columns share one array. A start
    at which the model cannot be simulated has no column.

    Parameters
    ----------
    case : PredictedCase
        The case, its accepted effects fixed.
    fit : Fit
        Of ``observations``.
    observations : sequence of Observation
        All of the case, or some.

    Returns
    -------
    dict
        (key of the candidate, number of the start) -> list of (n,) array, one per observation.
    """
    chosen = _starts_by_column_type(case)
    supports, paths, channels = (chosen[column_type] for column_type in FIRST_ORDER_TYPES)
    exact = chosen["track"]
    if all(o.name in case.frf_pairs for o in observations):  # effects of links have no first order in passages
        single = [(c, k) for c, k in chosen["link"] if len(_links_of(case, c, k)) == 1]
        supports = supports + single
        chosen["first order"] += [(c.key, k) for c, k in single]
        exact = exact + [entry for entry in chosen["link"] if entry not in single]
    blank = [np.zeros(o.data.size, dtype=np.float32) for o in observations]
    columns = {key: list(blank) for key in chosen["first order"]}
    added = AddedLinks(case.predictor, fit.values, case.all_terms(fit), supports)
    for i, o in enumerate(observations):
        if o.name in case.aligned_passages:
            aligned = case.aligned_passages[o.name]
            changes = _support_changes(case, fit, aligned, supports) | _path_changes(case, fit, aligned, paths)
            changes |= _passage_channel_changes(case, fit, o, fit.predictions[i], channels)
        else:
            changes = added.changes(case.frf_pairs[o.name])
            changes |= _pair_channel_changes(case, fit, o, fit.predictions[i], channels)
        for key, column in changes.items():
            columns[key][i] = column.astype(np.float32)
    for c, k in exact:
        with suppress(SimulationError):
            columns[c.key, k] = _whole_track_changes(case, fit, c, k, observations)
    return columns


def _starts_by_column_type(case: PredictedCase) -> dict[str, list]:
    """Column type -> [(candidate, start)]; "first order" -> keys of all ``FIRST_ORDER_TYPES``, in order of the case.

    Without hammer tests, effects of the whole track have a column only if passages have a derivative for them.
    """
    chosen: dict[str, list] = {column_type: [] for column_type in (*FIRST_ORDER_TYPES, "track", "link", "first order")}
    for c in case.candidates:
        for k, start in enumerate(c.starts):
            term = c.term(start)
            if term.column_type in FIRST_ORDER_TYPES:
                chosen["first order"].append((c.key, k))
                chosen[term.column_type].append((c, k))
            elif term.column_type == "link":
                chosen["link"].append((c, k))
            elif term.column_type == "track" and (case.frf_pairs or _has_derivative(term)):
                chosen["track"].append((c, k))
    return chosen


def _links_of(case: PredictedCase, candidate: Candidate, k: int) -> list[Link]:
    """Links that a start of a candidate adds, with the tangents of its ports."""
    terms, track = (candidate.term(candidate.starts[k]),), case.predictor.track()
    return [*links_of(terms, track), *tangent_links(terms, track)]


def _has_derivative(term: PhysicsTerm) -> bool:
    return type(term).nuisance_change is not PhysicsTerm.nuisance_change


def _whole_track_changes(
    case: PredictedCase, fit: Fit, candidate: Candidate, k: int, observations: Sequence[Observation]
) -> list[np.ndarray]:
    """Change by a term of the whole track or a train.

    Hammer tests exactly, passages by derivatives of the base fit where it has them.
    """
    term = candidate.term(candidate.starts[k])
    names = {n.name: i for i, n in enumerate(case.nuisances)}
    pairs = [o for o in observations if o.name in case.frf_pairs]
    predicted = dict(zip((o.name for o in pairs), case.predict(fit.values, (*fit.terms, term), pairs)))
    changes = []
    for i, (o, old) in enumerate(zip(observations, fit.predictions)):
        if o.name in predicted:
            changes.append(predicted[o.name] - old)
            continue
        nuisance_change = term.nuisance_change(case.aligned_passages[o.name].conditions)
        if nuisance_change is None:
            changes.append(np.zeros(o.data.size))
        else:
            name, amount = nuisance_change
            changes.append(Whitened(amount * fit.jacobian[i][:, names[name]]))
    return changes


def _pair_channel_changes(
    case: PredictedCase, fit: Fit, observation: Observation, old: np.ndarray, chosen: Starts
) -> Changes:
    """Change of a receptance by channel terms; for a moved sensor the same motion is read at its new position."""
    pair, changes = case.frf_pairs[observation.name], {}
    sensitivity, track = case.predictor.pair_sensitivity(fit.values, case.all_terms(fit), pair), case.predictor.track()
    here, corrected = sensitivity.receptance(pair), case.predictor.receptance(fit.values, pair, sensitivity)
    for c, k in chosen:
        if c.where["sensor"] == pair.channel:
            terms = (*case.all_terms(fit), c.term(c.starts[k]))
            position = case.predictor.seat(pair.sensor, fit.values, terms).probe(track).place
            h = corrected + (sensitivity.model.receptance(pair.test.place, position) - here)  # 0 where the sensor stays
            changes[c.key, k] = (
                receptance_observation.split_complex(
                    receptance_observation.scale_lines(
                        pair, h, case.predictor.channel_response(fit.values, terms, pair)
                    )
                )
                - old
            )
    return changes


def _passage_channel_changes(
    case: PredictedCase, fit: Fit, observation: Observation, old: np.ndarray, chosen: Starts
) -> Changes:
    """Change of a passage by channel terms, from known signals; sensor positions are tested in hammer tests only."""
    aligned, changes = case.aligned_passages[observation.name], {}
    signals, rows = (
        case.predictor.sensor_signals(fit.values, case.all_terms(fit), aligned),
        old.reshape(len(aligned.sensors), -1),
    )
    all_terms = case.all_terms(fit)
    linear_output = _LinearChannels(case, fit, aligned, signals)
    for c, k in chosen:
        term = c.term(c.starts[k])
        if type(term).sensor is not PhysicsTerm.sensor or "passage" not in term.recording_types:
            continue
        change = np.zeros_like(rows)
        for row, sensor in enumerate(aligned.sensors):
            if sensor.name != c.where["sensor"]:
                continue
            if type(term).channel is TransferTerm.channel:
                output = linear_output.with_factor(row, term.transfer)
            else:
                output = case.predictor.channel_output(fit.values, (*all_terms, term), aligned, sensor, signals[row])
            change[row] = output - rows[row]
        changes[c.key, k] = change.ravel()
    return changes


class _LinearChannels:
    """Outputs of the channels of a passage when one more linear effect acts in one of them.

    The factor of the effect and the band of the passage multiply the spectrum of the channel together: one inverse
    transform for each effect instead of four transforms.
    """

    def __init__(self, case: PredictedCase, fit: Fit, aligned: AlignedPassage, signals: np.ndarray):
        self.case, self.fit, self.aligned, self.signals = case, fit, aligned, signals
        self.rate = 4.0 * case.predictor.solver.rate
        self._spectra: dict[int, np.ndarray] = {}
        self.size = passage_band.padded_size(signals.shape[-1], self.rate)
        frequency = np.fft.rfftfreq(self.size, 1.0 / self.rate)
        gate = passage_band.band_window(frequency, PASSAGE.band_low, aligned.high)
        self.inside = np.flatnonzero(gate)
        self.frequency, self.gate = frequency[self.inside], gate[self.inside]

    def with_factor(self, row: int, factor: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """(n_time,) output of the channel with this number, with a factor (frequency -> complex) beside its own."""
        sensor, values = self.aligned.sensors[row], self.fit.values
        if row not in self._spectra:
            terms = self.case.all_terms(self.fit)
            signal = self.case.predictor.through_channel(values, terms, self.aligned, sensor, self.signals[row])
            self._spectra[row] = np.fft.rfft(signal, self.size)[self.inside] * self.gate
        spectrum = np.zeros(self.size // 2 + 1, dtype=complex)
        spectrum[self.inside] = self._spectra[row] * factor(self.frequency)
        signal = np.fft.irfft(spectrum, self.size)[: self.signals.shape[-1]]
        return self.case.predictor.at_recorded_times(values, self.aligned, sensor, signal)


def _path_changes(case: PredictedCase, fit: Fit, aligned: AlignedPassage, chosen: Starts) -> Changes:
    """Response to a path that all wheels follow."""
    if not chosen:
        return {}
    transfer = WaveTransfer(case.predictor, fit.values, aligned, case.all_terms(fit))
    grid, on_stock, on_blade = transfer.fine_grid, [], []
    for c, k in chosen:
        components = c.term(c.starts[k]).paths(None, aligned.passage.vehicle)
        of_both = [p for p in components if not is_on_blade([p])]
        on_stock.append(sum((p(grid, 0) for p in of_both), np.zeros(grid.size)))
        on_blade.append(sum((p(grid, 0) for p in components), np.zeros(grid.size)))
    (columns,) = transfer.tops_response(np.array(on_stock), np.array(on_blade), [transfer.train()])
    return {(c.key, k): column for (c, k), column in zip(chosen, columns.T)}


def _support_changes(case: PredictedCase, fit: Fit, aligned: AlignedPassage, chosen: Starts) -> Changes:
    """Response to the pseudo-forces of support effects."""
    if not chosen:
        return {}
    rail, sleeper = support_motion(case.predictor, fit.values, case.all_terms(fit), aligned)
    rate, forces = case.predictor.solver.rate, {}
    track = case.predictor.track(aligned.passage.route)
    terms = {(c.key, k): c.term(c.starts[k]) for c, k in chosen}
    for c, start in chosen:
        for j in terms[c.key, start].supports:
            k = j - case.predictor.zone.first
            motion = SupportMotion(rail[k], sleeper[k], rate, track.pad_stiffness[j], track.ballast_stiffness[j])
            if (c.family, c.starts[start], j) not in forces:
                target, force = terms[c.key, start].pseudo_force(motion)
                forces[c.family, c.starts[start], j] = j, TARGETS[target], force
    columns = force_responses(case.predictor, fit.values, case.all_terms(fit), aligned, forces)
    return {
        (c.key, k): np.asarray(sum(columns[c.family, c.starts[k], j] for j in terms[c.key, k].supports))
        for c, k in chosen
    }
