"""Assemble banded mass, damping and stiffness matrices of a track, and number its degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.links import Link, links_of
from turnout.simulate.rail import Rail, element_mass, element_stiffness, local_compliance, shape_functions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.simulate.effect import Effect
    from turnout.simulate.track import Track

ROW_ORDER = {"sleeper": 0, "ballast": 1}


@dataclass(frozen=True)
class TrackMatrices:
    """Matrices as upper diagonals, (half + 1, n): ``mass[k, i]`` is M[i, i + k]; ``node`` (n_node,) [m].

    ``index`` maps the name of a degree of freedom to its row. ``node_index`` (n_node,) is the row of a node's
    deflection; its rotation is the next row. ``rails`` has the profile of each element, ``links`` all links. A blade
    has the rows ``blade_rows`` of its nodes, from the node ``blade_start`` of the rail on, and the sections
    ``blade_rails`` of its elements.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    hysteresis: np.ndarray
    node: np.ndarray
    node_index: np.ndarray
    index: dict[tuple, int]
    rails: tuple[Rail, ...]
    links: tuple[Link, ...]
    blade_rails: tuple[Rail, ...] = ()
    blade_start: int = 0
    blade_rows: tuple[int, ...] = ()

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return self.mass.shape[1]

    @property
    def half(self) -> int:
        """Half bandwidth."""
        return self.mass.shape[0] - 1

    @cached_property
    def elements(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Element table: length, shear ratio, EI, κGA (inf for Euler-Bernoulli), each (n_element,)."""
        h = np.diff(self.node)
        p = np.array([float(r.shear_ratio(h_e)) for r, h_e in zip(self.rails, h)])
        ei = np.array([r.bending_stiffness for r in self.rails])
        kga = np.array([np.inf if r.beam == "euler" else r.shear_stiffness for r in self.rails])
        return h, p, ei, kga

    @cached_property
    def line_elements(self) -> tuple[np.ndarray, ...]:
        """Elements under a wheel on the rail (line 0) and on the line that changes to the blade (line 1).

        Rows of the first and of the second node, shear ratio, 1 / EI and 1 / κGA, each (2, n_element). Beside the
        blade, and without one, both lines are the same.
        """
        h, p, ei, kga = self.elements
        table = [np.stack([v, v]) for v in (self.node_index[:-1], self.node_index[1:], p, 1.0 / ei, 1.0 / kga)]
        if self.blade_rails:
            rails, rows, inside = self.blade_rails, self.blade_rows, self._blade_elements
            ratio = [float(r.shear_ratio(h_e)) for r, h_e in zip(rails, h[inside])]
            shear = [0.0 if r.beam == "euler" else 1.0 / r.shear_stiffness for r in rails]
            values = rows[:-1], rows[1:], ratio, [1.0 / r.bending_stiffness for r in rails], shear
            for line, value in zip(table, values):
                line[1, inside] = value
        return tuple(table)

    @property
    def _blade_elements(self) -> slice:
        return slice(self.blade_start, self.blade_start + max(len(self.blade_rows) - 1, 0))

    def is_on_blade(self, x: np.ndarray) -> np.ndarray:
        """Whether a wheel at ``x`` on the line that changes to the blade presses the blade.

        Parameters
        ----------
        x : (...) array of float
            Positions. [m]

        Returns
        -------
        (...) array of bool
        """
        inside = self._blade_elements
        return (x >= self.node[inside.start]) & (x < self.node[inside.stop])

    def rail_weights(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows (4,) and weights (4,) that give the rail's deflection at ``x`` [m] between two nodes.

        Parameters
        ----------
        x : float
            Position on the rail. [m]

        Returns
        -------
        (4,) array of int, (4,) array of float
            Rows, and their weights (1, m, 1, m).

        Raises
        ------
        SimulationError
            For a position outside the track.
        """
        if not self.node[0] <= x <= self.node[-1]:
            a, b = self.node[[0, -1]]
            raise SimulationError(f"position {x:.3f} m is outside the track from {a:.3f} m to {b:.3f} m.")
        e = self.element_at(x)
        h, p = self.elements[0][e], self.elements[1][e]
        i, j = self.node_index[e], self.node_index[e + 1]
        return np.array([i, i + 1, j, j + 1]), shape_functions((x - self.node[e]) / h, h, p)

    def compliance(self, x: float, x_load: float | None = None) -> float:
        """Local compliance of the element between ``x`` and ``x_load`` [m/N], by default ``x`` itself.

        It is 0 if ``x_load`` is in another element.

        Parameters
        ----------
        x : float
            Position of the deflection. [m]
        x_load : float or None
            Position of the force. [m]

        Returns
        -------
        float
            Local compliance. [m/N]
        """
        e, x_load = self.element_at(x), x if x_load is None else x_load
        h = self.node[e + 1] - self.node[e]
        shares = (x - self.node[e]) / h, (x_load - self.node[e]) / h
        return float(local_compliance(*shares, h, self.rails[e])) if 0.0 <= shares[1] <= 1.0 else 0.0

    def element_at(self, x: float) -> int:
        """Index of the element at ``x`` [m]; on a node the one after it.

        Parameters
        ----------
        x : float
            Position on the rail. [m]

        Returns
        -------
        int
            Number of the element, 0 to n_element - 1.
        """
        return min(int(np.searchsorted(self.node, x, side="right")) - 1, self.node.size - 2)

    def weights(self, point: float | tuple) -> tuple[np.ndarray, np.ndarray]:
        """Rows and weights of a point: a number is the rail at x [m], a tuple names a degree of freedom.

        Parameters
        ----------
        point : float or tuple
            Position on the rail [m] or name of a degree of freedom.

        Returns
        -------
        (n,) array of int, (n,) array of float
            Rows and weights: n is 4 for the rail, 1 for a named degree of freedom.

        Raises
        ------
        SimulationError
            For a position or name that the track does not have.
        """
        if isinstance(point, tuple):
            if point not in self.index:
                raise SimulationError(f"the track has no degree of freedom {point!r}.")
            return np.array([self.index[point]]), np.array([1.0])
        return self.rail_weights(float(point))


def link_vector(link: Link, index: Mapping[tuple, int]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and weights of a link.

    Parameters
    ----------
    link : Link
        The link.
    index : mapping
        Row of each named degree of freedom.

    Returns
    -------
    (n_end,) array of int, (n_end,) array of float
        Rows and weights.

    Raises
    ------
    SimulationError
        For a degree of freedom that is not in ``index``.
    """
    try:
        return np.array([index[name] for name, _ in link.ends]), np.array([weight for _, weight in link.ends])
    except KeyError as error:
        raise SimulationError(f"link {link.tag!r}: the track has no degree of freedom {error.args[0]!r}.") from None


def assemble(track: Track, terms: Sequence[Effect] = ()) -> TrackMatrices:
    """Matrices of ``track`` with the rails that ``terms`` change and the links that they add.

    Parameters
    ----------
    track : Track
        The track.
    terms : sequence of Effect
        Effects added to the base model.

    Returns
    -------
    TrackMatrices
        Matrices with rails and links.
    """
    for term in terms:
        track = term.rail(track)
    return add_rails(link_matrices(track, [*track.links(), *links_of(terms, track)]), track)


def link_matrices(track: Track, links: Sequence[Link]) -> TrackMatrices:
    """Matrices of links alone, with the numbering of ``track`` and without its rail.

    Parameters
    ----------
    track : Track
        Track whose nodes are numbered.
    links : sequence of Link
        Links that are added up.

    Returns
    -------
    TrackMatrices
        Its ``rails`` are empty.

    Raises
    ------
    SimulationError
        For a link at a support that the track does not have.
    """
    node, node_index, index = _number_rows(track, links)
    vectors = [link_vector(link, index) for link in links]
    half = max([1 + int(np.max(np.diff(node_index))), *(int(np.ptp(rows)) for rows, _ in vectors)])
    half = max(half, _blade_reach(track, node_index, index))
    n = max(max(index.values()) + 1, int(node_index[-1]) + 2)
    mass, damping, stiffness, hysteresis = (np.zeros((half + 1, n)) for _ in range(4))
    for link, (rows, weights) in zip(links, vectors):
        for a, wa in zip(rows, weights):
            for b, wb in zip(rows, weights):
                if b >= a:
                    stiffness[b - a, a] += link.stiffness * wa * wb
                    damping[b - a, a] += link.damping * wa * wb
                    mass[b - a, a] += link.mass * wa * wb
                    hysteresis[b - a, a] += link.loss_factor * link.stiffness * wa * wb
    return TrackMatrices(mass, damping, stiffness, hysteresis, node, node_index, index, (), tuple(links))


def _blade_reach(track: Track, node_index: np.ndarray, index: Mapping[tuple, int]) -> int:
    """Half bandwidth that the elements of a blade need; 0 without one."""
    if track.blade is None:
        return 0
    first, last = track.blade.nodes(track)
    names = [divmod(k, track.elements_per_bay) for k in range(first, last + 1)]
    rows = [index.get(("blade", *name), index[("rail", *name)]) for name in names]
    return 1 + int(np.max(np.abs(np.diff(rows))))


def add_rails(matrices: TrackMatrices, track: Track) -> TrackMatrices:
    """The matrices with the rails of ``track`` added.

    Parameters
    ----------
    matrices : TrackMatrices
        Matrices of the links, from ``link_matrices``.
    track : Track
        The track.

    Returns
    -------
    TrackMatrices
        A copy; ``matrices`` does not change.
    """
    rails = tuple(track.element_rail(a, b) for a, b in pairwise(matrices.node.tolist()))
    mass, damping, stiffness = (x.copy() for x in (matrices.mass, matrices.damping, matrices.stiffness))
    _add_rail(track, rails, matrices.node, matrices.node_index, mass, damping, stiffness)
    changed = replace(matrices, mass=mass, damping=damping, stiffness=stiffness, rails=rails)
    if track.blade is None:
        return changed
    first, last = track.blade.nodes(track)
    per_bay, on_blade = track.elements_per_bay, _blade_nodes(track)
    rows = tuple(
        matrices.index[("blade", *divmod(k, per_bay)) if k in on_blade else ("rail", *divmod(k, per_bay))]
        for k in range(first, last + 1)
    )
    node = matrices.node[first : last + 1]
    blade_rails = tuple(track.blade.element_rail(track, a, b) for a, b in pairwise(node.tolist()))
    _add_rail(track, blade_rails, node, np.array(rows), mass, damping, stiffness)
    return replace(changed, blade_rails=blade_rails, blade_start=first, blade_rows=rows)


def _blade_nodes(track: Track) -> range:
    """Nodes of the rail beside which the blade has one of its own: all but that of its end."""
    if track.blade is None:
        return range(0)
    first, last = track.blade.nodes(track)
    return range(first, last) if track.blade.direction > 0 else range(first + 1, last + 1)


def rail_nodes(track: Track) -> np.ndarray:
    """Positions of the nodes of the rail; the one at the toe of a blade is moved to it.

    Parameters
    ----------
    track : Track
        The track.

    Returns
    -------
    (n_node,) array of float
        [m]
    """
    per_bay = track.elements_per_bay
    bays = [np.linspace(a, b, per_bay + 1)[:-1] for a, b in zip(track.support[:-1], track.support[1:])]
    node = np.append(np.concatenate(bays), track.support[-1])
    if track.blade is not None:
        toe = track.blade.toe_node(track)
        node[toe] = track.blade.toe if toe % per_bay else node[toe]
    return node


def _number_rows(track: Track, links: Sequence[Link]) -> tuple[np.ndarray, np.ndarray, dict[tuple, int]]:
    """Nodes, their rows and the row of every named degree of freedom; those of a support follow its node.

    The node of a blade follows the node of the rail beside it. At its end both have one.
    """
    per_bay, node = track.elements_per_bay, rail_nodes(track)
    extra: list[set[tuple]] = [set() for _ in track.support]
    for link in links:
        for name, _ in link.ends:
            if not 0 <= name[1] < track.support.size:
                raise SimulationError(f"link {link.tag!r}: support {name[1]} of {track.support.size}.")
            if name[0] not in ("rail", "blade"):
                extra[name[1]].add(name)
    index: dict[tuple, int] = {}
    node_index, row = np.empty(node.size, dtype=np.int64), 0
    on_blade = _blade_nodes(track)
    for k in range(node.size):
        node_index[k], row = row, row + 2
        j, node_in_bay = divmod(k, per_bay)
        if k in on_blade:
            index[("blade", j, node_in_bay)], row = row, row + 2
        index[("rail", j, node_in_bay)] = node_index[k]
        if node_in_bay:
            if j + 1 < track.support.size:
                index[("rail", j + 1, node_in_bay - per_bay)] = node_index[k]
            continue
        index[("rail", j)] = node_index[k]
        for name in sorted(extra[j], key=lambda n: (ROW_ORDER.get(n[0], 2), n[0], n[2:])):
            index[name], row = row, row + 1
    return node, node_index, index


def _add_rail(
    track: Track,
    rails: Sequence[Rail],
    node: np.ndarray,
    node_index: np.ndarray,
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
) -> None:
    element_cache, length = {}, np.diff(node)
    keys = list(zip(rails, np.round(length, 12).tolist()))
    for key, h in zip(keys, length):
        if key not in element_cache:
            element_cache[key] = element_mass(key[0], h), element_stiffness(key[0], h)
    m, k = (np.array(element_matrices) for element_matrices in zip(*(element_cache[key] for key in keys)))
    middle = 0.5 * (node[:-1] + node[1:])
    rate = np.array([rail.damping / rail.mass for rail in rails]) + _end_rate(track, middle)
    first, last = node_index[:-1], node_index[1:]
    rows = first, first + 1, last, last + 1
    for a in range(4):
        for b in range(a, 4):
            entries = rows[b] - rows[a], rows[a]
            np.add.at(mass, entries, m[:, a, b])
            np.add.at(stiffness, entries, k[:, a, b])
            np.add.at(damping, entries, rate * m[:, a, b])


def _end_rate(track: Track, x: np.ndarray) -> np.ndarray:
    """Damping rate [1/s] of an absorbing end; it grows with the square of the distance into the end."""
    if not track.end_length:
        return np.zeros_like(x)
    from_start, from_end = track.start + track.end_length - x, x - track.end + track.end_length
    depth = np.maximum(np.maximum(from_start, from_end), 0.0)
    return track.end_damping * (depth / track.end_length) ** 2
