"""Part of a turnout among sensors and impacts, whose supports and pieces of other rail have values of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import TRACK
from turnout.simulate.track import NODE_TOLERANCE, PER_SUPPORT, RailStretch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.track import Track
    from turnout.simulate.turnout_track import TurnoutTrack


@dataclass(frozen=True)
class Casting:
    """A ``piece`` of the ``stretch`` of other rail, or just beyond it, with its rail as in the file.

    ``inner``: not at an end of the stretch.
    """

    stretch: RailStretch
    piece: RailStretch
    inner: bool


@dataclass(frozen=True)
class Zone:
    """Supports ``first`` to ``last`` (inclusive) lie among sensors and impacts and have values of their own.

    Supports of ``effect_supports`` may have an effect; ``castings`` are pieces of other rail there.
    """

    turnout: TurnoutTrack
    first: int
    last: int
    effect_supports: range
    castings: tuple[Casting, ...] = ()

    @property
    def supports(self) -> range:
        """Indices of the supports of the zone."""
        return range(self.first, self.last + 1)


def zone_of(turnout: TurnoutTrack, positions: Sequence[float]) -> Zone:
    """The relevant part of a turnout, with absorbing ends as they are.

    Parameters
    ----------
    turnout : TurnoutTrack
        The whole turnout.
    positions : sequence of float
        Of sensors and impacts. [m]

    Returns
    -------
    Zone
    """
    low, high = min(positions), max(positions)

    def cut(track: Track) -> Track:
        keep = (track.support >= low - TRACK.track_margin) & (track.support <= high + TRACK.track_margin)
        values = {name: getattr(track, name)[keep] for name in PER_SUPPORT}
        section = tuple(s for s, k in zip(track.section, keep) if k)
        support = track.support[keep]
        blade = track.blade.inside(float(support[0]), float(support[-1])) if track.blade else None
        return replace(track, support=support, section=section, blade=blade, **values)

    tracks = {name: cut(track) for name, track in turnout.tracks.items()}
    smaller = replace(turnout, track=cut(turnout.track), tracks=tracks)
    support = smaller.track.support
    inside, effect_supports = (
        np.flatnonzero((support >= low - r) & (support <= high + r)) for r in (TRACK.support_reach, TRACK.effect_reach)
    )
    castings = castings_of(  # on the track on which receptances are modelled
        smaller.track_of("main"), low - TRACK.casting_reach, high + TRACK.casting_reach
    )
    return Zone(
        smaller, int(inside[0]), int(inside[-1]), range(int(effect_supports[0]), int(effect_supports[-1]) + 1), castings
    )


def castings_of(track: Track, low: float, high: float) -> tuple[Casting, ...]:
    """Pieces of other rail, and of what lies within ``TRACK.section_ramp`` of it, between ``low`` and ``high`` [m].

    Cuts are at all ends, at ``TRACK.section_ramp`` from them, where a section grows from that of the rail, and every
    metre or so.

    Parameters
    ----------
    track : Track
        The track.
    low : float
        [m]
    high : float
        [m]

    Returns
    -------
    tuple of Casting
        In order of position.
    """
    cuts = {
        x for s in track.stretches for x in (s.start - TRACK.section_ramp, s.start, s.end, s.end + TRACK.section_ramp)
    }
    for s in track.stretches:
        if s.end - s.start > 2.0 * TRACK.section_ramp:
            cuts |= set(
                np.linspace(
                    s.start + TRACK.section_ramp, s.end - TRACK.section_ramp, 1 + max(1, round(s.end - s.start))
                )
            )
    castings = []
    for start, end in pairwise(sorted(cuts)):
        middle = 0.5 * (start + end)
        near = [s for s in track.stretches if s.start - TRACK.section_ramp < middle < s.end + TRACK.section_ramp]
        if near and end - start > TRACK.min_piece_length and end > low and start < high:
            stretch = next((s for s in reversed(near) if s.start <= middle < s.end), near[-1])
            inner = stretch.start + TRACK.section_ramp < middle < stretch.end - TRACK.section_ramp
            castings.append(Casting(stretch, RailStretch(float(start), float(end), track.rail_at(middle)), inner))
    return tuple(castings)


def casting_elements(zone: Zone, node: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Elements that each casting covers.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.
    node : (n_element + 1,) array of float
        Nodes. [m]

    Returns
    -------
    list of ((n,) array of int, (n,) array of float)
        By casting: elements, and the covered shares of their length.
    """
    length, elements = np.diff(node), []
    for c in zone.castings:
        covered = np.minimum(node[1:], c.piece.end) - np.maximum(node[:-1], c.piece.start)
        inside = np.flatnonzero(covered > NODE_TOLERANCE)
        elements.append((inside, covered[inside] / length[inside]))
    return elements
