"""What the pairs of hammer tests under the same conditions share on one model of the track, found once for all."""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from turnout.mismatch.track.base_model import COMMON, OWN
from turnout.mismatch.track.blows import LINES
from turnout.mismatch.track.strain_products import by_rail

FIELDS = [o.field for o in OWN]
OMEGA = 2.0 * np.pi * LINES
FACTOR = {"stiffness": -1.0 + 0j * OMEGA, "damping": -1j * OMEGA, "mass": OMEGA**2 + 0j}


class Heard:
    """A ``model`` (``BlowModel``), the places that were struck, ``seats`` ``Pair.seat`` -> place of the sensor, and the
    ``zone`` whose supports have values of their own."""

    def __init__(self, model, struck, seats, zone):
        self.model, self.seats, self.zone = model, seats, zone
        self.struck = {place: k for k, place in enumerate(dict.fromkeys(struck))}
        self.column = {seat: k for k, seat in enumerate(seats)}

    def _of(self, pair):
        return self.struck[pair.test.place], self.column[pair.seat]

    def receptance(self, pair):
        """(n_line,) complex [m/N]."""
        return self.model.receptance(pair.test.place, self.seats[pair.seat])

    def seat_gradient(self, pair):
        """Derivative by the sensor's place on the rail, (n_line,) [1/N]; 0 on a sleeper."""
        return self.model.seat_gradient(pair.test.place, self.seats[pair.seat])

    def rail_gradient(self, pair):
        """Derivatives by the logarithms of the rail's bending and shear stiffness, (n_line, 2)."""
        return self._by_rail[self._of(pair)]

    def gradient(self, pair):
        """Derivatives by the logarithm of each common and own value, (n_line, n) in the order of ``inner_names``."""
        return self._by_supports[self._of(pair)]

    def motion(self, ends, pair):
        """((n_link, n_line), the same) motion of links' ``ends`` (n_link, n) under unit forces at blow and sensor."""
        row, column = self._of(pair)
        return ends @ self._struck[row].T, ends @ self._seated[column].T

    @cached_property
    def _struck(self):
        return np.array([self.model.displacement(place) for place in self.struck])

    @cached_property
    def _seated(self):
        return np.array([self.model.displacement(place) for place in self.seats.values()])

    @cached_property
    def _by_rail(self):
        r"""(n_struck, n_sensor, n_line, 2) of

        .. math:: -\sum_e \frac{EI}{h} s_u s_v + \frac{12 EI}{h (1+P)^2} a_u a_v, \quad
                  -\sum_e \frac{12 EI P}{h (1+P)^2} a_u a_v

        with :math:`s = \theta_2 - \theta_1`, :math:`a = (w_2 - w_1)/h - (\theta_1 + \theta_2)/2` of each element and P
        its share of shear: the element's two modes (Przemieniecki 1968, ch. 11). Its mass hardly hangs on them.
        """
        matrices = self.model.matrices
        h, p, ei, _ = matrices.elements
        sheared = 12.0 * ei / (h * (1.0 + p) ** 2)
        weights = np.array([ei / h, sheared, self.model.own_shear * sheared * p])
        return by_rail(self._struck, self._seated, matrices.node_index, h, weights)

    @cached_property
    def _by_supports(self):
        """(n_struck, n_sensor, n_line, n) of all values."""
        zone, track = self.zone, self.model.track
        inside, n = slice(zone.first, zone.last + 1), zone.last + 1 - zone.first
        (pad_u, sleeper_u), (pad_v, sleeper_v) = (self._at_supports(u) for u in (self._struck, self._seated))
        moved = {"pad": (pad_u, pad_v), "ballast": (sleeper_u, sleeper_v), "sleeper": (sleeper_u, sleeper_v)}
        found = np.empty((len(self.struck), len(self.seats), LINES.size, len(COMMON) + n * len(OWN)), dtype=complex)
        near = {link: u[:, None, :, inside] * v[None, :, :, inside] for link, (u, v) in moved.items()}
        for k, o in enumerate(OWN):
            value, (u, v), factor = getattr(track, o.field), moved[o.link], FACTOR[o.what]
            found[..., _COMMON_OF[o.field]] = _summed(u * value, v) * factor
            first = len(COMMON) + k * n
            np.multiply(near[o.link], factor[:, None] * value[inside], out=found[..., first : first + n])
        if self.model.following:
            found += self._followed(found.shape, n)
        return found

    def _at_supports(self, u):
        """Stretch of every pad and motion of every sleeper, each (..., n_support)."""
        rail, sleeper = self.model.rows
        return u[..., rail] - u[..., sleeper], u[..., sleeper]

    def _followed(self, shape, n):
        """What links of terms add that follow a value of their support."""
        fields, supports, rows, weights, changes = zip(*self.model.following)
        first = np.cumsum([0, *(r.size for r in rows)])
        ends = csr_array((np.concatenate(weights), np.concatenate(rows), first), (len(rows), self.model.matrices.n))
        impedance = np.array(changes) @ np.array([FACTOR["stiffness"], FACTOR["damping"], FACTOR["mass"]])
        u, v = ((ends @ x.reshape(-1, x.shape[-1]).T).T.reshape(*x.shape[:2], -1) for x in (self._struck, self._seated))
        each = u[:, None] * v[None] * impedance.T
        common = [(e, _COMMON_OF[field]) for e, field in enumerate(fields)]
        own = [
            (e, len(COMMON) + FIELDS.index(field) * n + support - self.zone.first)
            for e, (field, support) in enumerate(zip(fields, supports))
            if self.zone.first <= support <= self.zone.last
        ]
        entry, column = np.array([*common, *own]).T
        sums = csr_array((np.ones(entry.size), (entry, column)), (len(fields), shape[-1]))
        return (sums.T @ each.reshape(-1, len(fields)).T).T.reshape(shape)


_COMMON_OF = {name: k for k, (name, *_) in enumerate(COMMON)}


def _summed(u, v):
    """(n_struck, n_sensor, n_line) sums over the last axis of products of (n_struck, n_line, m) and (n_sensor, n_line,
    m)."""
    return (u.transpose(1, 0, 2) @ v.transpose(1, 2, 0)).transpose(1, 2, 0)
