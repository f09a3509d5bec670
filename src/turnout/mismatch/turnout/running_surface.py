"""Blade, nose and joints as the track's file has them: each number is known as well as its prior says, a nuisance.

A nose that is an estimate may be half as deep again. What that does to a passage is no effect that the model left out.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.engine.case import Nuisance
from turnout.mismatch.engine.cross_validation import disagreement
from turnout.mismatch.turnout.wheel_roughness import BEYOND

PLACES = ("place", "start", "end")  # known to a share of their distance from the origin, all else to a factor
LENGTHS = ("length", "wavelength")
SHAPE = 0.25  # ln of the power of a kink whose depth is an estimate: 1.2 to 3.3, from a V to a cusp
STEP = 0.02  # m, or of a factor's logarithm: over which a passage's derivative is taken
MOVED = 0.3  # of its own length a part may move in one step of a fit: beyond, its derivative says nothing
LEAST = 1e-6  # m: a part that is nowhere deeper is not there
# What the model does wrong at every axle alike, of a logarithm and in metres: long trains had depth 15 and length 19 %
# too small, a place 4 cm off, where the fit's own errors were a tenth of that.
MODEL, MODEL_PLACE = 0.1, 0.02
TELLS = 0.5  # of the prior's standard deviation: a number that is known no better than that is the file's,
OTHERWISE = 2.0  # unless it is off by so many of the prior's and of its own
ALONE = 0.5  # least share of what is known of a number that recordings are taken to have said


@dataclass(frozen=True)
class Unsure:
    """A number of a part: ``field`` of ``part``, off by a factor, a place by a way [m], with relative ``spread``."""

    name: str
    part: object
    field: str
    spread: float

    @property
    def nuisance(self):
        """Its prior."""
        said = f"{self.field} of the {type(self.part).__name__.lower()} at {_where(self.part):.2f} m"
        if self.field in PLACES:
            sd = self.spread * abs(getattr(self.part, self.field))
            trust = min(3.0, MOVED * _values(self.part, LENGTHS)[0] / sd)
            return Nuisance(self.name, "m", 0.0, sd, meaning=f"{said} less its file's", trust=trust, bends=False)
        value, bounds = getattr(self.part, self.field), (-6.0 * self.spread, 6.0 * self.spread)
        if self.field == "share":
            bounds = bounds[0], -0.05 - np.log(value)
        elif self.field == "power":
            bounds = 0.01 - np.log(value), bounds[1]
        return Nuisance(self.name, "-", 0.0, self.spread, None, bounds, f"ln {said}", bends=False)

    def moved(self, by):
        """Its value where it is off by ``by``; of a profile all values."""
        value = getattr(self.part, self.field)
        if self.field in PLACES:
            return value + by
        factor = float(np.exp(by))
        return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value

    def told(self, by, error):
        """What a fit that has it off by ``by`` with standard ``error`` says of it; of a profile its factor."""
        profile = isinstance(getattr(self.part, self.field), tuple)
        value, filed = (float(np.exp(by)), 1.0) if profile else (self.moved(by), getattr(self.part, self.field))
        return {
            "term": f"running_surface_{type(self.part).__name__.lower()}",
            "place": _where(self.part),
            "name": self.field,
            "value": value,
            "se": error if self.field in PLACES else value * error,
            "unit": "-" if profile or self.field in ("share", "power") else "m",
            "filed": filed,
            "off": abs(by) / self.nuisance.sd,
        }


class RunningSurface:
    """The ``routes`` of ``turnout`` that trains took; numbers of what lies on one of them within ``BEYOND`` of the
    rail's free ``waves`` may be off.

    ``unsure`` are these numbers, ``names`` of their nuisances.
    """

    def __init__(self, turnout, waves, routes):
        x = np.arange(waves.start - BEYOND, waves.end + BEYOND, 0.02)
        met = [part for route in routes for parts in turnout.surfaces(route) for part in parts]
        near = [part for part in turnout.spreads if part in met and np.max(np.abs(part(x, 0))) > LEAST]
        listed = [(k, part, *of) for k, part in enumerate(near) for of in _spreads(turnout, part).items()]
        self.turnout = turnout
        self.unsure = [Unsure(f"surface_{k}_{f}", part, f, s) for k, part, f, s in listed if _may_move(part, f)]
        self.names = tuple(u.name for u in self.unsure)

    def nuisances(self):
        """Of every number that may be off."""
        return [u.nuisance for u in self.unsure]

    def surfaces(self, route, values):
        """Surfaces of ``route``, each a tuple of parts, with the numbers that ``values`` have."""
        changes: dict = {}
        for u in self.unsure:
            if values[u.name]:
                changes.setdefault(u.part, {})[u.field] = u.moved(values[u.name])
        changed = {part: replace(part, **to) for part, to in changes.items()}
        return tuple(tuple(changed.get(part, part) for part in parts) for parts in self.turnout.surfaces(route))

    def told(self, case, fit):
        r"""What ``fit`` says of the numbers that its recordings tell more of than the file does, or otherwise, a dict
        each; with what the trains disagree by, and what the model does wrong at every axle alike, in their errors.

        It is what recordings say without the file, which each visit would be drawn to: with the fit's :math:`m, s^2`
        under a prior of variance :math:`\tau^2` it is :math:`m / c` of variance :math:`s^2 / c`,
        :math:`c = 1 - s^2 / \tau^2`, at least ``ALONE``.
        """
        index = {n.name: k for k, n in enumerate(case.nuisances)}
        apart = disagreement(case, fit, "passage") if self.unsure and fit.jacobian else np.zeros(len(index))
        for u in self.unsure:
            k = index[u.name]
            model = MODEL_PLACE if u.field in PLACES else MODEL
            sd, own = u.nuisance.sd, fit.covariance[k, k]
            free = max(1.0 - own / sd**2, ALONE)
            by, error = fit.values[u.name] / free, float(np.sqrt(own / free + apart[k] ** 2 + model**2))
            if error < TELLS * sd or abs(by) > max(OTHERWISE * sd, OTHERWISE * error):
                yield u.told(by, error)


def _spreads(turnout, part):
    """How well the numbers of a part are known; the shape of an estimated nose is an estimate as well."""
    said = turnout.spreads[part]
    return {**said, "power": SHAPE} if hasattr(part, "power") and "depth" in said and "power" not in said else said


def _may_move(part, field):
    """Whether a number that has a prior can be off: a place at the origin is known to a share of nothing."""
    return field != "places" and (field not in PLACES or getattr(part, field) != 0.0)


def _where(part):
    return (*_values(part, PLACES), *getattr(part, "places", ()))[0]


def _values(part, fields):
    return [getattr(part, f) for f in fields if hasattr(part, f)]
