"""What the joint fit of one visit says of the parameters that all visits of a turnout share."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import KMH
from turnout.mismatch.calibrated.belief import ACCEPTED_EFFECT, StateParameter, scatter_sd
from turnout.mismatch.calibrated.change import change_sd
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import model_error
from turnout.mismatch.calibrated.history import BEFORE_ALL, Event
from turnout.mismatch.calibrated.information import GroupInformation, marginalize
from turnout.mismatch.calibrated.model_answer import position_of
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.surface_priors import ROUGHNESS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.case import TrackCase


def calibrated_parameters(case: TrackCase, route: str = "main") -> dict[str, StateParameter]:
    """Parameters of a case that all visits share, with names that do not depend on the case.

    Components are numbered and named by their position in the whole track, since a case holds only the part of the
    track that its sensors record.

    Parameters
    ----------
    case : TrackCase
    route : str
        Route of its sections.

    Returns
    -------
    dict
        Nuisance of the case -> parameter, in the order of the nuisances.
    """
    zone = case.data.site.nominal
    support = zone.turnout.track.support
    whole = case.campaign.turnout.track.support
    sensors = {s.name: float(s.place) for s in case.campaign.sensors}
    measured_at = (*sensors.values(), *(t.place for t in case.campaign.hammer))
    low, high = min(measured_at) - CALIBRATION.sensor_reach, max(measured_at) + CALIBRATION.sensor_reach
    castings = zone.castings
    waves = case.data.site.waves
    of_accepted_effects = {n.name for n in case.accepted.nuisances}
    parameters: dict[str, StateParameter] = {}
    used: Counter[str] = Counter()
    for nuisance in _shared_nuisances(case):
        group = ACCEPTED_EFFECT if nuisance.name in of_accepted_effects else nuisance.group
        name, position, index = nuisance.name, None, None
        start = end = None
        if nuisance.index is not None:
            position = float(support[nuisance.index])
            index = int(np.argmin(np.abs(whole - position)))
            name = f"{nuisance.group}@{position:.2f}"
        elif nuisance.group in ("gain", "seat"):
            position = sensors.get(name.partition("_")[2])
        elif name.startswith("cast_"):
            tag, _, number = name.rpartition("_")
            position = float(castings[int(number)].piece.start)
            name = f"{tag}@{position:.2f}"
        elif nuisance.group == "wave" and waves is not None:  # an amplitude has a meaning on this stretch alone
            start, end = float(waves.start), float(waves.end)
            name = f"{name}@{start:.2f}-{end:.2f}"
        elif nuisance.group == "surface":
            name = nuisance.meaning.removesuffix(" less its file's")
            group = "depth" if name.startswith("ln depth of") else group
            position = position_of(name, None)
        name = name if route == "main" else f"{route} {name}"
        used[name] += 1
        name = name if used[name] == 1 else f"{name} #{used[name]}"
        is_outer = nuisance.index is not None and nuisance.index not in zone.effect_supports
        is_beyond = index is not None and position is not None and not low <= position <= high
        parameters[nuisance.name] = StateParameter(
            name, nuisance.mean, nuisance.sd, 0.0, group, index, position, nuisance.unit,
            may_change=not is_outer, is_beyond_sensors=is_beyond, route=route, start=start, end=end,
        )  # fmt: skip
    every = tuple(parameters.values())
    return {
        name: replace(p, walk_sd=_walk_sd(p, every), visit_sd=_visit_sd(name, p, every))
        for name, p in parameters.items()
    }


def _walk_sd(parameter: StateParameter, parameters: Sequence[StateParameter]) -> float:
    """Standard deviation of the random walk of a year."""
    share = CALIBRATION.default_walk_share
    return dict(CALIBRATION.walk_sds).get(parameter.group, share * scatter_sd(parameter, parameters))


def _visit_sd(nuisance: str, parameter: StateParameter, parameters: Sequence[StateParameter]) -> float:
    """What each visit adds of its own: another train of the type, the temperature of pads, what lies farther out."""
    if nuisance in ("pad_stiffness", "pad_damping"):  # of all pads
        return CALIBRATION.pad_visit_sd
    if not parameter.may_change:
        return change_sd(parameter, parameters)
    return parameter.sd if parameter.group == "wheels" else 0.0


def _shared_nuisances(case: TrackCase) -> list[Nuisance]:
    return [n for n in case.nuisances if n.owner is None]


def visit_groups(case: TrackCase, fit: Fit, sections: str, route: str = "main") -> tuple[GroupInformation, ...]:
    r"""Gauss-Newton information of a fit without effects, by group of recordings with the same error of the model.

    Of recording r with the whitened derivatives J by shared and K by its own parameters and the residual e,

    .. math:: \Lambda = J^T W J - J^T W K (K^T W K + S^{-1})^{-1} K^T W J

    with the prior covariance S of its own parameters. Channels of one recording are summed before.

    Parameters
    ----------
    case : TrackCase
        The case that was fitted.
    fit : Fit
        Without terms, with its Jacobian.
    sections : str
        Labels of its sections, part of the names of the groups.
    route : str
        Route of its sections.

    Returns
    -------
    tuple of GroupInformation
        In the order of their names.

    Raises
    ------
    ValueError
        If the fit has terms or no Jacobian.
    """
    if fit.candidates or not fit.jacobian:
        raise ValueError("information of a visit needs a fit without effects, with its Jacobian")
    parameters = calibrated_parameters(case, route)
    recordings: dict[tuple[str, str], list[int]] = {}
    for k, observation in enumerate(case.observations):
        recordings.setdefault(_group_of(case, observation), []).append(k)
    names = tuple(p.name for p in parameters.values())
    sums: dict[str, tuple[int, np.ndarray, np.ndarray]] = {}
    for (group, _), members in sorted(recordings.items()):
        matrix, vector = _recording_information(case, fit, members)
        count, matrices, vectors = sums.get(group, (0, np.zeros_like(matrix), np.zeros_like(vector)))
        sums[group] = (count + 1, matrices + matrix, vectors + vector)
    return tuple(
        GroupInformation(f"{sections}: {group}", count, names, matrix, vector)
        for group, (count, matrix, vector) in sorted(sums.items())
    )


def channel_levels(case: TrackCase, fit: Fit) -> dict[str, float]:
    """What a fit leaves of each channel, in hammer tests and in passages.

    Parameters
    ----------
    case : TrackCase
        The case that was fitted.
    fit : Fit

    Returns
    -------
    dict
        "channel A2 in the hammer tests" -> mean square of its whitened residual, over all recordings. [-]
    """
    squares: dict[str, list[float]] = {}
    for observation, white in zip(case.observations, fit.white):
        aligned = case.aligned_passages.get(observation.name)
        if aligned is None:
            squares.setdefault(f"channel {case.frf_pairs[observation.name].channel} in the hammer tests", []).append(
                float(np.mean(white**2))
            )
            continue
        rows = np.mean(np.reshape(white, (len(aligned.sensors), -1)) ** 2, axis=1)
        for sensor, square in zip(aligned.sensors, rows):
            squares.setdefault(f"channel {sensor.name} in the passages", []).append(float(square))
    return {name: float(np.mean(values)) for name, values in squares.items()}


def one_of_each_group(case: TrackCase) -> tuple[str, ...]:
    """The first reserved passage of each group, see ``visit_groups``: others of it repeat the error of the model.

    Parameters
    ----------
    case : TrackCase

    Returns
    -------
    tuple of str
        Names of passages.
    """
    names: dict[str, str] = {}
    for o in case.reserved:
        if o.name in case.aligned_passages:
            names.setdefault(_group_of(case, o)[0], o.name)
    return tuple(names.values())


def _group_of(case: TrackCase, observation: Observation) -> tuple[str, str]:
    """(group, recording) of an observation: a train type at one speed, or impacts at one position."""
    aligned = case.aligned_passages.get(observation.name)
    if aligned is not None:
        step = CALIBRATION.speed_step
        speed = step * round(aligned.speed * KMH / step)
        return f"{aligned.conditions['train']}, {speed:.0f} km/h", observation.name
    pair = case.frf_pairs[observation.name]
    return f"impacts at {pair.test.place:.2f} m", pair.test.name


def _recording_information(case: TrackCase, fit: Fit, members: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Information of the observations ``members``, of one recording, on the shared parameters."""
    names = {case.observations[k].name for k in members}
    columns = [c for c, n in enumerate(case.nuisances) if n.owner is None or n.owner in names]
    order = sorted(columns, key=lambda c: case.nuisances[c].owner is not None)  # shared ones first
    nuisances = [case.nuisances[c] for c in order]
    n_shared = sum(n.owner is None for n in nuisances)
    point = np.array([fit.values[n.name] - (n.mean if n.owner else 0.0) for n in nuisances])
    matrix, vector = np.zeros((len(order), len(order))), np.zeros(len(order))
    for k in members:
        observation = case.observations[k]
        weight = observation.effective / fit.scale[observation.data_type]
        rows = np.asarray(fit.jacobian[k], dtype=float)[:, order]
        matrix += weight * rows.T @ rows
        vector += weight * rows.T @ (fit.white[k] + rows @ point)
    owned = nuisances[n_shared:]
    return marginalize(matrix, vector, range(n_shared, len(order)), np.array([n.sd**-2 for n in owned]))


def file_errors(parameters: Sequence[StateParameter], directions: Mapping[str, Mapping[str, float]]) -> list[Event]:
    """What values that fit best have beside the tolerances of the file: errors of the model, and of surfaces at noses.

    Parameters
    ----------
    parameters : sequence of StateParameter
    directions : mapping
        As ``dip_directions``.

    Returns
    -------
    list of Event
        Before all visits.
    """
    return [model_error(parameters), *nose_errors(parameters, directions)]


def nose_errors(parameters: Sequence[StateParameter], directions: Mapping[str, Mapping[str, float]]) -> list[Event]:
    """What the file does not know of the running surface at noses: there it has an estimate of another shape.

    Parameters
    ----------
    parameters : sequence of StateParameter
        Those of group "depth" are noses.
    directions : mapping
        As ``dip_directions``.

    Returns
    -------
    list of Event
        Before all visits: the shortest dips within ``CALIBRATION.nose_reach`` of a nose, each of an unknown depth.
    """
    noses = [position for p in parameters if p.group == "depth" and (position := position_of(p.name, p)) is not None]
    errors = []
    for name, direction in directions.items():
        position = position_of(name, None)
        is_short = f"dip of {min(CALIBRATION.dip_lengths):g} m" in name
        if is_short and position is not None and any(abs(position - nose) <= CALIBRATION.nose_reach for nose in noses):
            errors.append(Event(BEFORE_ALL, {}, direction, CALIBRATION.nose_error))
    return errors


def dip_directions(parameters: Sequence[StateParameter]) -> dict[str, dict[str, float]]:
    r"""Dips of the running surface that may appear, as changes of the amplitudes of the waves.

    A dip is one period of a raised cosine, :math:`(1 + \cos 2\pi x/L)/2`, of ``CALIBRATION.dip_lengths``, at
    positions up to ``TRACK.effect_reach`` beyond the outer sensors, as effects of supports are. Its waves are those
    that are most probable under their priors, if the surface has the dip with an error of ``CALIBRATION.dip_error``.
    Waves overlap, so that a dip has many descriptions by waves; one without the priors needs large amplitudes that
    cancel.

    Parameters
    ----------
    parameters : sequence of StateParameter
        Those of group "wave" are used.

    Returns
    -------
    dict
        "dip of 0.4 m@3.30" -> wave parameter -> change per metre of depth.
    """
    stretches: dict[tuple[str, str, str], dict[str, StateParameter]] = {}
    for p in parameters:
        match = re.fullmatch(r"(.*?)((?:cos|sin)_wave_\d+)@(-?[\d.]+)-(-?[\d.]+)", p.name)
        if match and p.group == "wave":
            stretches.setdefault((match[1], match[3], match[4]), {})[match[2]] = p
    directions = {}
    for (route, start, end), by_wave in stretches.items():
        ends = float(start) + ROUGHNESS.rolling_reach, float(end) - ROUGHNESS.rolling_reach
        waves, last = Waves(ends, 0.0), ends[1] + TRACK.effect_reach + 1e-9
        x = np.arange(waves.start, waves.end, CALIBRATION.dip_step)
        used = [(k, by_wave[name]) for k, name in enumerate(waves.names) if name in by_wave]
        sd = np.array([p.sd for _, p in used])
        shapes = waves.shapes(x)[[k for k, _ in used]].T * sd / CALIBRATION.dip_error
        inverse = np.linalg.solve(shapes.T @ shapes + np.eye(len(used)), shapes.T) / CALIBRATION.dip_error
        for length in CALIBRATION.dip_lengths:
            for position in np.arange(ends[0] - TRACK.effect_reach, last, CALIBRATION.dip_spacing):
                distance = np.clip((x - position) / length, -0.5, 0.5)
                amplitudes = sd * (inverse @ (0.5 + 0.5 * np.cos(2.0 * np.pi * distance)))
                directions[f"{route}dip of {length:g} m@{position:.2f}"] = {
                    p.name: float(a) for (_, p), a in zip(used, amplitudes)
                }
    return directions
