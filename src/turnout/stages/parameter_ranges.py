"""Values of track and vehicle files that no track or vehicle has: as a rule, a unit is wrong by a prefix."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import sqrt
from pathlib import Path
from typing import Any

from turnout.config.parameter_files import read_unchanged_parameters
from turnout.config.parameters import Number, ParameterSet
from turnout.errors import ConfigError, TurnoutError
from turnout.stages.track_plan import plan_errors

# (name, unit) -> smallest and largest value; each range is some ten times wider than what tracks and vehicles have.
RANGES = {
    ("pad_stiffness", "N/m"): (1e6, 1e11),
    ("ballast_stiffness", "N/m"): (1e6, 1e11),
    ("subgrade_stiffness", "N/m"): (1e6, 1e11),
    ("pad_damping", "N s/m"): (1e1, 1e7),
    ("ballast_damping", "N s/m"): (1e2, 1e8),
    ("sleeper_mass", "kg"): (10.0, 2000.0),
    ("ballast_mass", "kg"): (10.0, 10000.0),
    ("youngs_modulus", "Pa"): (1e10, 1e12),
    ("shear_modulus", "Pa"): (5e9, 5e11),
    ("second_moment", "m⁴"): (1e-7, 1e-2),
    ("area", "m²"): (1e-4, 1.0),
    ("mass", "kg/m"): (10.0, 1000.0),
    ("density", "kg/m³"): (1000.0, 20000.0),
    ("spacing", "m"): (0.2, 2.0),
    ("radius", "m"): (0.1, 0.65),  # not wider: a diameter must not pass for a radius
    ("contact", "N/m^1.5"): (1e9, 1e13),
    ("mass", "kg"): (100.0, 300000.0),
    ("wheelset_mass", "kg"): (100.0, 10000.0),
    # the softest secondary springs have 0.1 MN/m, a nearly rigid centre plate with side bearers 40 MN/m
    ("primary_stiffness", "N/m"): (1e4, 5e8),
    ("secondary_stiffness", "N/m"): (1e4, 5e8),
    ("suspension_stiffness", "N/m"): (1e4, 5e8),
    ("primary_damping", "N s/m"): (1e2, 2e6),
    ("secondary_damping", "N s/m"): (1e2, 2e6),
    ("suspension_damping", "N s/m"): (1e2, 2e6),
    ("base", "m"): (0.5, 10.0),
    ("payload", "kg"): (1.0, 500000.0),
    ("shear_coefficient", "-"): (0.05, 1.0),
    ("depth", "m"): (-0.05, 0.05),
    ("length", "m"): (0.01, 1000.0),
    ("level", "dB"): (-60.0, 60.0),
}
# Radius of gyration of cars and bogies: a wrong prefix of the mass or of the inertia changes it by a factor of 32.
GYRATION_RADII = (0.3, 12.0)  # m
# Radius of gyration of the cross-section of rails: 0.04 m of a light rail, 0.09 m of a crossing.
SECTION_RADII = (0.01, 0.3)  # m
POISSON_RATIOS = (0.0, 0.5)  # of any elastic material
MAX_MASS_DEVIATION = 0.1  # of the mass of a rail from density times area; wear takes less
MAX_TRACK_LENGTH = 5000.0  # m: a longer track is in millimetres
MAX_PRIOR = 5.0  # relative standard deviation: a larger one is in percent


def improbable_in_files(paths: Iterable[Path]) -> list[str]:
    """What every command states about improbable values of the track and vehicle files that it computes with.

    Parameters
    ----------
    paths : iterable of Path
        Track and vehicle files. One that cannot be read is left out, because its reader reports it.

    Returns
    -------
    list of str
        A sentence per value, each once, with file, line and entry.
    """
    sentences: dict[str, None] = {}
    for path in dict.fromkeys(paths):
        try:
            parameters = read_unchanged_parameters(path)
            sentences |= {f"improbable: {e}": None for e in (*improbable_values(parameters), *plan_errors(parameters))}
        except (TurnoutError, OSError):
            continue
    return [*sentences]


def improbable_values(parameters: ParameterSet) -> Iterator[ConfigError]:
    """An error for each number of a file that no track or vehicle has, and for each prior that is in percent.

    Parameters
    ----------
    parameters : ParameterSet
        A track or vehicle file.

    Yields
    ------
    ConfigError
        With file, line and entry. 0 is never improbable: it leaves a part out.
    """
    yield from _errors_of_pairs(parameters)
    for key, value in parameters.items():
        if isinstance(value, Number):
            yield from _errors(parameters, str(key), value)
        else:
            for entry in _mappings(value):
                yield from improbable_values(entry)


def _errors_of_pairs(parameters: ParameterSet) -> Iterator[ConfigError]:
    """Errors of numbers that do not go together: mass and inertia, the ends of the track, those of a rail."""
    yield from _errors_of_rail(parameters)
    yield from _errors_of_axles(parameters)
    mass, inertia = (_number_at(parameters, key, unit) for key, unit in (("mass", "kg"), ("inertia", "kg m²")))
    lightest, heaviest = RANGES["mass", "kg"]
    low, high = GYRATION_RADII
    if lightest <= mass <= heaviest and inertia > 0.0 and not low <= (radius := sqrt(inertia / mass)) <= high:
        problem = (
            f"{inertia:g} kg m² of {mass:g} kg are a radius of gyration of {radius:.3g} m, outside {low} to {high} m"
        )
        yield parameters.error("inertia", problem, "Correct one of the numbers or its unit")
    first, last = (_number_at(parameters, key, "m") for key in ("from", "to"))
    if last - first > MAX_TRACK_LENGTH:
        problem = f"from {first:g} to {last:g} m are more than {MAX_TRACK_LENGTH:g} m"
        yield parameters.error("from" if -first > last else "to", problem, "Correct the number or its unit")


def _errors_of_axles(parameters: ParameterSet) -> Iterator[ConfigError]:
    """Errors of axles of which the wheels would touch each other, or stand out of an end of the vehicle."""
    wheel = parameters.get("wheel")
    radius = _number_at(wheel, "radius", "m") if isinstance(wheel, ParameterSet) else 0.0
    axles = [(_number_at(axle, "centre", "m"), axle) for axle in _mappings(parameters.get("axles"))]
    length, remedy = _number_at(parameters, "length", "m"), "Correct the number or its unit"
    before = -radius
    for centre, axle in sorted(axles, key=lambda item: item[0]):
        if centre < radius or centre + radius > length > 0.0:
            problem = f"a wheel at {centre:g} m, of a radius of {radius:g} m, reaches beyond the end of {length:g} m"
            yield axle.error("centre", problem, remedy)
        elif 0.0 < centre - before < 2.0 * radius:
            problem = f"{centre:g} m is {centre - before:.3g} m behind another axle: their wheels would touch"
            yield axle.error("centre", problem, remedy)
        before = centre


def _errors_of_rail(parameters: ParameterSet) -> Iterator[ConfigError]:
    """Errors of a rail: mass against density and area, the two moduli, second moment against area."""
    mass, density = _number_at(parameters, "mass", "kg/m"), _number_at(parameters, "density", "kg/m³")
    area, second_moment = _number_at(parameters, "area", "m²"), _number_at(parameters, "second_moment", "m⁴")
    youngs, shear = (_number_at(parameters, f"{name}_modulus", "Pa") for name in ("youngs", "shear"))
    remedy = "Correct one of the numbers or its unit"
    if mass and density * area and abs(mass / (density * area) - 1.0) > MAX_MASS_DEVIATION:
        problem = f"{mass:g} kg/m, while density times area is {density * area:.4g} kg/m"
        yield parameters.error("mass", problem, remedy)
    if youngs and shear and not POISSON_RATIOS[0] <= (ratio := 0.5 * youngs / shear - 1.0) <= POISSON_RATIOS[1]:
        problem = f"{shear:g} Pa and a Young's modulus of {youngs:g} Pa are a Poisson's ratio of {ratio:.3g}"
        yield parameters.error("shear_modulus", f"{problem}, outside 0 to 0.5", remedy)
    if area > 0.0 and second_moment > 0.0:
        radius = sqrt(second_moment / area)
        if not SECTION_RADII[0] <= radius <= SECTION_RADII[1]:
            problem = f"{second_moment:g} m⁴ of {area:g} m² are a radius of gyration of {radius:.3g} m"
            yield parameters.error("second_moment", problem, remedy)


def _number_at(parameters: ParameterSet, key: str, unit: str) -> float:
    """The number at a key, 0 if there is none of this unit."""
    number = parameters.get(key)
    return number.value if isinstance(number, Number) and number.unit == unit else 0.0


def _mappings(value: Any) -> Iterator[ParameterSet]:
    """The mappings of a value: itself, or those of a list."""
    if isinstance(value, ParameterSet):
        yield value
    elif isinstance(value, list):
        for item in value:
            yield from _mappings(item)


def _errors(parameters: ParameterSet, key: str, number: Number) -> Iterator[ConfigError]:
    low, high = RANGES.get((key, number.unit), (None, None))
    is_surface = ".surfaces[" in (parameters.place.entry or "")  # it may extend to smaller positions
    size = abs(number.value) if key == "length" and is_surface else number.value
    if low is not None and high is not None and number.value and not low <= size <= high:
        problem = f"{number.value:g} {number.unit} is outside {low:g} to {high:g} {number.unit}"
        is_diameter = key == "radius" and low <= 0.5 * number.value <= high
        hint = f": half a diameter of {number.value:g} m is {0.5 * number.value:g} m" if is_diameter else ""
        yield parameters.error(key, problem, f"Correct the number or its unit{hint}")
    if number.prior is not None and number.prior > MAX_PRIOR:
        problem = f"a prior of {number.prior:g} is a standard deviation of {100 * number.prior:g} %"
        yield parameters.error(
            key, problem, f"Write it as a share, such as {number.prior / 100:g} for {number.prior:g} %"
        )
