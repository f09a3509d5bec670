r"""Subspaces of the residual of a turnout: a force at a support, a fault of a channel, a wheel, one recording alone.

In a passage the force at a position x is free in time: all sensors respond by the track's transfer functions. In hammer
tests a linear change at x adds :math:`q(f)\,H_{bx}(f)\,H_{xs}(f)`, by reciprocity, with one free q(f) for all impacts b
and sensors s. This holds for a change of a support, a mass or a loose fastening alike. A change that is not linear has
another :math:`q_b(f)` for each impact. Neighbouring supports may change together. Sensors on the changed sleeper itself
are an exception: the changed link acts on them directly as well.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.priors import PASSAGE, RECEPTANCE, TRACK
from turnout.mismatch.turnout.pseudo_forces import green_functions
from turnout.mismatch.turnout.rail_parameters import RAIL_SDS
from turnout.mismatch.turnout.rail_roughness import amplitude_sd
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.mismatch.turnout.track_parameters import COMMON_PARAMETERS
from turnout.mismatch.turnout.wave_response import WaveTransfer, channel_responses

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity


_COMMON_NAMES = [name for name, *_ in COMMON_PARAMETERS]
_COMMON_VALUES, _RAIL_VALUES = ("pad_stiffness", "ballast_stiffness"), tuple(name for name, _ in RAIL_SDS)


def source_spaces(case: TrackCase, fit: Fit) -> Iterator[ResidualSpace]:
    """Spaces of all passages and of the hammer tests of a TrackCase.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.

    Yields
    ------
    ResidualSpace
        Those of one passage after the other, of all passages together, then those of the hammer tests.
    """
    for o in case.observations:
        if o.name in case.aligned_passages:
            aligned = case.aligned_passages[o.name]
            yield _force_space(case, fit, aligned)
            yield _wheel_space(case, fit, aligned)
    if case.aligned_passages:
        yield _filter_space(case, fit)
    pairs = [(o, case.frf_pairs[o.name]) for o in case.observations if o.name in case.frf_pairs]
    if pairs:
        yield from _change_spaces(case, fit, pairs)


def _force_space(case: TrackCase, fit: Fit, aligned: AlignedPassage) -> ResidualSpace:
    """Harmonics of each sensor over a passage.

    They are combined as a force at each support, a channel's fault, or freely.
    """
    n, n_sensor = aligned.time.size, len(aligned.sensors)
    step = aligned.clock / n
    lines = step * np.arange(np.ceil(PASSAGE.band_low / step), np.floor(1.1 * aligned.high / step) + 1)
    phase = 2.0 * np.pi * aligned.time[:, None] * lines
    harmonics = np.sqrt(2.0 / n) * np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(n, -1)
    columns = np.kron(np.eye(n_sensor), harmonics)
    frequency, g = green_functions(case.predictor, fit.values, case.all_terms(fit), aligned)
    g = g * channel_responses(fit.values, case.all_terms(fit), aligned, frequency)[:, :, None, None]
    g = g[np.clip(np.searchsorted(frequency, lines), 0, frequency.size - 1), :, :, 0]
    subspaces: dict[tuple[str, Any], np.ndarray | None] = {("clock", aligned.name): None}
    size = harmonics.shape[1]
    for k, j in enumerate(case.predictor.zone.supports if n_sensor > 1 else ()):  # one sensor cannot locate a force
        transfer = g[:, :, k] / np.sqrt(np.mean(np.abs(g[:, :, k]) ** 2, axis=1))[:, None]
        subspaces["place", _position_of(case, j)] = np.concatenate([_real_blocks(row) for row in transfer.T])
    for s, sensor in enumerate(aligned.sensors):
        subspaces["sensor", sensor.name] = np.eye(n_sensor * size)[:, s * size : (s + 1) * size]
    return ResidualSpace((aligned.name,), columns, subspaces)


def _real_blocks(transfer: np.ndarray) -> np.ndarray:
    """(2n, 2n) real matrix by which a complex transfer (n,) acts on cosines and sines."""
    blocks = np.zeros((2 * transfer.size, 2 * transfer.size))
    k = 2 * np.arange(transfer.size)
    blocks[k, k] = blocks[k + 1, k + 1] = transfer.real
    blocks[k, k + 1], blocks[k + 1, k] = transfer.imag, -transfer.imag
    return blocks


def _filter_space(case: TrackCase, fit: Fit) -> ResidualSpace:
    """What a channel shows of all trains, through one filter that varies slowly with frequency."""
    passages = [
        (o, case.aligned_passages[o.name], prediction)
        for o, prediction in zip(case.observations, fit.predictions)
        if o.name in case.aligned_passages
    ]
    octaves, filters = _slow_filters(1.1 * max(aligned.high for _, aligned, _ in passages))
    channels = list(dict.fromkeys(sensor.name for _, aligned, _ in passages for sensor in aligned.sensors))
    size = 2 * filters.shape[1]
    columns = {channel: np.arange(size * k, size * (k + 1)) for k, channel in enumerate(channels)}
    blocks = []
    for o, aligned, prediction in passages:
        n = aligned.time.size
        block = np.zeros((o.data.size, size * len(channels)))
        frequency = np.fft.rfftfreq(n, 1.0 / aligned.clock)
        octave = np.log2(np.maximum(frequency, frequency[1]))
        weights = np.stack([np.interp(octave, octaves, values, 0.0, 0.0) for values in filters.T])
        for k, sensor in enumerate(aligned.sensors):
            rows = slice(k * n, (k + 1) * n)
            filtered = weights * np.fft.rfft(prediction[rows])
            block[rows, columns[sensor.name]] = np.fft.irfft(np.concatenate([filtered, 1j * filtered]), n).T
        blocks.append(block)
    levels: dict[tuple[str, Any], np.ndarray | None] = {("sensor", channel): columns[channel] for channel in channels}
    return ResidualSpace(tuple(o.name for o, *_ in passages), np.concatenate(blocks), levels, "one filter")


def _slow_filters(high: float) -> tuple[np.ndarray, np.ndarray]:
    """(n,) octaves of frequency up to ``high`` [Hz], and (n, k) filters on them whose sum of squares is a normal
    correlation over ``RECEPTANCE.change_octaves``.
    """
    low = np.log2(PASSAGE.band_low)
    octaves = np.linspace(low, np.log2(high), int(np.ceil((np.log2(high) - low) / (0.2 * RECEPTANCE.change_octaves))))
    correlation = np.exp(-0.5 * ((octaves[:, None] - octaves) / RECEPTANCE.change_octaves) ** 2)
    eigenvalues, vectors = np.linalg.eigh(correlation)
    is_relevant = eigenvalues > RECEPTANCE.least_filter * eigenvalues[-1]
    return octaves, vectors[:, is_relevant] * np.sqrt(eigenvalues[is_relevant])


def _wheel_space(case: TrackCase, fit: Fit, aligned: AlignedPassage) -> ResidualSpace:
    """Waves of each wheel, which are errors of ordinary size in the model of the passage, and of all wheels of a train.

    Where one train alone was recorded, its wheels show what the track does to all trains.
    """
    waves, transfer = case.predictor.waves, WaveTransfer(case.predictor, fit.values, aligned, case.all_terms(fit))
    sd = np.repeat(amplitude_sd(waves.lengths, waves.length, WHEELS.level), 2)
    spectra = transfer.spectra(waves.lengths, np.ones(transfer.node.size))
    blocks = [transfer.signals_from(spectra, transfer.wheel(w)) * sd for w in range(transfer.wheel_delays.size)]
    train, first = aligned.train, 0
    subspaces: dict[tuple[str, Any], np.ndarray | None] = {}
    identity = np.eye(sum(b.shape[1] for b in blocks))
    for w, block in enumerate(blocks):
        subspaces["wheel", (train, w + 1)] = identity[:, first : first + block.shape[1]]
        first += block.shape[1]
    if len({a.train for a in case.aligned_passages.values()}) > 1:
        subspaces["train", train] = identity
    return ResidualSpace((aligned.name,), np.concatenate(blocks, axis=1), subspaces)


def _change_spaces(case: TrackCase, fit: Fit, pairs: Sequence[tuple[Observation, FrfPair]]) -> Iterator[ResidualSpace]:
    """A cause at a support or at neighbouring ones, in a channel, at all supports; in all tests or in those of one
    visit.

    A change that is linear is the same for all impacts. One that is not, as of a fastening that lifts, acts by a force
    that is another one for each position of the impact: its law is "free". A change may vary slowly with frequency, as
    that of a spring, or not, as that of a resonator or of a delay.
    """
    supports, zone = _extended_supports(case), case.predictor.zone.supports
    sensitivity_of = case.predictor.pair_sensitivities(fit.values, case.all_terms(fit))
    through = {o.name: _through_support(case, fit, pair, sensitivity_of(pair), supports) for o, pair in pairs}
    order = {o.name: k for k, o in enumerate(case.observations)}
    by_impact: dict[float, list[tuple[Observation, FrfPair]]] = {}
    for o, pair in pairs:
        by_impact.setdefault(pair.test.place, []).append((o, pair))
    for law, members in [("linear", pairs), *(("free", of_impact) for of_impact in by_impact.values())]:
        for first in range(len(zone)):
            stretch = zone[first : first + RECEPTANCE.max_stretch]
            changes = [[through[o.name][:, j - supports[0]] for o, _ in members] for j in stretch]
            levels = _stretch_levels([_position_of(case, j) for j in stretch])
            yield from _spaces_of_changes(members, levels, changes, law)
    receptances = [_receptance(pair, fit.predictions[order[o.name]]) for o, pair in pairs]
    for channel in dict.fromkeys(pair.channel for _, pair in pairs):
        change = [h * (pair.channel == channel) for h, (_, pair) in zip(receptances, pairs)]
        yield from _spaces_of_changes(pairs, [("sensor", channel)], [change], "linear")
    visits = tuple(dict.fromkeys(pair.test.visit for _, pair in pairs))
    for name, whole_track in _whole_track_changes(case, fit, pairs).items():
        yield from _spaces_of_changes(pairs, [("frequency", "track")], [whole_track], name)
        for visit in visits if len(visits) > 1 else ():
            change = [h * (pair.test.visit == visit) for h, (_, pair) in zip(whole_track, pairs)]
            yield from _spaces_of_changes(pairs, [("condition", visit)], [change], name)


def _whole_track_changes(
    case: TrackCase, fit: Fit, pairs: Sequence[tuple[Observation, FrfPair]]
) -> dict[str, list[np.ndarray]]:
    """Change of each pair's receptance by one value of all supports or of the whole rail, by the name of the value.

    A law that has another value at each frequency acts by the same products of strains: pads of three parameters by
    the compression of the pads, a rail soft in shear by its shear strain. Values without influence are left out.
    """
    sensitivity_of, terms = case.predictor.pair_sensitivities(fit.values, case.all_terms(fit)), case.all_terms(fit)
    by_value: dict[str, list[np.ndarray]] = {name: [] for name in (*_COMMON_VALUES, *_RAIL_VALUES)}
    for _, pair in pairs:
        sensitivity, channel = sensitivity_of(pair), case.predictor.channel_response(fit.values, terms, pair)
        common, rail = sensitivity.gradient(pair), sensitivity.rail_gradient(pair)
        for name in _COMMON_VALUES:
            by_value[name].append(common[:, _COMMON_NAMES.index(name)] * channel)
        for k, name in enumerate(_RAIL_VALUES):
            by_value[name].append(rail[:, k] * channel)
    return {name: changes for name, changes in by_value.items() if any(np.any(h) for h in changes)}


def _stretch_levels(positions: Sequence[float]) -> list[tuple[str, Any]]:
    """Levels of the first support alone, of it and the next, and so on."""
    return [("place", positions[0]), *(("place", (positions[0], last)) for last in positions[1:])]


def _spaces_of_changes(
    pairs: Sequence[tuple[Observation, FrfPair]],
    levels: Sequence[tuple[str, Any]],
    changes: Sequence[Sequence[np.ndarray]],
    law: str,
) -> Iterator[ResidualSpace]:
    """Spaces of changes, each given on all pairs. The first level is the first change, the next is that and the second,
    and so on; free from line to line, and varying slowly.
    """
    names, n = tuple(o.name for o, _ in pairs), 2 * receptance_observation.LINES.size
    blocks = [_unit_columns(pairs, change) for change in changes]
    combinations = {level: np.arange(n * (k + 1)) for k, level in enumerate(levels)}
    yield ResidualSpace(names, np.concatenate(blocks, axis=1), combinations, law)
    slow = [block @ _slow_changes() for block in blocks]
    yield ResidualSpace(names, np.concatenate(slow, axis=1), combinations, f"{law}, slow")


def _unit_columns(pairs: Sequence[tuple[Observation, FrfPair]], changes: Sequence[np.ndarray]) -> np.ndarray:
    """Columns of a change of each pair, of unit size; 0 on lines that no pair has."""
    columns = np.concatenate([_line_columns(pair, h) for h, (_, pair) in zip(changes, pairs)])
    size = np.sqrt(np.sum(columns**2, axis=0))
    return columns / np.where(size > 0.0, size, 1.0)


@cache
def _slow_changes() -> np.ndarray:
    """(2 n_line, 2 n_line) combinations of lines, real and imaginary, whose sum of squares is a normal correlation over
    ``RECEPTANCE.change_octaves``.
    """
    octaves = np.log2(receptance_observation.LINES)
    correlation = np.exp(-0.5 * ((octaves[:, None] - octaves) / RECEPTANCE.change_octaves) ** 2)
    eigenvalues, vectors = np.linalg.eigh(correlation)
    return np.kron(vectors * np.sqrt(np.maximum(eigenvalues, 0.0)), np.eye(2))


def _through_support(
    case: TrackCase, fit: Fit, pair: FrfPair, sensitivity: ReceptanceSensitivity, supports: range
) -> np.ndarray:
    """(n_line, n_support) receptance from impact to support times that from support to sensor, with the channel."""
    rows = [sensitivity.model.matrices.index["rail", j] for j in supports]
    u, v = (
        sensitivity.model.displacement(position)[:, rows]
        for position in (pair.test.place, sensitivity.seats[pair.seat])
    )
    return u * v * case.predictor.channel_response(fit.values, case.all_terms(fit), pair)[:, None]


def _receptance(pair: FrfPair, predicted: np.ndarray) -> np.ndarray:
    """The predicted receptance on ``LINES``, 0 where it was not measured."""
    n, h = pair.lines.size, np.zeros(receptance_observation.LINES.size, dtype=complex)
    h[pair.lines] = (predicted[:n] + 1j * predicted[n:]) * pair.size
    return h


def _line_columns(pair: FrfPair, change: np.ndarray) -> np.ndarray:
    """(2n, 2 n_line) columns: change of a pair's observation per real and imaginary part of q on each line."""
    n, scaled = pair.lines.size, change[pair.lines] / pair.size
    columns, k = np.zeros((2 * n, 2 * receptance_observation.LINES.size)), np.arange(n)
    columns[k, 2 * pair.lines] = columns[n + k, 2 * pair.lines + 1] = scaled.real
    columns[n + k, 2 * pair.lines], columns[k, 2 * pair.lines + 1] = scaled.imag, -scaled.imag
    return columns


def _extended_supports(case: TrackCase) -> range:
    """Supports of the zone and some beyond."""
    last = case.predictor.track().support.size
    return range(
        max(0, case.predictor.zone.first - TRACK.extra_supports),
        min(last, case.predictor.zone.last + 1 + TRACK.extra_supports),
    )


def _position_of(case: TrackCase, support: int) -> float:
    return round(float(case.predictor.track().support[support]), 3)
