"""Running surface of blade, nose and joints, with the uncertain numbers of the track file as nuisances.

The depth of a nose may only be an estimate, for example. Its error must not count as evidence for an effect.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.engine.case import Nuisance
from turnout.mismatch.engine.cross_validation import disagreement
from turnout.mismatch.turnout.wheel_roughness import BEYOND

PLACES = ("place", "start", "end")  # their spread is a share of the distance from the origin
LENGTHS = ("length", "wavelength")
SHAPE = 0.25  # sd of ln power of a kink with an estimated depth: 1.2 to 3.3, from a V to a cusp
STEP = 0.02  # m, or change of a logarithm, for the derivative of a passage
MOVED = 0.3  # share of its length by which a component may move in one fit step: the derivative is local
LEAST = 1e-6  # m; shallower components are ignored
# Model errors that are the same at every axle, of a logarithm and in metres. With long trains depth was 15 % and
# length 19 % too small and a position 4 cm off, ten times the errors of the fit.
MODEL, MODEL_PLACE = 0.1, 0.02
TELLS = 0.5  # largest error of a reported number over its prior sd,
OTHERWISE = 2.0  # unless it deviates by so many prior sd and so many errors
ALONE = 0.5  # least share of the information on a number that is attributed to the recordings


@dataclass(frozen=True)
class Unsure:
    """An uncertain number of a surface component: ``field`` of ``component``, with relative ``spread``.

    Positions have an additive error [m], all others a factor.
    """

    name: str
    part: object
    field: str
    spread: float

    @property
    def nuisance(self):
        """The nuisance with its prior."""
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
        """Its value with deviation ``by``; of a profile all values."""
        value = getattr(self.part, self.field)
        if self.field in PLACES:
            return value + by
        factor = float(np.exp(by))
        return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value

    def told(self, by, error):
        """Dict with its value for a deviation ``by`` with standard ``error``; of a profile its factor."""
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
    """Surfaces of the ``routes`` of ``turnout`` that trains took.

    Numbers of components within ``ROUGHNESS_MARGIN`` of the free ``waves`` of the rail may be off: ``parameters`` are
    these numbers, ``names`` those of their nuisances.
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
        """Nuisances of every number that may be off."""
        return [u.nuisance for u in self.unsure]

    def surfaces(self, route, values):
        """Surfaces of ``route``, each a tuple of components, with the numbers of ``values``."""
        changes: dict = {}
        for u in self.unsure:
            if values[u.name]:
                changes.setdefault(u.part, {})[u.field] = u.moved(values[u.name])
        changed = {part: replace(part, **to) for part, to in changes.items()}
        return tuple(tuple(changed.get(part, part) for part in parts) for parts in self.turnout.surfaces(route))

    def told(self, case, fit):
        r"""Yield a dict for each number that ``fit`` determines better than the file, or that contradicts the file.

        The errors include the scatter between trains, and errors of the model that are the same at every axle.

        Values are those of the recordings without the prior, so that repeated visits are not all drawn to the file.
        With the fit's :math:`m, s^2` under a prior of variance :math:`\tau^2` they are :math:`m / c` of variance
        :math:`s^2 / c`, :math:`c = 1 - s^2 / \tau^2`, at least ``MIN_DATA_SHARE``.
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
    """Relative spreads of the numbers of a component; the shape of an estimated nose is an estimate as well."""
    said = turnout.spreads[part]
    return {**said, "power": SHAPE} if hasattr(part, "power") and "depth" in said and "power" not in said else said


def _may_move(part, field):
    """Whether a number with a prior can be off: the spread of a position is a share, which is 0 at the origin."""
    return field != "places" and (field not in PLACES or getattr(part, field) != 0.0)


def _where(part):
    return (*_values(part, PLACES), *getattr(part, "places", ()))[0]


def _values(part, fields):
    return [getattr(part, f) for f in fields if hasattr(part, f)]
