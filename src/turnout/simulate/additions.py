"""What terms add to a track together: each builds on the springs that the others leave, so that none turns negative."""

from turnout.errors import SimulationError

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
