"""Screening of candidates: estimated change of each prediction, without a simulation, which orders the candidate queue.

A support effect acts as a pseudo-force of the base simulation, and in receptances as an exact change of one link. A dip
is a path that all wheels follow. Effects of the whole track use derivatives of the base fit.
"""

import numpy as np

from turnout.mismatch.engine.case import Whitened
from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.pseudo_forces import PAD, RAIL, SLEEPER, carried, support_forces
from turnout.mismatch.turnout.receptance_model import AddedLinks
from turnout.mismatch.turnout.wave_response import Carrier
from turnout.physics.pad_temperature import REFERENCE

LAWS = ("hanging_sleeper", "local_ballast", "local_pad", "dry_friction", "ballast_hardening", "attached_resonator")
WHOLE = ("pad_temperature", "unsprung_mass", "zener_pad", "rail_shear", "ballast_inertia", "sleeper_mode")
TOLD = ("pad_temperature", "unsprung_mass")  # passages have columns for these
PATHS = ("surface_dip", "rail_corrugation")
CHANNELS = (
    "sensor_gain", "mount_resonance", "time_offset", "low_pass", "high_pass", "clock_drift", "clipping", "hum",
    "sensor_position",
)  # fmt: skip


def screen_columns(case, fit, observations):
    """(key, start) -> list of (n,) per observation: change of the prediction when a candidate takes that start.

    ``fit`` is of ``observations``, all of the case or some. In single precision; zero columns share one array.
    """
    chosen = [(c, k) for c in case.candidates for k in range(len(c.starts)) if c.family in (*LAWS, *PATHS, *CHANNELS)]
    blank = [np.zeros(o.data.size, dtype=np.float32) for o in observations]
    found = {(c.key, k): list(blank) for c, k in chosen}
    laws, paths = ([(c, k) for c, k in chosen if c.family in names] for names in (LAWS, PATHS))
    added = AddedLinks(case, fit, laws)
    for i, o in enumerate(observations):
        if o.name in case.rollings:
            made = case.rollings[o.name]
            parts = _passage(case, fit, made, laws) | _paths(case, fit, made, paths)
        else:
            parts = added.changes(case.pairs[o.name])
        channels = _passage_channels if o.name in case.rollings else _pair_channels
        parts |= channels(case, fit, o, fit.predictions[i], [(c, k) for c, k in chosen if c.family in CHANNELS])
        for key, column in parts.items():
            found[key][i] = column.astype(np.float32)
    for c in case.candidates:
        for k in range(len(c.starts)) if c.family in (WHOLE if case.pairs else TOLD) else ():
            found[c.key, k] = _whole(case, fit, c, k, observations)
    return found


def _whole(case, fit, candidate, k, observations):
    """Change by a term of the whole track or a train.

    Hammer tests exactly, passages by derivatives of the base fit where it has them.
    """
    start, found = candidate.starts[k], []
    names = {n.name: i for i, n in enumerate(case.nuisances)}
    terms = (*fit.terms, candidate.term(start))
    for i, (o, old) in enumerate(zip(observations, fit.predictions)):
        if o.name in case.pairs:
            found.append(case.predict(fit.values, terms, [o])[0] - old)
            continue
        said, column, amount = case.said(case.rollings[o.name]), None, 0.0
        if candidate.family == "pad_temperature" and "rail_temperature" in said:
            column, amount = "pad_stiffness", -start[0] * (said["rail_temperature"] - REFERENCE)
        elif candidate.family == "unsprung_mass" and said["train"] == candidate.where["train"]:
            column, amount = f"wheels_{said['train']}", np.log(start[0])
        if column is None:
            found.append(np.zeros(o.data.size))
        else:
            found.append(Whitened(amount * fit.jacobian[i][:, names[column]]))
    return found


def _pair_channels(case, fit, observation, old, chosen):
    """Change of a receptance by channel terms; for a moved sensor the same motion is read at its new position."""
    pair, found = case.pairs[observation.name], {}
    heard, track = case.blow_model(fit.values, fit.terms, pair), case.track()
    here, corrected = heard.receptance(pair), case.receptance(fit.values, pair, heard)
    for c, k in chosen:
        if c.where["sensor"] == pair.channel:
            terms = (*fit.terms, c.term(c.starts[k]))
            place = case.seat(pair.sensor, fit.values, terms).probe(track).place
            h = corrected + (heard.model.receptance(pair.test.place, place) - here)  # 0 where the sensor stays
            found[c.key, k] = (
                receptance_observation.split(
                    receptance_observation.scaled(pair, h, case.chain(fit.values, terms, pair))
                )
                - old
            )
    return found


def _passage_channels(case, fit, observation, old, chosen):
    """Change of a passage by channel terms, from known signals; sensor positions are tested in hammer tests only."""
    made, found = case.rollings[observation.name], {}
    clean, rows = case.clean(fit.values, fit.terms, made), old.reshape(len(made.sensors), -1)
    for c, k in chosen:
        if c.family != "sensor_position":
            terms, change = (*fit.terms, c.term(c.starts[k])), np.zeros_like(rows)
            for row, sensor in enumerate(made.sensors):
                if sensor.name == c.where["sensor"]:
                    change[row] = case.shown(fit.values, terms, made, sensor, clean[row]) - rows[row]
            found[c.key, k] = change.ravel()
    return found


def _paths(case, fit, made, chosen):
    """Response to a path that all wheels follow."""
    if not chosen:
        return {}
    carrier = Carrier(case, fit.values, made, fit.terms)
    rows = []
    for c, k in chosen:
        parts = c.term(c.starts[k]).paths(None, made.passage.vehicle)
        rows.append(sum((part(carrier.course, 0) for part in parts), np.zeros(carrier.course.size)))
    columns = carrier.followed(np.array(rows))
    return {(c.key, k): column for (c, k), column in zip(chosen, columns.T)}


def _passage(case, fit, made, chosen):
    """Response to the pseudo-forces of support effects."""
    if not chosen:
        return {}
    rail, sleeper = support_forces(case, fit.values, fit.terms, made)
    rate, forces = case.solver.rate, {}
    track = case.track(made.passage.route)
    laws = [(c.family, c.starts[start], j) for c, start in chosen for j in _sleepers(c)]
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
    columns = carried(case, fit.values, fit.terms, made, forces)
    return {(c.key, k): sum(columns[c.family, c.starts[k], j] for j in _sleepers(c)) for c, k in chosen}


def _sleepers(candidate):
    """Supports that the effect acts at."""
    half = (candidate.where.get("sleepers", 1) - 1) // 2
    return range(candidate.where["sleeper"] - half, candidate.where["sleeper"] + half + 1)
