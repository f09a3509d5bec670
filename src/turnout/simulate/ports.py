"""Collect the wheel contacts and the ports of terms into the arrays of the time march, in order of position."""

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.force_laws import TABLE
from turnout.simulate.links import ports_of
from turnout.simulate.state import PortArrays


def contact_ports(vehicle, surfaces, start, direction):
    """(position, body row, wheel, surface, law) of each contact: every wheel on every surface of the route."""
    rows, contacts = vehicle.wheel_rows, []
    for wheel, (offset, law) in enumerate(zip(vehicle.wheel_positions, vehicle.wheel_values("contact"))):
        for surface in range(len(surfaces)):
            contacts.append((start - direction * offset, int(rows[wheel]), wheel, surface, law))
    return contacts


def fixed_ports(prepared):
    """Ports that the terms of a prepared track add."""
    return ports_of(prepared.terms, prepared.track)


def port_arrays(prepared, contacts, fixed, path_of):
    """``PortArrays`` in order of position, and this order as indices: contacts first, then fixed ports.

    ``path_of`` (wheel, surface) -> index of the path.
    """
    entries = []
    for position, row, wheel, surface, law in contacts:
        entries.append(
            (position, row, wheel, path_of[wheel, surface], np.zeros(4, dtype=np.int64), np.zeros(4), 0.0, law)
        )
    for port in fixed:
        rows, weights, position = _fixed_entry(prepared, port)
        entries.append((position, -1, -1, -1, rows, -weights, port.gap, port.law))
    order = sorted(range(len(entries)), key=lambda k: entries[k][0])
    entries = [entries[k] for k in order]
    tables = [_law_table(e[7]) for e in entries]
    column = [np.array([e[k] for e in entries]) for k in (0, 1, 2, 3, 6)]
    arrays = PortArrays(
        column[1].astype(np.int64),
        column[2].astype(np.int64),
        column[3].astype(np.int64),
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


def _fixed_entry(prepared, port):
    if not 1 <= len(port.ends) <= 4:
        raise SimulationError(f"port {port.label!r}: acts on {len(port.ends)} degrees of freedom, 1 to 4 are possible.")
    matrices = prepared.matrices
    rows, weights = np.zeros(4, dtype=np.int64), np.zeros(4)
    for k, (name, weight) in enumerate(port.ends):
        if name not in matrices.index:
            raise SimulationError(f"port {port.label!r}: the track has no degree of freedom {name!r}.")
        rows[k], weights[k] = matrices.index[name], weight
    return rows, weights, float(prepared.track.support[port.ends[0][0][1]])


def _law_table(law):
    if law.law_code != TABLE:
        return np.zeros((3, 0))
    return np.array([law.deformation, law.elastic, law.viscous], dtype=float)
