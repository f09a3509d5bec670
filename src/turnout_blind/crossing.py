"""A crossing panel: bearers, a crossing cast into the rail, and the nose that every wheel meets a little otherwise.

Fixed crossings weigh two to three times the rail and are stiffer; wheels leave the wing rail and climb the nose over
dips of 0.5 to 2 mm (Palsson and Nielsen 2012, Vehicle System Dynamics 50; Andersson and Dahlberg 1998, Proc. IMechE F
212).
"""

from dataclasses import dataclass, replace

import numpy as np

LENGTH, AHEAD = 3.4, 1.5  # of the casting, and of it before the nose [m]
RAMP = 0.6  # over which its section grows from the rail's [m]
WORN = 0.015  # half of the way over which the nose is rounded [m]


@dataclass(frozen=True)
class Crossing:
    """``bending`` and ``mass`` of the casting as factors on the rail's; its ``nose`` [m] lies ``depth`` [m] low over a
    ``length`` [m], of which ``share`` lies before it."""

    nose: float
    bending: float
    mass: float
    depth: float
    length: float
    share: float

    @property
    def ends(self):
        """Where the casting begins and ends, halfway up its ramps [m]."""
        return self.nose - AHEAD, self.nose - AHEAD + LENGTH

    def dip(self, x):
        """Dip of the surface [m]: wing and nose fall ever faster to their meeting, which wear has rounded."""
        way = np.asarray(x) - self.nose
        reach = np.where(way < 0.0, self.share * self.length, (1.0 - self.share) * self.length)
        rounded = np.sqrt(way**2 + WORN**2) - WORN
        return self.depth * np.clip(1.0 - rounded / reach, 0.0, None) ** 1.5

    def profile(self, x):
        """(bending, mass) at ``x`` as factors on the rail's."""
        start, end = self.ends
        there = np.clip(np.minimum(x - start, end - x) / RAMP + 0.5, 0.0, 1.0)
        return tuple(1.0 + (factor - 1.0) * there for factor in (self.bending, self.mass))


def bearers(rng):
    """Half the mass of a bearer over that of a sleeper: (as filed, as it is)."""
    filed = float(rng.uniform(1.15, 1.5))
    return filed, filed * float(np.exp(0.03 * rng.normal()))


def draw_crossing(rng, boundary):
    """(what there is, what the drawings say): the nose 1 to 2.5 m behind the ``boundary`` [m]."""
    there = Crossing(
        boundary + float(rng.uniform(1.0, 2.5)), float(rng.uniform(1.4, 2.2)), float(rng.uniform(1.8, 2.8)),
        float(rng.uniform(4e-4, 1.6e-3)), float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.4, 0.6)),
    )  # fmt: skip

    def off(value, spread):
        return value * float(np.exp(spread * rng.normal()))

    filed = Crossing(
        there.nose + 0.05 * float(rng.normal()), off(there.bending, 0.05), off(there.mass, 0.03),
        off(there.depth, 0.3), off(there.length, 0.15), 0.5,
    )  # fmt: skip
    return there, filed


def cast_in(rng, world, crossing, trains):
    """Put the crossing into the world: its casting, its nose, and by how much each wheel's profile meets it otherwise
    (a tenth of its depth, 2 cm of its place)."""
    world.profile = crossing.profile(world.grid.start + world.grid.step * np.arange(world.grid.n))
    world.surface.append(crossing.dip)
    for train in trains.values():
        for axle in range(1, train.axles().size + 1):
            depth, place = crossing.depth * (1.0 + 0.1 * rng.normal()), crossing.nose + 0.02 * rng.normal()
            mine = replace(crossing, depth=float(depth), nose=float(place))
            world.treads.setdefault((train.name, axle), []).append(
                lambda x, phase, radius, mine=mine: mine.dip(x) - crossing.dip(x)
            )
