"""Collect the wheel contacts and the ports of terms into the arrays of the time march, in order of position."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.blade import is_on_blade
from turnout.simulate.force_laws import ForceLaw, TableLaw
from turnout.simulate.links import ports_of
from turnout.simulate.state import PortArrays

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.simulate.force_laws import Port
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.vehicle import Vehicle
    from turnout.simulate.wheel_path import PathPart

# position at time 0 [m], row of the body, wheel, surface, line, law
Contact = tuple[float, int, int, int, int, ForceLaw]


def contact_ports(
    vehicle: Vehicle, surfaces: Sequence[Sequence[PathPart]], start: float, direction: int
) -> list[Contact]:
    """(position, body row, wheel, surface, line, law) of each contact: every wheel on every surface of the route.

    Parameters
    ----------
    vehicle : Vehicle
        The train.
    surfaces : sequence of sequences of path parts
        Surfaces of the route.
    start : float
        Position of the first wheel at time 0. [m]
    direction : int
        1 towards growing x, -1 the other way.

    Returns
    -------
    list of tuple
        Position at time 0 [m], row of the body, number of wheel, surface and line, force law. A surface with a part of
        the path that is ``on_blade`` belongs to line 1.
    """
    rows, contacts = vehicle.wheel_rows, []
    for wheel, (offset, law) in enumerate(zip(vehicle.wheel_positions, vehicle.wheel_values("contact"))):
        for surface in range(len(surfaces)):
            line = int(is_on_blade(surfaces[surface]))
            contacts.append((start - direction * offset, int(rows[wheel]), wheel, surface, line, law))
    return contacts


def fixed_ports(prepared: Prepared) -> list[Port]:
    """Ports that the terms of a prepared track add, and those of the slide chairs of a blade.

    Parameters
    ----------
    prepared : Prepared
        The factorised track.

    Returns
    -------
    list of Port
        Ports in the order of the terms, then of the chairs.
    """
    ports = ports_of(prepared.terms, prepared.track)
    blade = prepared.track.blade
    return ports if blade is None else [*ports, *blade.ports(prepared.track, {port.ends for port in ports})]


def port_arrays(
    prepared: Prepared, contacts: Sequence[Contact], fixed: Sequence[Port], path_of: Mapping[tuple[int, int], int]
) -> tuple[PortArrays, list[int]]:
    """``PortArrays`` in order of position, and this order as indices: contacts first, then fixed ports.

    ``path_of`` (wheel, surface) -> index of the path.

    Parameters
    ----------
    prepared : Prepared
        The factorised track.
    contacts : sequence of tuple
        From ``contact_ports``.
    fixed : sequence of Port
        From ``fixed_ports``.
    path_of : mapping
        Index of the path of each wheel and surface.

    Returns
    -------
    (PortArrays, list of int)
        Arrays, and for each port of them its number among contacts and fixed ports.

    Raises
    ------
    SimulationError
        For a port at more than 4 degrees of freedom, at none, or at one that the track does not have.
    """
    entries = []
    for position, row, wheel, surface, line, law in contacts:
        entries.append(
            (position, row, wheel, path_of[wheel, surface], np.zeros(4, dtype=np.int64), np.zeros(4), 0.0, law, line)
        )
    for port in fixed:
        rows, weights, position = _fixed_entry(prepared, port)
        entries.append((position, -1, -1, -1, rows, -weights, port.gap, port.law, 0))
    order = sorted(range(len(entries)), key=lambda k: entries[k][0])
    entries = [entries[k] for k in order]
    tables = [_law_table(e[7]) for e in entries]
    column = [np.array([e[k] for e in entries]) for k in (0, 1, 2, 3, 6, 8)]
    arrays = PortArrays(
        column[1].astype(np.int64),
        column[2].astype(np.int64),
        column[3].astype(np.int64),
        column[5].astype(np.int64),
        column[0].astype(float),
        np.array([e[4] for e in entries], dtype=np.int64).reshape(-1, 4),
        np.array([e[5] for e in entries]).reshape(-1, 4),
        column[4].astype(float),
        np.array([e[7].law_code for e in entries], dtype=np.int64),
        np.array([e[7].numbers for e in entries]).reshape(-1, 3).astype(float),
        np.concatenate([[0], np.cumsum([t.shape[1] for t in tables])]).astype(np.int64),
        np.ascontiguousarray(np.concatenate([*tables, np.zeros((3, 2))], axis=1)),
    )
    return arrays, order


def _fixed_entry(prepared: Prepared, port: Port) -> tuple[np.ndarray, np.ndarray, float]:
    if not 1 <= len(port.ends) <= 4:
        raise SimulationError(f"port {port.label!r}: acts on {len(port.ends)} degrees of freedom, 1 to 4 are possible.")
    matrices = prepared.matrices
    rows, weights = np.zeros(4, dtype=np.int64), np.zeros(4)
    for k, (name, weight) in enumerate(port.ends):
        if name not in matrices.index:
            raise SimulationError(f"port {port.label!r}: the track has no degree of freedom {name!r}.")
        rows[k], weights[k] = matrices.index[name], weight
    return rows, weights, float(prepared.track.support[port.ends[0][0][1]])


def _law_table(law: ForceLaw) -> np.ndarray:
    if not isinstance(law, TableLaw):
        return np.zeros((3, 0))
    return np.array([law.deformation, law.elastic, law.viscous], dtype=float)
