"""Receptances of all hammer pairs under the same conditions, and their derivatives, on one model of the track.

The derivatives are sums of products of strains under two unit forces; those over the rail's elements are compiled.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from turnout.kernel_cache import kernel
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.mismatch.turnout.receptance_observation import LINES, SHIFTED_LINES
from turnout.mismatch.turnout.toe_position import TOE, with_toe
from turnout.mismatch.turnout.track_parameters import COMMON_PARAMETERS, SUPPORT_PARAMETERS
from turnout.mismatch.turnout.zone import casting_elements
from turnout.simulate.rail import element_mass

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from turnout.mismatch.turnout.receptance_model import ReceptanceModel
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.mismatch.turnout.zone import Zone
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.rail import Rail
    from turnout.simulate.track import RailStretch


@kernel
def rail_derivatives(
    displacements: np.ndarray, pairs: np.ndarray, row: np.ndarray, length: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Derivatives of receptances by the logarithms of bending and shear stiffness of the rail.

    Parameters
    ----------
    displacements : (n_place, n_line, n) array of complex
        Those under unit forces. [m/N]
    pairs : (2, n_pair) array of int
        Positions of impact and sensor, as indices.
    row : (n_node,) array of int
        Row of each node's deflection.
    length : (n_element,) array of float
        [m]
    weights : (3, n_element) array of float
        Of bending, of shear, and of shear by the shear stiffness alone.

    Returns
    -------
    (n_pair, n_line, 2) array of complex
        [m/N]
    """
    n_place, n_line, n_element = displacements.shape[0], displacements.shape[1], length.size
    derivatives = np.zeros((pairs.shape[1], n_line, 2), dtype=np.complex128)
    bent, skew = np.zeros((2, n_place, n_element)), np.zeros((2, n_place, n_element))
    for line in range(n_line):
        for k in range(n_place):
            u = displacements[k, line]
            for e in range(n_element):
                first, second = row[e], row[e + 1]
                b = u[second + 1] - u[first + 1]
                s = (u[second] - u[first]) / length[e] - 0.5 * (u[first + 1] + u[second + 1])
                bent[0, k, e], bent[1, k, e], skew[0, k, e], skew[1, k, e] = b.real, b.imag, s.real, s.imag
        for k in range(pairs.shape[1]):
            p, q = pairs[0, k], pairs[1, k]
            b_p, c_p, s_p, t_p = bent[0, p], bent[1, p], skew[0, p], skew[1, p]
            b_q, c_q, s_q, t_q = bent[0, q], bent[1, q], skew[0, q], skew[1, q]
            real, imag, shear_real, shear_imag = 0.0, 0.0, 0.0, 0.0
            for e in range(n_element):
                x, y = s_p[e] * s_q[e] - t_p[e] * t_q[e], s_p[e] * t_q[e] + t_p[e] * s_q[e]
                bend, shear, alone = weights[0, e], weights[1, e], weights[2, e]
                real += bend * (b_p[e] * b_q[e] - c_p[e] * c_q[e]) + shear * x
                imag += bend * (b_p[e] * c_q[e] + c_p[e] * b_q[e]) + shear * y
                shear_real += alone * x
                shear_imag += alone * y
            derivatives[k, line, 0], derivatives[k, line, 1] = -complex(real, imag), -complex(shear_real, shear_imag)
    return derivatives


@lru_cache(maxsize=1024)
def _mass_without_rotation(rail: Rail, length: float) -> np.ndarray:
    """(4, 4) mass of a rail element without its rotary inertia [kg, kg m, kg m²]; tracks of one visit share rails."""
    return element_mass(replace(rail, rotary_inertia=0.0), length)


FIELDS = [o.field for o in SUPPORT_PARAMETERS]
OMEGA = 2.0 * np.pi * SHIFTED_LINES
FACTOR = {"stiffness": -1.0 + 0j * OMEGA, "damping": -1j * OMEGA, "mass": OMEGA**2 + 0j}


class ReceptanceSensitivity:
    """Receptances of one ``model`` (``ReceptanceModel``) and their derivatives.

    ``pairs`` are (position of the impact, ``FrfPair.seat``); ``seats`` maps the latter to the position of the sensor.
    The supports of ``zone`` have values of their own.
    """

    def __init__(
        self,
        model: ReceptanceModel,
        pairs: Iterable[tuple[float, tuple]],
        seats: Mapping[tuple, float | tuple],
        zone: Zone,
    ):
        self.model, self.seats, self.zone = model, seats, zone
        self.row = {pair: k for k, pair in enumerate(dict.fromkeys(pairs))}

    def row_of(self, pair: FrfPair) -> int:
        """Row of a pair in the arrays of all pairs.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        int
        """
        return self.row[pair.test.place, pair.seat]

    @cached_property
    def receptances(self) -> np.ndarray:
        """(n_pair, n_line) complex [m/N]."""
        return self._receptances_beside(0.0)

    @cached_property
    def seat_gradients(self) -> np.ndarray:
        """(n_pair, n_line) derivatives by the position of the sensor on the rail [1/N]; 0 on a sleeper."""
        step = RECEPTANCE.seat_step
        return (self._receptances_beside(step) - self._receptances_beside(-step)) / (2.0 * step)

    @cached_property
    def rail_gradients(self) -> np.ndarray:
        """(n_pair, n_line, n) derivatives by the logarithms of the uncertain rail values (``rail_sds``)."""
        return np.concatenate([self._by_rail, self._by_castings], axis=-1)

    @cached_property
    def toe_gradients(self) -> np.ndarray:
        """(n_pair, n_line) derivatives by the position of the toe of a blade [1/N]; 0 without one."""
        track = self.model.track
        limits = track.blade.toe_limits(track) if track.blade is not None else None
        if limits is None:
            return np.zeros_like(self.receptances)
        step = RECEPTANCE.toe_step if limits[1] > -limits[0] else -RECEPTANCE.toe_step
        return self._change_with(linear_matrices(with_toe(track, {TOE: step}), self.model.terms)) / step

    def _change_with(self, changed: TrackMatrices) -> np.ndarray:
        r"""(n_pair, n_line) change of the receptances to first order, with matrices of the same rows [m/N].

        .. math:: -u_m^T (\Delta K + i\omega \Delta C - \omega^2 \Delta M) u_e + \Delta w_m^T u_e + u_m^T \Delta w_e

        and the change of the local compliance, with the displacements u under unit forces at impact and sensor and
        their weights w.
        """
        before, u, (positions, (first, second)) = self.model.matrices, self._displacements, self._positions
        changes = {name: getattr(changed, name) - getattr(before, name) for name in FACTOR}
        diagonal, row = np.nonzero(np.any([change != 0.0 for change in changes.values()], axis=0))
        entries = sum(FACTOR[name][:, None] * change[diagonal, row] for name, change in changes.items())
        upper, lower = u[..., row], u[..., row + diagonal]
        mirrored = np.where(diagonal > 0, upper, 0.0)
        change = ((upper[first] * lower[second] + lower[first] * mirrored[second]) * entries).sum(axis=-1)
        places, weights = list(positions), [(before.weights(p), changed.weights(p)) for p in positions]
        for k, pair in enumerate(zip(first, second)):
            for force, seat in (pair, pair[::-1]):
                (rows, old), (new_rows, new) = weights[seat]
                change[k] += u[force][:, new_rows] @ new - u[force][:, rows] @ old
            force, seat = (places[p] for p in pair)
            if not isinstance(force, tuple) and not isinstance(seat, tuple):
                change[k] += changed.compliance(force, seat) - before.compliance(force, seat)
        return change

    @property
    def gradients(self) -> np.ndarray:
        """(n_pair, n_line, n) derivatives by the logarithms of common and support values."""
        return self._by_supports

    def _receptances_beside(self, offset: float) -> np.ndarray:
        """(n_pair, n_line) receptances with each sensor on the rail moved by ``offset`` [m]."""
        h, (positions, (impacts, _)) = np.empty((len(self.row), LINES.size), dtype=complex), self._positions
        places = list(positions)
        for seat, position in self.seats.items():
            measured = position if isinstance(position, tuple) else position + offset
            rows = self._rows_of_seat[seat]
            h[rows] = self.model.receptances(self._displacements, places, measured)[impacts[rows]]
        return h

    @cached_property
    def _rows_of_seat(self) -> dict[tuple, list[int]]:
        """Rows of the pairs of each seat."""
        rows: dict[tuple, list[int]] = {seat: [] for seat in self.seats}
        for (_, seat), k in self.row.items():
            rows[seat].append(k)
        return rows

    def receptance(self, pair: FrfPair) -> np.ndarray:
        """Receptance of a pair.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        (n_line,) array of complex
            Receptance. [m/N]
        """
        return self.receptances[self.row_of(pair)]

    def rail_gradient(self, pair: FrfPair) -> np.ndarray:
        """Derivatives by the logarithms of the uncertain rail values, in the order of ``rail_sds``.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        (n_line, n) array of complex
            Derivatives. [m/N]
        """
        return self.rail_gradients[self.row_of(pair)]

    def gradient(self, pair: FrfPair) -> np.ndarray:
        """Derivatives by the logarithms of common and support values, in the order of ``track_value_names``.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        (n_line, n) array of complex
            Derivatives. [m/N]
        """
        return self._by_supports[self.row_of(pair)]

    def motions(self, ends: csr_array) -> tuple[np.ndarray, np.ndarray]:
        """Motion of the ends of links under unit forces at impact and sensor of each pair.

        Parameters
        ----------
        ends : (n_link, n) sparse array
            Weights of the degrees of freedom at the ends of each link.

        Returns
        -------
        (n_pair, n_link, n_line) array of complex, the same
            [m/N]
        """
        by_position = self._motion_of_positions(ends).transpose(1, 0, 2)
        first, second = self._positions[1]
        return by_position[first], by_position[second]

    def _motion_of_positions(self, ends: csr_array) -> np.ndarray:
        """(n_link, n_place, n_line) motion of the ends of links under unit forces at all positions [m/N]."""
        used = np.unique(ends.indices)  # few: a product with all columns would copy all displacements
        return np.moveaxis(self._displacements[..., used] @ ends[:, used].toarray().T, -1, 0)

    @cached_property
    def _positions(self) -> tuple[dict[float | tuple, int], np.ndarray]:
        """Index of the position of every impact and sensor, and (2, n_pair) indices of each pair."""
        ends = [(position, self.seats[seat]) for position, seat in self.row]
        index = {position: k for k, position in enumerate(dict.fromkeys(p for pair in ends for p in pair))}
        return index, np.array([[index[p] for p in pair] for pair in ends]).T

    @cached_property
    def _displacements(self) -> np.ndarray:
        """(n_place, n_line, n) displacement of all degrees of freedom under unit forces at the positions."""
        return np.array([self.model.displacement(position) for position in self._positions[0]])

    @cached_property
    def _by_rail(self) -> np.ndarray:
        r"""(n_pair, n_line, 2) of

        .. math:: -\sum_e \frac{EI}{h} s_u s_v + \frac{12 EI}{h (1+P)^2} a_u a_v, \quad
                  -\sum_e \frac{12 EI P}{h (1+P)^2} a_u a_v

        with :math:`s = \theta_2 - \theta_1`, :math:`a = (w_2 - w_1)/h - (\theta_1 + \theta_2)/2` of each element and P
        its share of shear: the two modes of the element (Przemieniecki 1968, ch. 11). Its mass hardly depends on them.
        The closure rail behind a blade is of the same section.
        """
        matrices = self.model.matrices
        h, p, ei, _ = matrices.elements
        total = rail_derivatives(
            self._displacements, self._positions[1], matrices.node_index, h, self._rail_weights(h, p, ei)
        )
        blade = self.model.track.blade
        if blade is not None:
            inside = slice(matrices.blade_start, matrices.blade_start + len(matrices.blade_rails))
            middle = matrices.node[inside] + 0.5 * h[inside]
            is_closure = blade.direction * (middle - blade.heel) > 0.0
            weights = is_closure * self._rail_weights(h[inside], p[inside], ei[inside])
            rows = np.array(matrices.blade_rows)
            total += rail_derivatives(self._displacements, self._positions[1], rows, h[inside], weights)
        return total

    def _rail_weights(self, h: np.ndarray, p: np.ndarray, ei: np.ndarray) -> np.ndarray:
        """(3, n_element) weights of ``rail_derivatives``."""
        sheared = 12.0 * ei / (h * (1.0 + p) ** 2)
        return np.array([ei / h, sheared, self.model.file_shear_share * sheared * p])

    @cached_property
    def _by_castings(self) -> np.ndarray:
        r"""(n_pair, n_line, 2 n_casting) by the logarithms of bending stiffness and mass of each casting.

        The same sums over the elements that it covers, and :math:`\omega^2 \sum_e u^T M_e v` with their masses. Each
        element counts by the share of the casting in its flexibility and mass.
        """
        matrices, (first, second) = self.model.matrices, self._positions[1]
        if not self.zone.castings:
            return np.zeros((len(self.row), OMEGA.size, 0), dtype=complex)
        covered = [
            (e, *self._casting_shares(c.piece, e, share), np.full(e.size, number))
            for number, (c, (e, share)) in enumerate(
                zip(self.zone.castings, casting_elements(self.zone, matrices.node))
            )
        ]
        e, flexibility_share, mass_share, number = (np.concatenate(values) for values in zip(*covered))
        h, p, ei, _ = (values[e] for values in matrices.elements)
        row = matrices.node_index
        w1, rotation1, w2, rotation2 = u = [
            self._displacements[..., row[e + side] + k] for side in (0, 1) for k in (0, 1)
        ]
        bent, skew = rotation2 - rotation1, (w2 - w1) / h - 0.5 * (rotation1 + rotation2)
        mass = np.array([_mass_without_rotation(matrices.rails[k], x) for k, x in zip(e, h)]).transpose(1, 2, 0)
        inertia = [sum(u_i * m for u_i, m in zip(u, row_of_mass)) for row_of_mass in mass]
        sheared = flexibility_share * 12.0 * ei / (h * (1.0 + p) ** 2)
        bending = -(bent[first] * bent[second]) * (flexibility_share * ei / h) - (skew[first] * skew[second]) * sheared
        inertial = sum(a[first] * b[second] for a, b in zip(u, inertia)) * mass_share
        in_casting = np.eye(len(covered), dtype=complex)[number]
        by_casting = bending @ in_casting, OMEGA[:, None] ** 2 * (inertial @ in_casting)
        return np.stack(by_casting, axis=-1).reshape(len(self.row), OMEGA.size, -1)

    def _casting_shares(self, piece: RailStretch, elements: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """(2, n) share of a piece in flexibility and mass of the elements, of whose length it covers ``shares``.

        It is 0 where a term has replaced the rail.
        """
        matrices, track, casting_shares = self.model.matrices, self.model.track, np.zeros((2, elements.size))
        piece_rail = track.rail_at(0.5 * (piece.start + piece.end))
        for k, (e, share) in enumerate(zip(elements, shares)):
            rail, file_rail = matrices.rails[e], track.element_rail(*matrices.node[e : e + 2].tolist())
            if (rail.bending_stiffness, rail.mass) == (file_rail.bending_stiffness, file_rail.mass):
                casting_shares[:, k] = (
                    share * rail.bending_stiffness / piece_rail.bending_stiffness,
                    share * piece_rail.mass / rail.mass,
                )
        return casting_shares

    @cached_property
    def _by_supports(self) -> np.ndarray:
        """(n_pair, n_line, n) derivatives by all common and support values."""
        zone, track = self.zone, self.model.track
        inside, n = slice(zone.first, zone.last + 1), zone.last + 1 - zone.first
        first, second = self._positions[1]
        pad, sleeper = (u[first] * u[second] for u in self._at_supports(self._displacements))
        product = {"pad": pad, "ballast": sleeper, "sleeper": sleeper}
        derivatives = np.empty(
            (len(self.row), LINES.size, len(COMMON_PARAMETERS) + n * len(SUPPORT_PARAMETERS)), dtype=complex
        )
        for k, o in enumerate(SUPPORT_PARAMETERS):
            value, factor = getattr(track, o.field), FACTOR[o.quantity]
            derivatives[..., _COMMON_OF[o.field]] = (product[o.link] @ value) * factor
            start, scale = len(COMMON_PARAMETERS) + k * n, factor[:, None] * value[inside]
            np.multiply(product[o.link][..., inside], scale, out=derivatives[..., start : start + n])
        if self.model.following_links:
            derivatives += self._following_gradient(derivatives.shape, n)
        return derivatives

    def _at_supports(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compression of every pad and motion of every sleeper, each (..., n_support)."""
        rail, sleeper = self.model.rows
        return u[..., rail] - u[..., sleeper], u[..., sleeper]

    def _following_gradient(self, shape: tuple[int, ...], n: int) -> np.ndarray:
        """Contribution of those links of terms that depend on a value of their support."""
        fields, supports, rows, weights, changes = zip(*self.model.following_links)
        first = np.cumsum([0, *(r.size for r in rows)])
        ends = csr_array((np.concatenate(weights), np.concatenate(rows), first), (len(rows), self.model.matrices.n))
        impedance = np.array(changes) @ np.array([FACTOR["stiffness"], FACTOR["damping"], FACTOR["mass"]])
        end_motion = self._motion_of_positions(ends)
        first, second = self._positions[1]
        products = end_motion[:, first] * end_motion[:, second] * impedance[:, None]
        common_columns = [(e, _COMMON_OF[field]) for e, field in enumerate(fields)]
        support_columns = [
            (e, len(COMMON_PARAMETERS) + FIELDS.index(field) * n + support - self.zone.first)
            for e, (field, support) in enumerate(zip(fields, supports))
            if self.zone.first <= support <= self.zone.last
        ]
        entry, column = np.array([*common_columns, *support_columns]).T
        sums = csr_array((np.ones(entry.size), (entry, column)), (len(fields), shape[-1]))
        return (sums.T @ products.reshape(len(fields), -1)).T.reshape(shape)


_COMMON_OF = {name: k for k, (name, *_) in enumerate(COMMON_PARAMETERS)}
