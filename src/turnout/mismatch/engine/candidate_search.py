"""Selection of the candidates that are refitted jointly, and of their starts.

Scores order the queue and decide nothing.

The size and evidence of an effect that a nuisance parameter may have absorbed follow in closed form from the base fit.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import Joint


def absorbed(case, fit):
    """(gain [nats], candidate, start, values) of every candidate with a ``masking_parameter`` among the nuisances.

    The estimate of the masking parameter is the effect, drawn towards the prior. ``values`` are all nuisance parameters
    with the masking parameter back at its mean and the effect in its place.
    """
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    found = []
    for candidate in case.candidates:
        k = index.get(candidate.twin)
        if k is None:
            continue
        twin = case.nuisances[k]
        m, s = fit.values[twin.name] - twin.mean, float(np.sqrt(fit.covariance[k, k]))
        opened = gain_when_opened(m, s, twin.sd, candidate.twin_sd)
        if opened is None:
            continue
        gain, size = opened
        shift = fit.covariance[: len(index), k] / s**2 * (size - m)
        values = {
            n.name: float(np.clip(fit.values[n.name] + d, *n.bounds)) for n, d in zip(case.nuisances, shift)
        }  # fmt: skip
        low, high = candidate.parameters[0].bounds
        start = np.clip([(candidate.from_twin or np.exp)(size)], low, high)
        found.append((gain - np.log(candidate.scanned), candidate, start, {**values, twin.name: twin.mean}))
    return found


def gain_when_opened(m, s, tau, wide):
    r"""(gain [nats], estimate) when a prior N(0, τ²), under which the posterior is N(m, s²), becomes N(0, T²).

    .. math:: s'^{-2} = s^{-2} - \tau^{-2}, \quad m' = m\, s'^2 / s^2, \quad
              g = \ln N(m'; 0, s'^2 + T^2) - \ln N(m'; 0, s'^2 + \tau^2)

    The estimate is that under the wide prior, :math:`m' T^2 / (s'^2 + T^2)`. None if the data add nothing to the prior.

    >>> gain_when_opened(0.0, 0.1, 0.1, 0.7) is None
    True
    """
    if s >= 0.999 * tau:
        return None
    own = 1.0 / (1.0 / s**2 - 1.0 / tau**2)
    free = m * own / s**2
    before, after = own + tau**2, own + wide**2
    gain = 0.5 * np.log(before / after) + 0.5 * free**2 * (1.0 / before - 1.0 / after)
    return float(gain), float(free * wide**2 / after)


NEAR = 0.95  # m, one and a half sleeper bays: effects of two families that are closer count as one
# m, two sleeper bays. A second effect of the same family that is closer is an error in the shape of the first.
ALIKE = 1.5
# Share of the required promise of a second effect, if only the cheap observations promise it: others will add to it.
CHEAP = 0.5
# Share of the leader's estimated gain. From the third candidate on, those that promise less are not refitted.
HOPELESS = 0.1


@dataclass(frozen=True)
class Entry:
    """A ``candidate`` to refit from ``start`` (n_term,) and nuisance ``values``.

    ``cheap_gain`` is the gain from the cheap observations alone [nats]. A ``rival`` is refitted only if another effect
    of its component gains something.
    """

    candidate: object
    start: np.ndarray
    values: dict
    promised: float = 0.0
    rival: bool = False


def shortlist(case, fit, settings, promising=()):
    """Tasks in order of promise.

    If predictions are cheap, every family is refitted from every start. In an expensive case, ``prescreen`` fits the
    families that show in the cheap observations. The others are scored by the columns of their starts
    (``Case.screen``), or by a prediction if there is no column. On top of a first effect, ``prescreen`` takes only
    families of the whole track, which the common parameters mask, and the ``promising`` ones (None: all). For the
    others the residual is small enough for columns.
    """
    from turnout.mismatch.engine.hammer_prescreen import scout

    candidates = [
        c for c in (*case.candidates, *case.further(fit)) if not any(_same_place(c, k) for k in fit.candidates)
    ]
    if not case.frozen_jacobian:
        return [Entry(c, np.asarray(s, dtype=float), {}) for c in candidates for s in c.starts]
    scored, scouted = {}, {}
    if fit.candidates and promising is not None:
        promising = {*promising, *(c.family for c in case.candidates if c.always and c.scanned == 1)}
    for found in scout(case, fit, settings, promising if fit.candidates else None):
        if found.candidate in candidates:
            entry = found.gain, found.candidate, found.psi, found.values
            scouted[found.candidate.key] = found.gain
            scored.setdefault(found.candidate.family, []).append(entry)
    for entry in absorbed(case, fit):
        if entry[1] in candidates:
            scored.setdefault(entry[1].family, []).append(entry)
    projector, columns = Projector(case, fit), case.screen(fit)
    for candidate, start in case.distant(fit):
        if candidate in candidates:
            entry = _from_afar(case, fit, projector, replace(candidate, starts=(start,), whole=True), candidate)
            scored.setdefault(candidate.family, []).append(entry)
    for candidate in candidates:
        if candidate.promise is not None:
            entry = candidate.promise, candidate, np.asarray(candidate.starts[0]), dict(candidate.begin)
            scored.setdefault(candidate.family, []).append(entry)
            continue
        for k in range(len(candidate.starts)):
            parts = columns.get((candidate.key, k))
            if parts is None:
                parts = _predicted(case, fit, candidate, k)
            gain, share = projector.score(parts, candidate, k)
            entry = 0.5 * gain - np.log(candidate.scanned), candidate, amplified(candidate, k, share), {}
            scored.setdefault(candidate.family, []).append(entry)
    found = [entry for entry in _promising(scored, settings) if entry[0] > _asked(entry, fit, scouted, settings)]
    least = HOPELESS * max((entry[0] for entry in found), default=0.0)
    chosen = [entry for rank, entry in enumerate(found) if rank < 2 or entry[0] > least]
    found = [(e, False) for e in chosen] + [(e, True) for e in _kin(chosen, scored)]
    found = [(_fitted_already(e, scored), rival) for e, rival in found]
    return [Entry(*e[1:], scouted.get(e[1].key, 0.0), rival) for e, rival in found]


def _from_afar(case, fit, projector, at_start, candidate):
    """Entry of a ``candidate`` simulated ``at_start``, with its masking parameter at the mean: no change is small."""
    back = {n.name: n.mean for n in case.nuisances if n.name == candidate.twin}
    parts = _predicted(case, replace(fit, values={**fit.values, **back}), at_start, 0)
    gain, _ = projector.score(parts, at_start, 0)
    return 0.5 * gain - np.log(candidate.scanned), candidate, np.array(at_start.starts[0]), back


def _asked(entry, fit, scouted, settings):
    """Promise from which an entry is refitted. Beside a first effect it must be that of a separate name. [nats]"""
    if not fit.candidates:
        return settings.promise
    by_cheap = entry[0] == scouted.get(entry[1].key)
    return settings.threshold * (CHEAP if by_cheap else 1.0)


def _fitted_already(entry, scored):
    """The entry, with start and nuisance parameters of the best fit of the same candidate, if there is one.

    A column is linear, and from it all nuisance parameters would have to return.
    """
    made = [e for e in scored[entry[1].family] if e[1].key == entry[1].key and e[3]]
    return max(made, key=lambda e: e[0], default=entry)


def _kin(chosen, scored):
    """Best starts of other effects on the components of the first two chosen: columns hardly separate them."""
    parts = [e[1].part for e in chosen if e[1].kin][:2]
    known, best = {(entry[1].family, entry[1].part) for entry in chosen}, {}
    for entry in sorted((e for entries in scored.values() for e in entries), key=lambda e: e[0]):
        law = entry[1].family, entry[1].part
        if entry[1].part in parts and law not in known:
            best[law] = entry
    return list(best.values())


def _same_place(candidate, accepted):
    """Whether a second effect at the position, sensor or train of an accepted one would only correct its shape.

    Not so for two exact effects, nor for an effect of all wheels beside one of a single wheel that is known by its
    impacts.
    """
    if candidate.key == accepted.key:
        return True
    a, b = candidate.where, accepted.where
    of_one_wheel = {(c.sounding, "axle" in c.where) for c in (candidate, accepted)}
    if (candidate.exact and accepted.exact) or of_one_wheel == {(True, True), (False, False)}:
        return False
    reach = ALIKE if candidate.family == accepted.family else NEAR
    near = "place" in a and "place" in b and abs(a["place"] - b["place"]) < reach
    return near or any(k in a and a[k] == b.get(k) for k in ("sensor", "train"))


def amplified(candidate, k, share):
    """The start with its first parameter at ``share`` of the distance from neutral. The others define its shape."""
    start = np.array(candidate.starts[k], dtype=float)
    start[0] = candidate.neutral[0] + share * (start[0] - candidate.neutral[0])
    return start


def _predicted(case, fit, candidate, k):
    """Change of the prediction at a start. None if the effect cannot be simulated at this size."""
    try:
        new = case.predict(fit.values, (*fit.terms, candidate.term(candidate.starts[k])), case.observations)
    except SimulationError:
        return None
    return [a - b for a, b in zip(new, fit.predictions)]


def _promising(scored, settings):
    """The best start of each of the first ``refits`` families. Of the first three also their second best site."""
    ranked = [sorted(entries, key=lambda e: -e[0]) for entries in scored.values()]
    ranked.sort(key=lambda entries: -entries[0][0])
    chosen = []
    for rank, entries in enumerate(ranked[: settings.refits]):
        chosen.append(entries[0])
        if rank < 3:
            chosen += [e for e in entries[1:] if e[1].key != entries[0][1].key][: settings.joint_starts - 1]
    return chosen


class Projector:
    """Scores columns against the residual of ``fit`` with its nuisances projected out."""

    def __init__(self, case, fit):
        self.joint, self.fit = Joint(case, fit.candidates), fit
        self.scaled, self.right = self.joint.stacked(fit.jacobian, fit.white, fit.scale)
        self.scaled *= self.joint.sd
        self.normal = np.linalg.inv(self.scaled.T @ self.scaled + np.eye(self.scaled.shape[1]))
        theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
        self.pull = (self.joint.mean - theta) / self.joint.sd
        self.shift = self.normal @ (self.scaled.T @ self.right + self.pull)

    def score(self, parts, candidate, start):
        r"""(gain, share): best gain in chi-squared along a column, and how much of it, within the bounds.

        .. math:: g = \max_a\, 2a\,c^T P r - a^2 c^T P c, \quad P = I - J (J^T J + I)^{-1} J^T

        with the distance of the nuisances from their priors included. A column that nuisances imitate scores low.
        """
        if parts is None:
            return 0.0, 1.0
        white = [o.whitened(p) if p.any() else p for o, p in zip(self.joint.observations, parts)]
        weight = [np.sqrt(o.effective / self.fit.scale[o.kind]) for o in self.joint.observations]
        column = np.concatenate([w * p for w, p in zip(weight, white)])
        across = self.scaled.T @ column
        size = float(column @ column - across @ self.normal @ across)
        slope = float(column @ self.right - across @ self.shift)
        if size <= 1e-12 * float(column @ column) or size <= 0.0:
            return 0.0, 1.0
        nearest = slope / size if not candidate.whole else 1.0
        share = float(np.clip(nearest, 0.1, _furthest(candidate, candidate.starts[start])))
        return 2.0 * share * slope - share**2 * size, share


def _furthest(candidate, start):
    """Largest multiple of the distance from neutral to ``start`` within the bounds, at most 3."""
    reach = 3.0
    for p, s in list(zip(candidate.parameters, start))[:1]:
        way = s - p.neutral
        if way:
            limit = p.bounds[1] if way > 0 else p.bounds[0]
            reach = min(reach, abs(limit - p.neutral) / abs(way))
    return max(reach, 0.1)
