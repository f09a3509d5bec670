"""Screening of candidates: estimated change of each prediction, without a simulation, which orders the candidate queue.

A support effect acts as a pseudo-force of the base simulation, and in receptances as an exact change of one link. A dip
is a path that all wheels follow. Effects of the whole track use derivatives of the base fit.
"""

import numpy as np

from turnout.mismatch.engine.case import Whitened
from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.pseudo_forces import PAD, RAIL, SLEEPER, force_responses, support_motion
from turnout.mismatch.turnout.receptance_model import AddedLinks
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.physics.pad_temperature import REFERENCE

SUPPORT_EFFECTS = (
    "hanging_sleeper",
    "local_ballast",
    "local_pad",
    "dry_friction",
    "ballast_hardening",
    "attached_resonator",
)
WHOLE_TRACK_EFFECTS = ("pad_temperature", "unsprung_mass", "zener_pad", "rail_shear", "ballast_inertia", "sleeper_mode")
DERIVATIVE_EFFECTS = ("pad_temperature", "unsprung_mass")  # passages have columns for these
PATH_EFFECTS = ("surface_dip", "rail_corrugation")
CHANNEL_EFFECTS = (
    "sensor_gain", "mount_resonance", "time_offset", "low_pass", "high_pass", "clock_drift", "clipping", "hum",
    "sensor_position",
)  # fmt: skip


def screen_columns(case, fit, observations):
    """(key, start) -> list of (n,) per observation: change of the prediction when a candidate takes that start.

    ``fit`` is of ``observations``, all of the case or some. In single precision; zero columns share one array.
    """
    chosen = [
        (c, k)
        for c in case.candidates
        for k in range(len(c.starts))
        if c.family in (*SUPPORT_EFFECTS, *PATH_EFFECTS, *CHANNEL_EFFECTS)
    ]
    blank = [np.zeros(o.data.size, dtype=np.float32) for o in observations]
    columns = {(c.key, k): list(blank) for c, k in chosen}
    laws, paths = ([(c, k) for c, k in chosen if c.family in names] for names in (SUPPORT_EFFECTS, PATH_EFFECTS))
    added = AddedLinks(case, fit, laws)
    for i, o in enumerate(observations):
        if o.name in case.aligned_passages:
            aligned = case.aligned_passages[o.name]
            changes = _support_changes(case, fit, aligned, laws) | _path_changes(case, fit, aligned, paths)
        else:
            changes = added.changes(case.frf_pairs[o.name])
        channels = _passage_channel_changes if o.name in case.aligned_passages else _pair_channel_changes
        changes |= channels(
            case, fit, o, fit.predictions[i], [(c, k) for c, k in chosen if c.family in CHANNEL_EFFECTS]
        )
        for key, column in changes.items():
            columns[key][i] = column.astype(np.float32)
    for c in case.candidates:
        for k in (
            range(len(c.starts)) if c.family in (WHOLE_TRACK_EFFECTS if case.frf_pairs else DERIVATIVE_EFFECTS) else ()
        ):
            columns[c.key, k] = _whole_track_changes(case, fit, c, k, observations)
    return columns


def _whole_track_changes(case, fit, candidate, k, observations):
    """Change by a term of the whole track or a train.

    Hammer tests exactly, passages by derivatives of the base fit where it has them.
    """
    start, changes = candidate.starts[k], []
    names = {n.name: i for i, n in enumerate(case.nuisances)}
    terms = (*fit.terms, candidate.term(start))
    for i, (o, old) in enumerate(zip(observations, fit.predictions)):
        if o.name in case.frf_pairs:
            changes.append(case.predict(fit.values, terms, [o])[0] - old)
            continue
        conditions, column, amount = case.conditions_of(case.aligned_passages[o.name]), None, 0.0
        if candidate.family == "pad_temperature" and "rail_temperature" in conditions:
            column, amount = "pad_stiffness", -start[0] * (conditions["rail_temperature"] - REFERENCE)
        elif candidate.family == "unsprung_mass" and conditions["train"] == candidate.where["train"]:
            column, amount = f"wheels_{conditions['train']}", np.log(start[0])
        if column is None:
            changes.append(np.zeros(o.data.size))
        else:
            changes.append(Whitened(amount * fit.jacobian[i][:, names[column]]))
    return changes


def _pair_channel_changes(case, fit, observation, old, chosen):
    """Change of a receptance by channel terms; for a moved sensor the same motion is read at its new position."""
    pair, changes = case.frf_pairs[observation.name], {}
    sensitivity, track = case.pair_sensitivity(fit.values, fit.terms, pair), case.track()
    here, corrected = sensitivity.receptance(pair), case.receptance(fit.values, pair, sensitivity)
    for c, k in chosen:
        if c.where["sensor"] == pair.channel:
            terms = (*fit.terms, c.term(c.starts[k]))
            position = case.seat(pair.sensor, fit.values, terms).probe(track).place
            h = corrected + (sensitivity.model.receptance(pair.test.place, position) - here)  # 0 where the sensor stays
            changes[c.key, k] = (
                receptance_observation.split_complex(
                    receptance_observation.scale_lines(pair, h, case.channel_response(fit.values, terms, pair))
                )
                - old
            )
    return changes


def _passage_channel_changes(case, fit, observation, old, chosen):
    """Change of a passage by channel terms, from known signals; sensor positions are tested in hammer tests only."""
    aligned, changes = case.aligned_passages[observation.name], {}
    signals, rows = case.sensor_signals(fit.values, fit.terms, aligned), old.reshape(len(aligned.sensors), -1)
    for c, k in chosen:
        if c.family != "sensor_position":
            terms, change = (*fit.terms, c.term(c.starts[k])), np.zeros_like(rows)
            for row, sensor in enumerate(aligned.sensors):
                if sensor.name == c.where["sensor"]:
                    change[row] = case.channel_output(fit.values, terms, aligned, sensor, signals[row]) - rows[row]
            changes[c.key, k] = change.ravel()
    return changes


def _path_changes(case, fit, aligned, chosen):
    """Response to a path that all wheels follow."""
    if not chosen:
        return {}
    transfer = WaveTransfer(case, fit.values, aligned, fit.terms)
    rows = []
    for c, k in chosen:
        components = c.term(c.starts[k]).paths(None, aligned.passage.vehicle)
        rows.append(
            sum((component(transfer.fine_grid, 0) for component in components), np.zeros(transfer.fine_grid.size))
        )
    columns = transfer.train_response(np.array(rows))
    return {(c.key, k): column for (c, k), column in zip(chosen, columns.T)}


def _support_changes(case, fit, aligned, chosen):
    """Response to the pseudo-forces of support effects."""
    if not chosen:
        return {}
    rail, sleeper = support_motion(case, fit.values, fit.terms, aligned)
    rate, forces = case.solver.rate, {}
    track = case.track(aligned.passage.route)
    laws = [(c.family, c.starts[start], j) for c, start in chosen for j in _affected_supports(c)]
    for family, values, j in dict.fromkeys(laws):
        k = j - case.zone.first
        y, d = sleeper[k], rail[k] - sleeper[k]
        kb, kp = track.ballast_stiffness[j], track.pad_stiffness[j]
        if family == "hanging_sleeper":
            force = j, SLEEPER, (1.0 - values[1]) * kb * np.clip(y, -values[0], values[0])
        elif family == "local_ballast":
            force = j, SLEEPER, -(values[0] - 1.0) * kb * y
        elif family == "local_pad":
            force = j, PAD, -(values[0] - 1.0) * kp * d
        elif family == "dry_friction":
            force = j, PAD, -values[0] * np.tanh(np.gradient(d) * rate / 2e-3)
        elif family == "ballast_hardening":
            force = j, SLEEPER, -values[0] * kb * y * (y / 1e-3) ** 2
        else:
            force = j, RAIL, -values[0] * np.gradient(np.gradient(rail[k])) * rate**2
        forces[family, values, j] = force
    columns = force_responses(case, fit.values, fit.terms, aligned, forces)
    return {(c.key, k): sum(columns[c.family, c.starts[k], j] for j in _affected_supports(c)) for c, k in chosen}


def _affected_supports(candidate):
    """Supports that the effect acts at."""
    half = (candidate.where.get("sleepers", 1) - 1) // 2
    return range(candidate.where["sleeper"] - half, candidate.where["sleeper"] + half + 1)
