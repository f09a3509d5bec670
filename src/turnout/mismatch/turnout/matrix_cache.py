"""Cached matrices of tracks that differ in their support values alone: rails, rows and bandwidth are computed once."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from turnout.mismatch.turnout.priors import SIMULATION
from turnout.physics.term import PhysicsTerm
from turnout.simulate.links import links_of
from turnout.simulate.matrices import TrackMatrices, add_rails, assemble, link_matrices, link_vector, rail_nodes

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Sequence

    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

SUPPORT_FIELDS = (  # field of a Track, quantity of the link, tag
    ("pad_stiffness", "stiffness", "pad"),
    ("pad_damping", "damping", "pad"),
    ("ballast_stiffness", "stiffness", "ballast"),
    ("ballast_damping", "damping", "ballast"),
    ("sleeper_mass", "mass", "sleeper"),
)
_templates: OrderedDict[Hashable, MatrixTemplate] = OrderedDict()
_Value = TypeVar("_Value")


def matrices_of(track: Track, terms: Sequence[PhysicsTerm] = ()) -> TrackMatrices:
    """``assemble(track, terms)`` for a track of two layers, in a twentieth of the time once a template is cached.

    Parameters
    ----------
    track : Track
        Of two layers; others are assembled in full.
    terms : sequence of PhysicsTerm
        Their links are added.

    Returns
    -------
    TrackMatrices
        Those of ``assemble(track, terms)`` to rounding.
    """
    for term in terms:
        track = term.rail(track)
    links = links_of(terms, track)
    if track.layers != 2:
        return assemble(track, (FixedLinks(links),))
    extra = frozenset(name for link in links for name, _ in link.ends if name[0] not in ("rail", "sleeper"))
    joins = frozenset(tuple(name for name, _ in link.ends) for link in links if len(link.ends) > 1)
    key = (
        track.support.tobytes(), track.elements_per_bay, track.pad_width, track.pad_loss_factor.tobytes(),
        track.ballast_loss_factor.tobytes(), _blade_layout(track), extra, joins,
    )  # fmt: skip
    return _get_or_compute(_templates, key, lambda: MatrixTemplate(track, links)).fill(track, links)


def _blade_layout(track: Track) -> tuple[int, ...]:
    """Nodes and direction of the blade, on which links and rows depend; () without one.

    A toe that moves between two bearers keeps them.
    """
    return () if track.blade is None else (*track.blade.nodes(track), track.blade.direction)


def _unit_chairs(track: Track) -> Track:
    """The track with 1 for the values of the chairs of its blade."""
    if track.blade is None:
        return track
    return track.with_(blade=replace(track.blade, chair_stiffness=1.0, chair_damping=1.0))


def _get_or_compute(cache: OrderedDict[Hashable, _Value], key: Hashable, compute: Callable[[], _Value]) -> _Value:
    """``compute()``, cached under ``key`` among the last ``SIMULATION.template_cache_size``."""
    if key not in cache:
        cache[key] = compute()
        while len(cache) > SIMULATION.template_cache_size:
            cache.popitem(last=False)
    return cache[key]


class FixedLinks(PhysicsTerm):
    """A term that only adds given links to the matrices."""

    def __init__(self, links: Sequence[Link]):
        self._links = links

    def links(self, track: Track) -> Sequence[Link]:
        """The links, for any track.

        Parameters
        ----------
        track : Track
            A track; by default that of the case.

        Returns
        -------
        sequence of Link
        """
        return self._links


class MatrixTemplate:
    """Matrices without the support values, which are 1 in it.

    So rounding errors do not depend on the track that came first.
    """

    def __init__(self, track: Track, links: Sequence[Link]):
        zero_links = [replace(k, stiffness=0.0, damping=0.0, mass=0.0, loss_factor=0.0) for k in links]
        track = _unit_chairs(track.with_(**{name: np.ones(track.support.size) for name, *_ in SUPPORT_FIELDS}))
        self.base = link_matrices(track, [*track.links(), *zero_links])
        support_links = [(j, link) for j in range(track.support.size) for link in track.support_links(j)]
        self.support_entries = {
            tag: self._matrix_entries([(j, k) for j, k in support_links if k.tag == tag])
            for _, _, tag in SUPPORT_FIELDS
        }
        chairs = [track.blade.chair_link(j) for j in track.blade.chairs(track)] if track.blade else []
        self.chair_entries = self._matrix_entries((0, link) for link in chairs)
        self.rail_bases: OrderedDict[Hashable, TrackMatrices] = OrderedDict()
        self.link_entries: OrderedDict[Hashable, tuple[np.ndarray, ...]] = OrderedDict()

    def _matrix_entries(self, links: Iterable[tuple[int, Link]]) -> tuple[np.ndarray, ...]:
        """Diagonal, row, product of weights and owner of every entry of ``links`` [(owner, link)]."""
        entries = []
        for owner, link in links:
            rows, weights = link_vector(link, self.base.index)
            entries += [
                (b - a, a, wa * wb, owner) for a, wa in zip(rows, weights) for b, wb in zip(rows, weights) if b >= a
            ]
        return tuple(map(np.array, zip(*entries)))

    def _base_with_rail(self, track: Track) -> TrackMatrices:
        """``base`` with the rails of ``track``, cached."""
        blade = _unit_chairs(track).blade
        key = track.rail, track.stretches, track.end_length, track.end_damping, blade

        def compute() -> TrackMatrices:
            return add_rails(self.base if blade is None else replace(self.base, node=rail_nodes(track)), track)

        return _get_or_compute(self.rail_bases, key, compute)

    def _link_entries(self, links: Sequence[Link]) -> tuple[np.ndarray, ...]:
        """Matrix entries of ``links`` of terms, cached."""
        return _get_or_compute(
            self.link_entries, tuple(k.ends for k in links), lambda: self._matrix_entries(enumerate(links))
        )

    def fill(self, track: Track, links: Sequence[Link]) -> TrackMatrices:
        """TrackMatrices with the values of ``track`` and of additional links.

        Parameters
        ----------
        track : Track
            A track; by default that of the case.
        links : sequence of Link
            Links that are added to those of the track.

        Returns
        -------
        TrackMatrices
        """
        base = self._base_with_rail(track)
        matrices = {what: getattr(base, what).copy() for what in ("stiffness", "damping", "mass")}
        for name, what, tag in SUPPORT_FIELDS:
            diagonal, row, weight, support = self.support_entries[tag]
            np.add.at(matrices[what], (diagonal, row), weight * (getattr(track, name) - 1.0)[support])
        if track.blade is not None and self.chair_entries:
            diagonal, row, weight, _ = self.chair_entries
            np.add.at(matrices["stiffness"], (diagonal, row), weight * (track.blade.chair_stiffness - 1.0))
            np.add.at(matrices["damping"], (diagonal, row), weight * (track.blade.chair_damping - 1.0))
        if any(k.loss_factor for k in links) or track.pad_loss_factor.any() or track.ballast_loss_factor.any():
            return assemble(track, (FixedLinks(links),))  # hysteresis depends on the stiffness: assembled in full
        if links:
            diagonal, row, weight, which = self._link_entries(links)
            for what, matrix in matrices.items():
                np.add.at(matrix, (diagonal, row), weight * np.array([getattr(k, what) for k in links])[which])
        track_matrices = replace(base, **matrices)
        track_matrices.__dict__["elements"] = base.elements
        return track_matrices
