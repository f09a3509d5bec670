r"""Localization of a residual that has no name: position, channel, wheel or clock, by evidence for linear subspaces.

A cause that is fixed to a position acts by a force there. Whatever the force is, its effect on all sensors lies in the
subspace of the track's transfer functions from that position. A fault of a channel lies in the channel, a disturbance
of one recording in all its channels at once. With an unknown amplitude each is a random effect,

.. math:: r \sim N(0,\; \nu I + a^2 B B^T)

whose evidence over :math:`N(0, \nu I)` follows in closed form from the eigenvalues of :math:`B^T B`, with ν and a at
their best values, ν not below the level of intact recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.candidate_search import Projector
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.residual_space import ResidualSpace
    from turnout.mismatch.engine.score import Score

AMPLITUDES = np.concatenate(
    [[0.0], np.geomspace(THRESHOLDS.min_amplitude, THRESHOLDS.max_amplitude, THRESHOLDS.n_amplitudes)]
)
NOISE_FACTORS = np.geomspace(1.0, THRESHOLDS.max_noise_factor, THRESHOLDS.n_noise_factors)


@dataclass(frozen=True)
class SpaceEvidence:
    """Evidence [nats] that the residual is fixed to ``level`` of ``frame``; ``by_space`` nats by name of the space."""

    frame: str
    level: Any
    nats: float
    by_space: dict[str, float] = field(default_factory=dict)


def subspace_evidence(gram: np.ndarray, inner: np.ndarray, square: float, n: int, floor: float) -> float:
    r"""Gain in log likelihood of a residual by a random effect in a subspace.

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
        :math:`r^T r`.
    n : int
        Number of samples of the residual.
    floor : float
        Mean square of intact recordings.

    Returns
    -------
    float
        At least 0. [nats]
    """
    eigenvalues, eigenvectors = np.linalg.eigh(gram)
    keep = eigenvalues > 1e-9 * max(eigenvalues[-1], 1e-300)
    eigenvalues = eigenvalues[keep]
    squared_projections = (eigenvectors[:, keep].T @ inner) ** 2 / eigenvalues
    outside, k = max(square - float(squared_projections.sum()), 0.0), eigenvalues.size
    eigenvalues = eigenvalues / eigenvalues.mean()
    noise = floor * NOISE_FACTORS
    variance = noise[:, None, None] + AMPLITUDES[:, None] * eigenvalues
    inside = np.sum(np.log(variance) + squared_projections / variance, axis=2)
    log_likelihood = -0.5 * ((n - k) * np.log(noise) + outside / noise + inside.T)
    return max(0.0, float(log_likelihood.max() - log_likelihood[0].max()))


def weigh_spaces(case: Case, fit: Fit, floor: Mapping[str, float]) -> list[SpaceEvidence]:
    """Evidence for each level of each frame, for the residual of a fit.

    Columns are whitened. The nuisances are projected out of them under their priors, as they are out of the residual.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    floor : mapping
        Data type -> mean square of intact recordings.

    Returns
    -------
    list of SpaceEvidence
        The largest first.
    """
    projector, n_samples = Projector(case, fit), 0
    offsets: dict[str, tuple[int, int]] = {}
    for k, o in enumerate(case.observations):
        offsets[o.name] = k, n_samples
        n_samples += o.data.size
    by_level: dict[tuple[str, Any], dict[str, float]] = {}
    for space in case.residual_spaces(fit):
        members = [(case.observations[offsets[name][0]], *offsets[name]) for name in space.names]
        columns = _project_out(projector, space.columns, members)
        residual = np.concatenate([np.asarray(fit.white[k]) for _, k, _ in members])
        first_member = members[0][0]
        for key, nats in _level_evidence(space, columns, residual, floor[first_member.data_type]):
            by_level.setdefault(key, {})[space.names[0]] = first_member.effective * nats
    witnesses = [
        SpaceEvidence(frame, level, sum(by_space.values()), by_space) for (frame, level), by_space in by_level.items()
    ]
    return sorted(witnesses, key=lambda w: -w.nats)


def _project_out(
    projector: Projector, columns: np.ndarray, members: Sequence[tuple[Observation, int, int]]
) -> np.ndarray:
    """(n, k) columns whitened, less what the nuisances can imitate of them under their priors."""
    white_parts, row_parts, first = [], [], 0
    for o, _, start in members:
        white_parts.append(o.whiten(columns[first : first + o.data.size]))
        row_parts.append(projector.scaled[start : start + o.data.size])
        first += o.data.size
    white, rows = np.concatenate(white_parts), np.concatenate(row_parts)
    return white - rows @ (projector.normal @ (rows.T @ white))


def _level_evidence(
    space: ResidualSpace, columns: np.ndarray, residual: np.ndarray, floor: float
) -> Iterator[tuple[tuple[str, Any], float]]:
    gram, inner, square = columns.T @ columns, columns.T @ residual, float(residual @ residual)
    for key, combination in space.combinations.items():
        if combination is None:
            yield key, subspace_evidence(gram, inner, square, residual.size, floor)
        else:
            yield (
                key,
                subspace_evidence(
                    combination.T @ gram @ combination, combination.T @ inner, square, residual.size, floor
                ),
            )


@dataclass(frozen=True)
class Location:
    """Location of a residual.

    ``frame`` and ``level`` with the largest evidence ``nats``. ``place`` with its interval ``low`` to ``high`` [m],
    ``sensor``, ``train`` and ``axle`` if it has them. ``next_best`` frame -> nats of the other frames.
    ``measured_range`` first and last position of sensors and impacts [m]: beyond them positions cannot be
    distinguished.
    """

    frame: str
    level: Any
    nats: float
    place: float | None = None
    low: float | None = None
    high: float | None = None
    sensor: str | None = None
    train: str | None = None
    axle: int | None = None
    next_best: dict[str, float] = field(default_factory=dict)
    measured_range: tuple[float, float] = (float("-inf"), float("inf"))

    def __str__(self) -> str:
        if self.place is not None and not self.measured_range[0] <= self.place <= self.measured_range[1]:
            before = self.place < self.measured_range[0]
            end = self.measured_range[0] if before else self.measured_range[1]
            return f"{'before' if before else 'beyond'} {end:.1f} m, the distance is not known"
        if self.place is not None:
            return f"at {self.place:.1f} m, between {self.low:.1f} and {self.high:.1f} m"
        if self.axle is not None:
            return f"on axle {self.axle} of {self.train}"
        if self.frame == "train":
            return f"on {self.train}"
        if self.frame == "sensor":
            return f"in channel {self.sensor}"
        if self.frame == "clock":
            return f"in recording {self.level}, in any state of the wheels"
        return {"frequency": "along the whole track", "condition": f"in the tests of {self.level}"}.get(
            self.frame, f"locked to {self.frame} {self.level}"
        )


def locate(case: Case, fit: Fit, leader: Score | None = None, cause: str = "") -> Location | None:
    """Location of the residual of a fit.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    leader : Score or None
        The best candidate that got no name.
    cause : str
        "clock" or "train" if recordings that were not fitted are the cause of the verdict: they give the location then.

    Returns
    -------
    Location or None
        None if the case has no residual spaces, or none of them exceeds the level of intact recordings.
    """
    if cause == "clock":
        names = ", ".join(d.name for d in case.disturbed_recordings)
        return Location("clock", names, max(d.excess for d in case.disturbed_recordings))
    if cause == "train":
        return Location("train", case.mismatched_trains[0], 0.0, train=case.mismatched_trains[0])
    floor = {o.data_type: case.control_level.get(o.data_type, 1.0) for o in case.observations}
    witnesses = sorted(_credible_evidence(case, weigh_spaces(case, fit, floor)), key=lambda w: -w.nats)
    if (
        leader is not None
        and leader.explained >= THRESHOLDS.min_explained_share
        and (not witnesses or leader.gain > witnesses[0].nats)
    ):
        return replace(_location_of_candidate(leader), measured_range=case.measured_range)
    return replace(_location_of_evidence(witnesses), measured_range=case.measured_range) if witnesses else None


def _credible_evidence(case: Case, witnesses: Sequence[SpaceEvidence]) -> Iterator[SpaceEvidence]:
    """Evidence that counts: of a wheel, less that of wheels of other trains, which belongs to the rail; of a channel,
    only if impacts, if any, support it.
    """
    hammer_names = {o.name for o in case.observations if case.is_cheap(o)}
    for w in witnesses:
        nats = w.nats
        if w.frame == "wheel":
            nats -= max((v.nats for v in witnesses if v.frame == "wheel" and v.level[0] != w.level[0]), default=0.0)
        if (
            w.frame == "sensor"
            and hammer_names
            and sum(w.by_space.get(name, 0.0) for name in hammer_names) < THRESHOLDS.min_hammer_evidence
        ):
            continue
        if nats > 0.0:
            yield replace(w, nats=nats)


def _location_of_candidate(score: Score) -> Location:
    where = score.candidate.where
    position = where.get("place")
    position = position if isinstance(position, (int, float)) else None  # words have no coordinate
    return Location(
        score.candidate.frame, score.candidate.key, score.gain, position, position, position, where.get("sensor"),
        where.get("train"), where.get("axle"),
    )  # fmt: skip


def _location_of_evidence(witnesses: Sequence[SpaceEvidence]) -> Location:
    strongest, by_frame = witnesses[0], dict[str, float]()
    for w in witnesses:
        by_frame.setdefault(w.frame, w.nats)
    fields: dict[str, Any] = {"next_best": {k: round(v, 1) for k, v in by_frame.items() if k != strongest.frame}}
    if strongest.frame == "place":
        positions = [
            w.level for w in witnesses if w.frame == "place" and strongest.nats - w.nats < THRESHOLDS.position_margin
        ]
        fields |= {"place": strongest.level, "low": min(positions), "high": max(positions)}
    elif strongest.frame == "wheel":
        fields |= {"train": strongest.level[0], "axle": strongest.level[1]}
    elif strongest.frame in ("sensor", "train"):
        fields[strongest.frame] = strongest.level
    return Location(strongest.frame, strongest.level, strongest.nats, **fields)
