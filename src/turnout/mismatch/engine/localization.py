r"""Localization of a residual that has no name: position, channel, wheel or clock, by evidence for linear subspaces.

A cause that is fixed to a position acts by a force there. Whatever the force is, its effect on all sensors lies in the
subspace of the track's transfer functions from that position. A fault of a channel lies in the channel, a disturbance
of one recording in all its channels at once. With an unknown amplitude each is a random effect,

.. math:: r \sim N(0,\; \nu I + a^2 B B^T)

whose evidence over :math:`N(0, \nu I)` follows in closed form from the eigenvalues of :math:`B^T B`, with ν and a at
their best values, ν not below the level of intact recordings.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.mismatch.engine.candidate_search import Projector

AMPLITUDES = np.concatenate([[0.0], np.geomspace(0.03, 3e4, 21)])
NOISE = np.geomspace(1.0, 100.0, 25)


@dataclass(frozen=True)
class Space:
    """Columns on some observations, and the subspaces of them.

    ``names`` of the observations. ``columns`` (n, k) on them one behind the other, in the unit of the data.
    ``combinations`` (frame, level) -> (k, m) combinations of the columns, None for all of them.
    """

    names: tuple[str, ...]
    columns: np.ndarray
    parts: dict


@dataclass(frozen=True)
class Witness:
    """Evidence [nats] that the residual is fixed to ``level`` of ``frame``; ``by_space`` nats by name of the space."""

    frame: str
    level: object
    nats: float
    by: dict = field(default_factory=dict)


def evidence(gram, inner, square, n, floor):
    r"""Gain in log likelihood of a residual by a random effect in a subspace, at least 0. [nats]

    With eigenvalues λ of :math:`B^T B` scaled to mean 1 and u the residual along the eigenvectors,

    .. math:: -\tfrac12\left[(n-k)\ln\nu + \frac{r^2 - u^2}{\nu}
              + \sum_i \ln(\nu + a^2\lambda_i) + \frac{u_i^2}{\nu + a^2\lambda_i}\right]

    maximised over a and ν ≥ ``floor``, less its maximum over ν with a = 0.

    Parameters
    ----------
    gram : (k, k) array of float
        :math:`B^T B`.
    inner : (k,) array of float
        :math:`B^T r`.
    square : float
        :math:`r^T r`, of ``n`` samples.
    """
    power, turn = np.linalg.eigh(gram)
    keep = power > 1e-9 * max(power[-1], 1e-300)
    power = power[keep]
    along = (turn[:, keep].T @ inner) ** 2 / power
    rest, k = max(square - float(along.sum()), 0.0), power.size
    power = power / power.mean()
    noise = floor * NOISE
    variance = noise[:, None, None] + AMPLITUDES[:, None] * power
    inside = np.sum(np.log(variance) + along / variance, axis=2)
    with_it = -0.5 * ((n - k) * np.log(noise) + rest / noise + inside.T)
    return max(0.0, float(with_it.max() - with_it[0].max()))


def weigh(case, fit, floor):
    """Evidence for each level, largest first, for the residual of ``fit``.

    ``floor`` by data type is the mean square of intact recordings. Columns are whitened. The nuisances are projected
    out of them under their priors, as they are out of the residual.
    """
    projector, where, first = Projector(case, fit), {}, 0
    for k, o in enumerate(case.observations):
        where[o.name] = k, first
        first += o.data.size
    found = {}
    for space in case.spaces(fit):
        members = [(case.observations[where[name][0]], *where[name]) for name in space.names]
        columns = _projected(projector, space.columns, members)
        residual = np.concatenate([np.asarray(fit.white[k]) for _, k, _ in members])
        one = members[0][0]
        for key, nats in _weighed(space, columns, residual, floor[one.kind]):
            found.setdefault(key, {})[space.names[0]] = one.effective * nats
    witnesses = [Witness(*key, sum(by.values()), by) for key, by in found.items()]
    return sorted(witnesses, key=lambda w: -w.nats)


def _projected(projector, columns, members):
    """(n, k) columns whitened, less what the nuisances can imitate of them under their priors."""
    white, rows, first = [], [], 0
    for o, _, start in members:
        white.append(o.whitened(columns[first : first + o.data.size]))
        rows.append(projector.scaled[start : start + o.data.size])
        first += o.data.size
    white, rows = np.concatenate(white), np.concatenate(rows)
    return white - rows @ (projector.normal @ (rows.T @ white))


def _weighed(space, columns, residual, floor):
    gram, inner, square = columns.T @ columns, columns.T @ residual, float(residual @ residual)
    for key, part in space.parts.items():
        if part is None:
            yield key, evidence(gram, inner, square, residual.size, floor)
        else:
            yield key, evidence(part.T @ gram @ part, part.T @ inner, square, residual.size, floor)


HEARD = 6.0  # nats that impacts must add before a channel is blamed: its fault shows in impacts, too
AS_GOOD = 6.0  # nats within which positions are not distinguished: odds of 400 to 1, less the errors of the model
EXPLAINS = 0.25  # share of the excess from which a rejected candidate counts as evidence for its site


@dataclass(frozen=True)
class Whereabouts:
    """Location of a residual.

    ``frame`` and ``level`` with the largest evidence ``nats``. ``place`` with its interval ``low`` to ``high`` [m],
    ``sensor``, ``train`` and ``axle`` if it has them. ``next_best`` frame -> nats of the other frames.
    ``measured_range`` first and last position of sensors and impacts [m]: beyond them positions cannot be
    distinguished.
    """

    frame: str
    level: object
    nats: float
    place: float | None = None
    low: float | None = None
    high: float | None = None
    sensor: str | None = None
    train: str | None = None
    axle: int | None = None
    others: dict = field(default_factory=dict)
    measured: tuple = (float("-inf"), float("inf"))

    def __str__(self):
        if self.place is not None and not self.measured[0] <= self.place <= self.measured[1]:
            before = self.place < self.measured[0]
            end = self.measured[0] if before else self.measured[1]
            return f"{'before' if before else 'beyond'} {end:.1f} m, how far cannot be told"
        if self.place is not None:
            return f"at {self.place:.1f} m, between {self.low:.1f} and {self.high:.1f} m"
        if self.axle is not None:
            return f"on axle {self.axle} of {self.train}"
        if self.frame == "train":
            return f"on {self.train}"
        if self.frame == "sensor":
            return f"in channel {self.sensor}"
        if self.frame == "clock":
            return f"in recording {self.level}, whatever the wheels do"
        return {"frequency": "along the whole track", "condition": f"in the tests of {self.level}"}.get(
            self.frame, f"locked to {self.frame} {self.level}"
        )


def whereabouts(case, fit, refused=None, cause=""):
    """Location of the residual of ``fit``. ``leader`` is the Score of the best candidate that got no name, or None.

    If recordings that were not fitted are the ``cause`` of the verdict, they give the location. None if the case has no
    residual spaces, or none of them exceeds the level of intact recordings.
    """
    if cause == "clock":
        names = ", ".join(d.name for d in case.disturbed)
        return Whereabouts("clock", names, max(d.louder for d in case.disturbed))
    if cause == "train":
        return Whereabouts("train", case.foreign[0], 0.0, train=case.foreign[0])
    floor = {o.kind: case.control_level.get(o.kind, 1.0) for o in case.observations}
    witnesses = sorted(_alone(case, weigh(case, fit, floor)), key=lambda w: -w.nats)
    heard = refused is not None and refused.explained >= EXPLAINS
    if heard and (not witnesses or refused.gain > witnesses[0].nats):
        return replace(_of_candidate(refused), measured=case.measured)
    return replace(_of_witnesses(witnesses), measured=case.measured) if witnesses else None


def _alone(case, witnesses):
    """Evidence that counts: of a wheel, less that of wheels of other trains, which belongs to the rail; of a channel,
    only if impacts, if any, support it.
    """
    blows = {o.name for o in case.observations if case.cheap(o)}
    for w in witnesses:
        nats = w.nats
        if w.frame == "wheel":
            nats -= max((v.nats for v in witnesses if v.frame == "wheel" and v.level[0] != w.level[0]), default=0.0)
        if w.frame == "sensor" and blows and sum(w.by.get(name, 0.0) for name in blows) < HEARD:
            continue
        if nats > 0.0:
            yield replace(w, nats=nats)


def _of_candidate(score):
    where = score.candidate.where
    place = where.get("place")
    return Whereabouts(
        score.candidate.frame, score.candidate.key, score.gain, place, place, place, where.get("sensor"),
        where.get("train"), where.get("axle"),
    )  # fmt: skip


def _of_witnesses(witnesses):
    best, others = witnesses[0], {}
    for w in witnesses:
        others.setdefault(w.frame, w.nats)
    told = {"others": {k: round(v, 1) for k, v in others.items() if k != best.frame}}
    if best.frame == "place":
        near = [w.level for w in witnesses if w.frame == "place" and best.nats - w.nats < AS_GOOD]
        told |= {"place": best.level, "low": min(near), "high": max(near)}
    elif best.frame == "wheel":
        told |= {"train": best.level[0], "axle": best.level[1]}
    elif best.frame in ("sensor", "train"):
        told[best.frame] = best.level
    return Whereabouts(best.frame, best.level, best.nats, **told)
