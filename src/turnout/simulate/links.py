"""A link: one scalar deformation of the track with its spring, damper and mass.

What terms add to a track together: each builds on the springs that the others leave, so that none turns negative.

Terms that count a track's supports, on a track whose supports are counted from elsewhere.
"""

from dataclasses import dataclass, fields, replace

from turnout.errors import SimulationError


@dataclass(frozen=True)
class Link:
    r"""Adds :math:`k v v^T`, :math:`c v v^T` and :math:`m v v^T` to the track's matrices.

    ``ends`` is the sparse vector v: pairs of a degree of freedom and its weight. Degrees of freedom are
    named: ("rail", j) the rail over support j, ("rail", j, k) the k-th node from there, ("sleeper", j),
    ("ballast", j), or a further one of support j such as ("zener", j), which is created by naming it.
    ``stiffness`` k [N/m], ``damping`` c [N s/m], ``mass`` m [kg], ``loss_factor`` hysteretic, frequency domain
    only. A negative stiffness takes away what the base track has; the sum must stay positive definite.
    ``tag`` says what the link stands for ("pad", "ballast", ...) so that gradients find it.
    """

    ends: tuple
    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    loss_factor: float = 0.0
    tag: str = ""

    def __post_init__(self):
        if not self.ends:
            raise SimulationError(f"link {self.tag!r}: acts on no degree of freedom.")
        for value in (self.stiffness, self.damping, self.mass, self.loss_factor):
            if not abs(value) < float("inf"):
                raise SimulationError(f"link {self.tag!r} at {self.ends}: {value!r} is not a finite number.")


OWN = {
    "pad": ("pad_stiffness", "pad_damping"),
    "ballast": ("ballast_stiffness", "ballast_damping"),
    "subgrade": ("subgrade_stiffness", "subgrade_damping"),
}
ROUNDING = 1e-9  # of shares that add up to all


def links_of(terms, track):
    """Links that ``terms`` add to ``track``: those first that scale its springs, so that the others build on these."""
    found: list = []
    for term in sorted(terms, key=lambda term: not term.scales):
        found += term.links(left(track, found) if term.kind == "matrix" else track)
    return found


def ports_of(terms, track):
    """Ports that ``terms`` add to ``track``, each law made of the springs that the other terms' links leave.

    SimulationError where two terms withhold the ballast of one sleeper: together they would push where it pulls.
    """
    found: list = []
    taken: dict[tuple, list] = {}
    for k, term in enumerate(terms):
        others = links_of([*terms[:k], *terms[k + 1 :]], track) if term.kind == "port" else []
        for port in term.ports(left(track, others)):
            found.append(port)
            taken.setdefault(port.ends, []).append((term.withheld, f"{term.name} ({port.label})"))
    for shares in taken.values():
        if sum(share for share, _ in shares) > 1.0 + ROUNDING:
            both = " and ".join(name for share, name in shares if share)
            raise SimulationError(f"{track.name}: {both} withhold more than there is; keep one of them.")
    return found


def left(track, links):
    """``track`` with what ``links`` add to its own pads, ballast and subgrade as part of these."""
    values: dict = {}
    for link in links:
        j = link.ends[0][0][1]
        own = (k.tag for k in track.support_links(j) if k.ends == link.ends and k.tag in OWN)
        for name, more in zip(OWN.get(next(own, ""), ()), (link.stiffness, link.damping)):
            values.setdefault(name, getattr(track, name).copy())[j] += more
    return track.with_(**values) if values else track


COUNTED = ("sleeper", "support", "first", "last")  # fields of terms that count supports from the track's start


def moved(term, count):
    """The term at the same places of a track that has ``count`` supports more in front."""
    return replace(term, **{name: getattr(term, name) + count for name in _counted(term)})


def on_stretch(terms, keep):
    """The terms as a stretch counts its supports, ``keep`` (n_support,) of the whole track; none of what lies outside.

    Of a run of supports that lies partly outside, the part inside is left.
    """
    first, last = int(keep.argmax()), len(keep) - 1 - int(keep[::-1].argmax())
    found = []
    for term in terms:
        names = _counted(term)
        run = {"first", "last"} <= names
        start, end = (term.first, term.last) if run else (first, last)
        own = [getattr(term, name) for name in names - {"first", "last"}]
        if start > last or end < first or not all(first <= value <= last for value in own):
            continue
        if run:
            term = replace(term, first=max(start, first), last=min(end, last))
        found.append(moved(term, -first))
    return tuple(found)


def _counted(term):
    return {f.name for f in fields(term) if f.name in COUNTED}
