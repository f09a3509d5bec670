"""Score-test columns of the candidates, batched over pseudo-forces of one base simulation."""

import numpy as np

from turnout.mismatch.track import blows
from turnout.mismatch.track.columns import carried, support_forces

LAWS = ("hanging_sleeper", "local_ballast", "local_pad", "dry_friction", "ballast_hardening", "attached_resonator")


def screen_columns(case, fit):
    """key -> list of (n,) per observation: change of the prediction when the candidate takes its first start."""
    at_supports = [c for c in case.candidates if c.family in LAWS]
    others = [c for c in case.candidates if c.family not in LAWS and _many(case, c)]
    found = {c.key: [np.zeros(o.data.size) for o in case.observations] for c in (*at_supports, *others)}
    for i, o in enumerate(case.observations):
        if o.name in case.rollings:
            parts = _passage(case, fit, case.rollings[o.name], at_supports)
        else:
            parts = _pair(case, fit, case.pairs[o.name], at_supports)
        for key, column in parts.items():
            found[key][i] = column
    for candidate in others:
        term = candidate.term(candidate.starts[0])
        predicted = case.predict(fit.values, (*fit.terms, term), case.observations)
        found[candidate.key] = [new - old for new, old in zip(predicted, fit.predictions)]
    return found


def _many(case, candidate):
    """Families with several places whose prediction is cheap: sensors, whose channels need no simulation."""
    return candidate.scanned > 1 and "sensor" in candidate.where and candidate.family != "sensor_position"


def _passage(case, fit, made, candidates):
    if not candidates:
        return {}
    rail, sleeper = support_forces(case, fit.values, fit.terms, made)
    rate, forces = 4.0 * case.solver.rate, {}
    track = case.track(made.passage.route)
    for c in candidates:
        j = c.where["sleeper"]
        k = j - case.zone.first
        y, d = sleeper[k], rail[k] - sleeper[k]
        kb, kp = track.ballast_stiffness[j], track.pad_stiffness[j]
        start = c.starts[0]
        if c.family == "hanging_sleeper":
            force = j, 1, kb * np.clip(y, -start[0], start[0])
        elif c.family == "local_ballast":
            force = j, 1, -(start[0] - 1.0) * kb * y
        elif c.family == "local_pad":
            force = j, 2, -(start[0] - 1.0) * kp * d
        elif c.family == "dry_friction":
            force = j, 2, -start[0] * np.tanh(np.gradient(d) * rate / 2e-3)
        elif c.family == "ballast_hardening":
            force = j, 1, -start[0] * kb * y * (y / 1e-3) ** 2
        else:
            force = j, 0, -start[0] * np.gradient(np.gradient(rail[k])) * rate**2
        forces[c.key] = force
    return carried(case, fit.values, fit.terms, made, forces)


def _pair(case, fit, pair, candidates):
    """Secant change of a receptance by a candidate's matrix entries, to first order in its reach."""
    if not candidates:
        return {}
    model = case._blow_model(fit.values, fit.terms, pair, {})
    place = model.place_of(pair.sensor)
    u, v = model.displacement(pair.test.place), model.displacement(place)
    chain = blows.pair_chain(pair, fit.values, np.ones(pair.frequency.size, dtype=complex))
    omega, index, found = 2.0 * np.pi * pair.frequency, model.matrices.index, {}
    for c in candidates:
        term = c.term(c.starts[0]).under(pair.conditions)
        links = [*term.links(model.track), *blows.tangent((term,), model.track)]
        change = np.zeros(pair.frequency.size, dtype=complex)
        for link in links:
            ends = [(index[name], weight) for name, weight in link.ends if name in index]
            if len(ends) < len(link.ends):
                continue
            reach_u = sum(weight * u[:, row] for row, weight in ends)
            reach_v = sum(weight * v[:, row] for row, weight in ends)
            z = link.stiffness + 1j * omega * link.damping - omega**2 * link.mass
            change -= z * reach_u * reach_v
        if c.family == "attached_resonator":
            row = index[("rail", c.where["sleeper"])]
            change -= term.dynamic_stiffness(pair.frequency) * u[:, row] * v[:, row]
        found[c.key] = blows.split(change * chain)
    return found
