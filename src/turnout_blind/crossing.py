"""A crossing panel: bearers, the crossing casting, and the nose, which every wheel meets slightly differently.

Fixed crossings weigh two to three times the rail and are stiffer. Wheels pass from the wing rail to the nose over dips
of 0.5 to 2 mm (Palsson and Nielsen 2012, Vehicle System Dynamics 50; Andersson and Dahlberg 1998, Proc. IMechE F 212).
"""

from dataclasses import dataclass, replace

import numpy as np

LENGTH, AHEAD = 3.4, 1.5  # length of the casting, and of its part before the nose [m]
RAMP = 0.6  # length over which the rail section grows into that of the casting [m]
WORN = 0.015  # half of the length over which wear has rounded the nose [m]


@dataclass(frozen=True)
class Crossing:
    """Casting and nose. ``bending`` and ``mass`` of the casting are factors on the values of the rail.

    The surface at the ``nose`` [m] lies ``depth`` [m] low over a ``length`` [m], of which ``share`` lies before it.
    """

    nose: float
    bending: float
    mass: float
    depth: float
    length: float
    share: float

    @property
    def ends(self):
        """Positions of the two ends of the casting, at half height of its ramps [m]."""
        return self.nose - AHEAD, self.nose - AHEAD + LENGTH

    def dip(self, x):
        """Dip of the surface at ``x`` [m]: wing and nose fall increasingly steeply to a rounded lowest point."""
        way = np.asarray(x) - self.nose
        reach = np.where(way < 0.0, self.share * self.length, (1.0 - self.share) * self.length)
        rounded = np.sqrt(way**2 + WORN**2) - WORN
        return self.depth * np.clip(1.0 - rounded / reach, 0.0, None) ** 1.5

    def profile(self, x):
        """(bending, mass) at ``x`` as factors on the values of the rail."""
        start, end = self.ends
        there = np.clip(np.minimum(x - start, end - x) / RAMP + 0.5, 0.0, 1.0)
        return tuple(1.0 + (factor - 1.0) * there for factor in (self.bending, self.mass))


def bearers(rng):
    """Half the mass of a bearer over half that of a sleeper: (nominal, true)."""
    filed = float(rng.uniform(1.15, 1.5))
    return filed, filed * float(np.exp(0.03 * rng.normal()))


def draw_crossing(rng, boundary):
    """(true, nominal) crossing with its nose 1 to 2.5 m behind the ``boundary`` [m]."""
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
    """Add the crossing to the world: casting and nose.

    Each wheel meets the nose differently: sd of a tenth of its depth, and 2 cm of its position.
    """
    world.profile = crossing.profile(world.grid.start + world.grid.step * np.arange(world.grid.n))
    world.surface.append(crossing.dip)
    for train in trains.values():
        for axle in range(1, train.axles().size + 1):
            depth, place = crossing.depth * (1.0 + 0.1 * rng.normal()), crossing.nose + 0.02 * rng.normal()
            mine = replace(crossing, depth=float(depth), nose=float(place))
            world.treads.setdefault((train.name, axle), []).append(
                lambda x, phase, radius, mine=mine: mine.dip(x) - crossing.dip(x)
            )
