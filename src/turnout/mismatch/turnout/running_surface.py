"""Running surface of blade, nose and joints, with the uncertain numbers of the track file as nuisances.

The depth of a nose may only be an estimate, for example. Its error must not count as evidence for an effect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.cross_validation import jackknife_errors, jackknife_steps
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.change_position import change_estimate
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.surface_priors import SURFACE, WHEELS
from turnout.mismatch.turnout.top_shape import top_shapes, with_shapes
from turnout.simulate.blade import is_on_blade

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from typing import Any

    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.rail_roughness import Waves
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.wheel_path import PathPart, Surfaces

POSITION_FIELDS = ("place", "start", "end")  # their spread is a share of the distance from the origin
LENGTH_FIELDS = ("length", "wavelength")


@dataclass(frozen=True)
class SurfaceParameter:
    """An uncertain number of a surface component: ``field`` of ``component``, with relative ``spread``.

    Positions have an additive error [m], all others a factor.
    """

    name: str
    component: PathPart
    field: str
    spread: float

    @property
    def nuisance(self) -> Nuisance:
        """The nuisance with its prior."""
        description = (
            f"{self.field} of the {type(self.component).__name__.lower()} at {_position_of(self.component):.2f} m"
        )
        if self.field in POSITION_FIELDS:
            sd = self.spread * abs(getattr(self.component, self.field))
            length = abs(_field_values(self.component, LENGTH_FIELDS)[0])
            max_step = min(SURFACE.max_step_sd, SURFACE.max_relative_step * length / sd)
            return Nuisance(
                self.name,
                "m",
                0.0,
                sd,
                meaning=f"{description} less its file's",
                max_step_sd=max_step,
                can_mask=False,
                group="surface",
            )
        value, bounds = (
            getattr(self.component, self.field),
            (-TRACK.bound_sds * self.spread, TRACK.bound_sds * self.spread),
        )
        if self.field == "share":  # below 0.95, or the file's where that is larger
            bounds = bounds[0], max(-0.05 - np.log(value), 0.0)
        elif self.field == "power":  # above a V, or a V as in the file
            bounds = min(0.01 - np.log(value), 0.0), bounds[1]
        return Nuisance(
            self.name, "-", 0.0, self.spread, None, bounds, f"ln {description}", can_mask=False, group="surface"
        )

    def value_at(self, by: float) -> float | tuple[float, ...]:
        """Its value with deviation ``by``; of a profile all values.

        Parameters
        ----------
        by : float
            Deviation from the value in the file, in the parameter's own unit.

        Returns
        -------
        float or tuple[float, ...]
        """
        value = getattr(self.component, self.field)
        if self.field in POSITION_FIELDS:
            return value + by
        factor = float(np.exp(by))
        return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value

    def estimate(self, by: float, error: float) -> dict[str, Any]:
        """Dict with its value for a deviation ``by`` with standard ``error``; of a profile its factor.

        Parameters
        ----------
        by : float
            Deviation from the value in the file, in the parameter's own unit.
        error : float
            Standard error of the deviation.

        Returns
        -------
        dict[str, Any]
        """
        profile = isinstance(getattr(self.component, self.field), tuple)
        file_value: Any = 1.0 if profile else getattr(self.component, self.field)
        value: Any = float(np.exp(by)) if profile else self.value_at(by)
        return {
            "term": f"running_surface_{type(self.component).__name__.lower()}",
            "place": _position_of(self.component),
            "name": self.field,
            "value": value,
            "se": error if self.field in POSITION_FIELDS else value * error,
            "unit": "-" if profile or self.field in ("share", "power") else "m",
            "filed": file_value,
            "off": abs(by) / self.nuisance.sd,
        }


class RunningSurface:
    """Surfaces of the ``routes`` of ``turnout`` that trains took.

    Numbers of components near the free ``waves`` of the rail may be off: ``parameters`` are these numbers, ``names``
    those of their nuisances.
    """

    def __init__(self, turnout: TurnoutTrack, waves: Waves, routes: Iterable[str]):
        x = np.arange(waves.start - WHEELS.roughness_margin, waves.end + WHEELS.roughness_margin, SURFACE.grid_step)
        route_components = [
            component for route in routes for components in turnout.surfaces(route) for component in components
        ]
        near_components = [
            component
            for component in turnout.spreads
            if component in route_components and np.max(np.abs(component(x, 0))) > SURFACE.min_depth
        ]
        listed = [
            (k, component, *entry)
            for k, component in enumerate(near_components)
            for entry in _component_spreads(turnout, component).items()
        ]
        self.turnout = turnout
        self.parameters = [
            SurfaceParameter(f"surface_{k}_{f}", component, f, s)
            for k, component, f, s in listed
            if _can_be_off(component, f)
        ]
        depth_spreads = {u.component: u.spread for u in self.parameters if u.field == "depth"}
        self.shapes = {route: top_shapes(turnout, route, depth_spreads) for route in routes}
        self.shape_names = tuple(name for shapes in self.shapes.values() for shape in shapes for name in shape.names)
        self.names = (*(u.name for u in self.parameters), *self.shape_names)

    def nuisances(self) -> list[Nuisance]:
        """Nuisances of every number that may be off, and of the shape of tops where wheels change."""
        shapes = [shape for shapes in self.shapes.values() for shape in shapes]
        return [*(u.nuisance for u in self.parameters), *(n for shape in shapes for n in shape.nuisances())]

    def surfaces(self, route: str, values: Values) -> Surfaces:
        """Surfaces of ``route``, each a tuple of components, with the numbers of ``values``.

        Parameters
        ----------
        route : str
            Route through the turnout.
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        Surfaces
        """
        changes: dict = {}
        for u in self.parameters:
            if values[u.name]:
                changes.setdefault(u.component, {})[u.field] = u.value_at(values[u.name])
        changed = {component: replace(component, **to) for component, to in changes.items()}
        surfaces = tuple(
            tuple(changed.get(component, component) for component in components)
            for components in self.turnout.surfaces(route)
        )
        return with_shapes(surfaces, self.shapes.get(route, []), values)

    def _tops(self, route: str) -> list[PathPart]:
        """Components of the tops of a route where wheels change to a blade; [] elsewhere."""
        surfaces = self.turnout.surfaces(route)
        lines = [is_on_blade(surface) for surface in surfaces]
        return [c for s in surfaces for c in s] if any(lines) and not all(lines) else []

    def estimate(self, case: Case, fit: Fit) -> Iterator[dict[str, Any]]:
        r"""Yield a dict for each number that ``fit`` determines better than the file, or that contradicts the file.

        The errors include the scatter between trains, and errors of the model that are the same at every axle.

        Values are those of the recordings without the prior, so that repeated visits are not all drawn to the file.
        With the fit's :math:`m, s^2` under a prior of variance :math:`\tau^2` they are :math:`m / c` of variance
        :math:`s^2 / c`, :math:`c = 1 - s^2 / \tau^2`, at least ``SURFACE.min_data_share``.
        Of the tops of a switch only the position of the change is measured, see ``change_position``.

        Parameters
        ----------
        case : Case
            The case that was fitted.
        fit : Fit
            A fit of the case.

        Yields
        ------
        Iterator[dict[str, Any]]
            Yield a dict for each number that ``fit`` determines better than the file, or that contradicts the file.
        """
        index = {n.name: k for k, n in enumerate(case.nuisances)}
        has_steps = self.parameters and fit.jacobian
        steps = jackknife_steps(case, fit, "passage") if has_steps else np.zeros((0, len(index)))
        between_trains = jackknife_errors(steps)
        changes = [change_estimate(self, route, case, fit, steps) for route in self.shapes]
        yield from (c for c in changes if c is not None and c["is_measured"])
        of_tops = {c for route in self.shapes for c in self._tops(route)}
        for u in self.parameters:
            if u.component in of_tops:
                continue
            k = index[u.name]
            model = SURFACE.model_position_error if u.field in POSITION_FIELDS else SURFACE.model_error
            sd, variance = u.nuisance.sd, fit.covariance[k, k]
            free = max(1.0 - variance / sd**2, SURFACE.min_data_share)
            by, error = fit.values[u.name] / free, float(np.sqrt(variance / free + between_trains[k] ** 2 + model**2))
            if error < SURFACE.max_error_ratio * sd or abs(by) > max(
                SURFACE.min_deviation_ratio * sd, SURFACE.min_deviation_ratio * error
            ):
                yield u.estimate(by, error)


def _component_spreads(turnout: TurnoutTrack, component: PathPart) -> Mapping[str, float]:
    """Relative spreads of the numbers of a component; the shape of an estimated nose is an estimate as well."""
    spreads = turnout.spreads[component]
    return (
        {**spreads, "power": SURFACE.shape_sd}
        if hasattr(component, "power") and "depth" in spreads and "power" not in spreads
        else spreads
    )


def _can_be_off(component: PathPart, field: str) -> bool:
    """Whether a number with a prior can be off: the spread of a position is a share, which is 0 at the origin."""
    return field != "places" and (field not in POSITION_FIELDS or getattr(component, field) != 0.0)


def _position_of(component: PathPart) -> float:
    return (*_field_values(component, POSITION_FIELDS), *getattr(component, "places", ()))[0]


def _field_values(component: PathPart, fields: Sequence[str]) -> list[float]:
    return [getattr(component, f) for f in fields if hasattr(component, f)]
