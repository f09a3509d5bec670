"""Links of the track, each one scalar deformation with a spring, a damper and a mass, and the links that terms add.

Several terms are added one after the other, so that the sum of all springs stays positive. Terms with support numbers
can be moved to a track whose supports are numbered differently.
"""

from dataclasses import dataclass, fields, replace

from turnout.errors import SimulationError


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
ROUNDING = 1e-9  # rounding error of shares that add up to 1


def links_of(terms, track):
    """Links that ``terms`` add to ``track``; terms that scale its springs come first, the others act on the result."""
    found: list = []
    for term in sorted(terms, key=lambda term: not term.scales):
        found += term.links(left(track, found) if term.kind == "matrix" else track)
    return found


def ports_of(terms, track):
    """Ports that ``terms`` add to ``track``; each law uses the springs of the track with the links of the other terms.

    SimulationError if terms withhold more than the whole ballast of one sleeper: it would act in the wrong direction.
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
    """``track`` with the ``links`` that act on its pads, ballast and subgrade added to the values of these."""
    values: dict = {}
    for link in links:
        j = link.ends[0][0][1]
        own = (k.tag for k in track.support_links(j) if k.ends == link.ends and k.tag in OWN)
        for name, more in zip(OWN.get(next(own, ""), ()), (link.stiffness, link.damping)):
            values.setdefault(name, getattr(track, name).copy())[j] += more
    return track.with_(**values) if values else track


COUNTED = ("sleeper", "support", "first", "last")  # fields of terms that are support numbers


def moved(term, count):
    """The term at the same positions of a track that has ``count`` more supports at its start."""
    return replace(term, **{name: getattr(term, name) + count for name in _counted(term)})


def on_stretch(terms, keep):
    """The terms with the support numbers of a stretch, which has the supports ``inside`` (n_support,) of the track.

    Terms outside it are dropped. A range of supports that is partly outside is cut to the part inside.
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
