"""Links of the track, each one scalar deformation with a spring, a damper and a mass, and the links that terms add.

Several terms are added one after the other, so that the sum of all springs stays positive. Terms with support numbers
can be moved to a track whose supports are numbered differently.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import TYPE_CHECKING

from turnout.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from turnout.simulate.effect import Effect
    from turnout.simulate.force_laws import Port
    from turnout.simulate.track import Track


@dataclass(frozen=True)
class Link:
    r"""Adds :math:`k v v^T`, :math:`c v v^T` and :math:`m v v^T` to the track's matrices.

    ``ends`` is the sparse vector v: pairs of a degree of freedom and its weight. Degrees of freedom are
    named: ("rail", j) is the rail over support j, ("rail", j, k) the k-th node from there, ("sleeper", j),
    ("ballast", j), or a further one of support j such as ("zener", j). Naming it creates it.
    ``stiffness`` k [N/m], ``damping`` c [N s/m], ``mass`` m [kg]; ``loss_factor`` is hysteretic, used in the frequency
    domain only. A negative stiffness removes stiffness of the base track; the sum must be positive definite.
    ``tag`` names the component ("pad", "ballast", ...); gradients use it.
    """

    ends: tuple
    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    loss_factor: float = 0.0
    tag: str = ""

    def __post_init__(self) -> None:
        if not self.ends:
            raise SimulationError(f"link {self.tag!r}: acts on no degree of freedom.")
        if isfinite(self.stiffness + self.damping + self.mass + self.loss_factor):
            return  # so each of them is; links are made by the hundred thousand
        for value in (self.stiffness, self.damping, self.mass, self.loss_factor):
            if not isfinite(value):
                raise SimulationError(f"link {self.tag!r} at {self.ends}: {value!r} is not a finite number.")


SPRING_FIELDS = {
    "pad": ("pad_stiffness", "pad_damping"),
    "ballast": ("ballast_stiffness", "ballast_damping"),
    "subgrade": ("subgrade_stiffness", "subgrade_damping"),
}
SHARE_TOLERANCE = 1e-9  # rounding error of shares that add up to 1


def links_of(terms: Sequence[Effect], track: Track) -> list[Link]:
    """Links that ``terms`` add to ``track``; terms that scale its springs come first, the others act on the result.

    Parameters
    ----------
    terms : sequence of Effect
        Effects added to the base model.
    track : Track
        The track.

    Returns
    -------
    list of Link
        Links of all terms.
    """
    links: list = []
    for term in sorted(terms, key=lambda term: not term.scales_track):
        links += term.links(with_links(track, links) if term.effect_type == "matrix" else track)
    return links


def ports_of(terms: Sequence[Effect], track: Track) -> list[Port]:
    """Ports that ``terms`` add to ``track``; each law uses the springs of the track with the links of the other terms.

    Parameters
    ----------
    terms : sequence of Effect
        Effects added to the base model.
    track : Track
        The track.

    Returns
    -------
    list of Port
        Ports of all terms, in the order of the terms.

    Raises
    ------
    SimulationError
        If terms withhold more than the whole ballast of one sleeper: it would act in the wrong direction.
    """
    ports: list = []
    withheld: dict[tuple, list] = {}
    for k, term in enumerate(terms):
        other_links = links_of([*terms[:k], *terms[k + 1 :]], track) if term.effect_type == "port" else []
        for port in term.ports(with_links(track, other_links)):
            ports.append(port)
            withheld.setdefault(port.ends, []).append((term.withheld_share, f"{term.name} ({port.label})"))
    for shares in withheld.values():
        if sum(share for share, _ in shares) > 1.0 + SHARE_TOLERANCE:
            names = " and ".join(name for share, name in shares if share)
            raise SimulationError(f"{track.name}: {names} withhold more than there is; keep one of them.")
    return ports


def with_links(track: Track, links: Sequence[Link]) -> Track:
    """``track`` with the ``links`` that act on its pads, ballast and subgrade added to the values of these.

    Parameters
    ----------
    track : Track
        The track.
    links : sequence of Link
        Links whose stiffness and damping are added.

    Returns
    -------
    Track
        The same track where no link acts on a spring of it.
    """
    values: dict = {}
    for link in links:
        j, names = link.ends[0][0][1], SPRING_FIELDS.get(track.spring_between(link.ends), ())
        for name, addition in zip(names, (link.stiffness, link.damping)):
            if name not in values:
                values[name] = getattr(track, name).copy()
            values[name][j] += addition
    return track.with_(**values) if values else track


SUPPORT_FIELDS = ("sleeper", "support", "first", "last")  # fields of terms that are support numbers


def shift_supports(term: Effect, count: int) -> Effect:
    """The term at the same positions of a track that has ``count`` more supports at its start.

    Parameters
    ----------
    term : Effect
        The effect.
    count : int
        Number that is added to its support numbers; may be negative.

    Returns
    -------
    Effect
        A copy with other support numbers.
    """
    changed = {name: getattr(term, name) + count for name in _support_fields(term)}
    return replace(term, **changed)  # type: ignore[type-var]  # every term is a dataclass


def terms_on_stretch(terms: Sequence[Effect], inside: np.ndarray) -> tuple[Effect, ...]:
    """The terms with the support numbers of a stretch, which has the supports ``inside`` (n_support,) of the track.

    Terms outside it are dropped. A range of supports that is partly outside is cut to the part inside.

    Parameters
    ----------
    terms : sequence of Effect
        Effects with the support numbers of the whole track.
    inside : (n_support,) array of bool
        Whether each support of the track is in the stretch; the stretch is contiguous.

    Returns
    -------
    tuple of Effect
        Terms with the numbers of the stretch.
    """
    first, last = int(inside.argmax()), len(inside) - 1 - int(inside[::-1].argmax())
    terms_inside = []
    for term in terms:
        names = _support_fields(term)
        is_range = {"first", "last"} <= names
        start, end = (getattr(term, name) for name in ("first", "last")) if is_range else (first, last)
        support_numbers = [getattr(term, name) for name in names - {"first", "last"}]
        if start > last or end < first or not all(first <= value <= last for value in support_numbers):
            continue
        if is_range:
            term = replace(term, first=max(start, first), last=min(end, last))  # type: ignore[type-var]
        terms_inside.append(shift_supports(term, -first))
    return tuple(terms_inside)


def _support_fields(term: Effect) -> set[str]:
    return {f.name for f in fields(term) if f.name in SUPPORT_FIELDS}  # type: ignore[arg-type]
