r"""What the residual is locked to: evidence for linear subspaces of the recordings.

A cause that is fixed to a place acts by a force there, whatever its history: what it adds to all sensors lies in the
subspace that the track's transfer functions from that place span. A fault of a channel lies in the channel, a
disturbance of one recording in all its channels at once. With an unknown amplitude each is a random effect,

.. math:: r \sim N(0,\; \nu I + a^2 B B^T)

whose evidence over :math:`N(0, \nu I)` is found in closed form from the eigenvalues of :math:`B^T B`, with ν and a at
their best values, ν not below what sound recordings leave.
"""

from dataclasses import dataclass, field

import numpy as np

from turnout.mismatch.shortlist import Projector

AMPLITUDES = np.concatenate([[0.0], np.geomspace(0.03, 3e4, 21)])
NOISE = np.geomspace(1.0, 100.0, 25)


@dataclass(frozen=True)
class Space:
    """Columns on some observations, and what subspaces of them belong to.

    ``names`` of the observations, ``columns`` (n, k) on them one behind the other in the unit of the data;
    ``parts`` (frame, level) -> (k, m) combinations of the columns, None for all of them.
    """

    names: tuple[str, ...]
    columns: np.ndarray
    parts: dict


@dataclass(frozen=True)
class Witness:
    """Evidence [nats] that the residual is locked to ``level`` of ``frame``, ``by`` name of the space."""

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
    """Witnesses in order of evidence, for the residual of ``fit``; ``floor`` by kind: mean square of sound recordings.

    Columns are whitened and the nuisances projected out of them under their priors, as they are out of the residual.
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
