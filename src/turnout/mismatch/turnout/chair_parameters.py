r"""Stiffness and damping of the slide chairs and fastenings of a blade, common to all of them, as nuisances.

A wheel on the blade is carried by them, and the stock rail moves only with the bearers: 15 % of their stiffness change
the signals behind the change by 40 %. The derivative of a receptance by the logarithm of a value is that of all links
that follow it,

.. math:: \frac{\partial H_{pq}}{\partial \ln k} = -\sum_l Z_l\, m_{lp} m_{lq}, \quad Z_l = k_l + i\omega c_l

with the motions m of the ends of link l under unit forces; links of terms, as of a gap, follow with their sign.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.priors import RECEPTANCE, TRACK
from turnout.mismatch.turnout.receptance_observation import SHIFTED_LINES
from turnout.simulate.matrices import link_vector

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.receptance_model import ReceptanceModel
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

# Field of a Blade, prior sd of its logarithm: as of pads, since a chair carries through a plate of the same kind.
CHAIR_PARAMETERS = {
    "chair_stiffness": TRACK.common_stiffness_sd,
    "chair_damping": TRACK.common_damping_sd,
}


def chair_nuisances(tracks: Iterable[Track]) -> list[Nuisance]:
    """Logarithms of factors on the values of all chairs; [] without a blade.

    Parameters
    ----------
    tracks : iterable of Track
        Those of all routes.

    Returns
    -------
    list of Nuisance
    """
    bounds = (-TRACK.common_bound, TRACK.common_bound)
    if all(track.blade is None for track in tracks):
        return []
    return [
        Nuisance(name, "-", 0.0, sd, bounds=bounds, meaning=f"ln {name}", group="track")
        for name, sd in CHAIR_PARAMETERS.items()
    ]


def with_chairs(track: Track, values: Values) -> Track:
    """The track with the factors of ``values`` on its chairs.

    Parameters
    ----------
    track : Track
        The track.
    values : mapping
        Nuisances by name.

    Returns
    -------
    Track
        The same one where no value of a chair differs from the file.
    """
    deviations = chair_values(values)
    if track.blade is None or not any(deviations):
        return track
    changes = {n: getattr(track.blade, n) * float(np.exp(v)) for n, v in zip(CHAIR_PARAMETERS, deviations)}
    return track.with_(blade=replace(track.blade, **changes))


def chair_values(values: Values) -> tuple[float, ...]:
    """Deviations of the chairs, in the order of ``CHAIR_PARAMETERS``.

    Parameters
    ----------
    values : mapping
        Nuisances by name.

    Returns
    -------
    tuple of float
    """
    return tuple(float(values.get(name, 0.0)) for name in CHAIR_PARAMETERS)


def chair_gradients(sensitivity: ReceptanceSensitivity) -> dict[str, np.ndarray]:
    """Derivatives of all receptances by the values that all chairs have in common.

    Parameters
    ----------
    sensitivity : ReceptanceSensitivity
        Receptances of all pairs on one track.

    Returns
    -------
    dict
        Name -> (n_pair, n_line) array of complex [m/N]; {} without a blade.
    """
    return {name: np.sum(columns, axis=1) for name, columns in chair_columns(sensitivity).items()}


def chair_columns(sensitivity: ReceptanceSensitivity) -> dict[str, np.ndarray]:
    """Derivatives of all receptances by the values of each chair.

    Parameters
    ----------
    sensitivity : ReceptanceSensitivity
        Receptances of all pairs on one track.

    Returns
    -------
    dict
        Name -> (n_pair, n_chair, n_line) array of complex [m/N]; {} without a blade.
    """
    model, omega, columns = sensitivity.model, 2.0 * np.pi * SHIFTED_LINES, {}
    if model.track.blade is None:
        return {}
    for name in CHAIR_PARAMETERS:
        rows, weights, changes = zip(*_following(model, name))
        first = np.cumsum([0, *(r.size for r in rows)])
        shape = (len(rows), model.matrices.n)
        excited, measured = sensitivity.motions(
            csr_array((np.concatenate(weights), np.concatenate(rows), first), shape)
        )
        k, c = np.array(changes).T[:, :, None]
        columns[name] = -(k + 1j * omega * c) * excited * measured
    return columns


def _following(model: ReceptanceModel, name: str) -> list[tuple[np.ndarray, np.ndarray, tuple[float, float]]]:
    """(rows, weights, (k, c) per logarithm of a value) of the links that follow it."""
    blade = model.track.blade
    assert blade is not None
    changed = replace(blade, **{name: getattr(blade, name) * (1.0 + RECEPTANCE.relative_step)})
    tracks = model.track, model.track.with_(blade=changed)
    pairs = [_links_of(model, track) for track in tracks]
    return [(*link_vector(a, model.matrices.index), _change(a, b)) for a, b in zip(*pairs) if any(_change(a, b))] or [
        (np.zeros(1, dtype=int), np.zeros(1), (0.0, 0.0))
    ]


def _links_of(model: ReceptanceModel, track: Track) -> list[Link]:
    """All chairs, and the links of the terms."""
    assert track.blade is not None
    return [*(track.blade.chair_link(j) for j in track.blade.chairs(track)), *model.links(model.terms, track)]


def _change(before: Link, after: Link) -> tuple[float, float]:
    """Stiffness and damping of a link per logarithm of a value."""
    step = RECEPTANCE.relative_step
    return (after.stiffness - before.stiffness) / step, (after.damping - before.damping) / step
