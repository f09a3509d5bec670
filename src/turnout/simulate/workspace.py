"""Arrays that the time march overwrites in each step, created once for a march."""

from typing import NamedTuple

import numpy as np


class Workspace(NamedTuple):
    """Arrays of one march.

    ``d``, ``e`` and ``e_stand_in`` are the stage increments of track, bodies and stand-in tracks, ``mass_v`` and
    ``stiff_u`` products of the track's matrices. Of each port: its ``element`` and its place in the ``order`` along the
    track. Of each port stage: position ``x``, ``rows``, ``weights``, ``local`` compliance, ``share`` of the stand-in
    track, ``dip``, deformation without forces ``d0`` and with forces ``deformed``, law force ``f``, its derivatives.
    ``g`` is their flexibility, ``fixed_response`` that of the track to ports at fixed points; ``matrix``, ``right``,
    ``active`` and ``change`` belong to a Newton step.
    """

    d: np.ndarray
    e: np.ndarray
    e_stand_in: np.ndarray
    mass_v: np.ndarray
    stiff_u: np.ndarray
    fixed_response: np.ndarray
    element: np.ndarray
    order: np.ndarray
    rows: np.ndarray
    active: np.ndarray
    weights: np.ndarray
    g: np.ndarray
    matrix: np.ndarray
    x: np.ndarray
    local: np.ndarray
    share: np.ndarray
    dip: np.ndarray
    d0: np.ndarray
    deformed: np.ndarray
    f: np.ndarray
    by_d: np.ndarray
    by_rate: np.ndarray
    change: np.ndarray
    right: np.ndarray


def new_workspace(n_padded: int, n: int, n_body_row: int, n_wheel: int, n_port: int, tau: np.ndarray) -> Workspace:
    """Workspace of zeros, the ports in their own order.

    Parameters
    ----------
    n_padded : int
        Degrees of freedom of the track, with padding.
    n : int
        The same without padding.
    n_body_row : int
        Rows of the bodies.
    n_wheel : int
        Stand-in tracks.
    n_port : int
        Ports.
    tau : (n_stage_of_scheme,) array
        Of the scheme; increments are complex where it is.

    Returns
    -------
    Workspace
    """
    n_stage, zero = n_port * tau.size, 0.0 * tau[0]
    values = np.zeros((11, n_stage))
    return Workspace(
        np.full(n_padded, zero),
        np.full(n_body_row, zero),
        np.full(n_wheel, zero),
        np.zeros(n),
        np.zeros(n),
        np.full((n_port, n), zero),
        np.zeros(n_port, dtype=np.int64),
        np.arange(n_port),
        np.zeros((n_stage, 4), dtype=np.int64),
        np.zeros(n_stage, dtype=np.int64),
        np.zeros((n_stage, 4)),
        np.zeros((n_stage, n_stage)),
        np.zeros((n_stage, n_stage)),
        values[0],
        values[1],
        values[2],
        values[3],
        values[4],
        values[5],
        values[6],
        values[7],
        values[8],
        values[9],
        values[10],
    )
