"""One monitored site: what its owner assumes (nominal), and what there really is before any effect (truth)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind import vehicle
from turnout_blind.crossing import Crossing, add_crossing, draw_bearer_mass_ratio, draw_crossing
from turnout_blind.grid import Grid, Rail
from turnout_blind.instrument import MeasurementChain
from turnout_blind.roughness import rail_roughness, wheel_roughness
from turnout_blind.switch import Switch, add_switch, draw_switch
from turnout_blind.true_site import SPACING, World
from turnout_blind.vehicle import Car, Train

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

SENSOR_SETS = ((2.4, 4.5, 6.6, 8.7), (2.4, 4.2, 6.3, 9.0), (1.8, 3.9, 6.0, 8.1), (2.1, 4.2, 6.6, 9.0))
NOMINAL_RANGES = {
    "pad": (1.6e8, 4.8e8),
    "pad_damping": (1.2e4, 3.5e4),
    "mass": (135.0, 175.0),
    "ballast": (6e7, 1.6e8),
    "ballast_damping": (4e4, 9e4),
}
SUPPORT_SCATTER = {"pad": 0.08, "pad_damping": 0.15, "mass": 0.02, "ballast": 0.10, "ballast_damping": 0.15}
RAIL_DAMPING = 4000.0  # [N s/m²], loss factor 0.010 at 1040 Hz; Thompson 2009, Railway Noise and Vibration: 0.02
CAMPAIGNS = (datetime(2024, 2, 6, 9, 0), datetime(2024, 7, 16, 9, 0))
FIRST_PASSAGE, PASSAGE_INTERVAL = datetime(2024, 7, 16, 11, 0), timedelta(minutes=30)
PLAIN, CROSSING, SWITCH = PANELS = ("plain", "crossing", "switch")
COMMON_ERROR = {"pad": 0.08, "pad_damping": 0.2, "mass": 0.02, "ballast": 0.08, "ballast_damping": 0.2}


@dataclass(frozen=True)
class PlannedPassage:
    """One passage: ``train`` name, ``speed`` [m/s], ``phase`` [rad] of its wheels, true rail ``temperature`` [°C].

    ``when`` is its time; None: in turn after the last campaign.
    """

    train: str
    speed: float
    phase: float
    temperature: float
    when: datetime | None = None


@dataclass
class Site:
    """A site with its nominal values and its true ``world``.

    ``nominal`` holds the values of the two ``zones`` [(from, to)]; ``trains`` are as filed, ``true_trains`` as they
    run. ``sensors`` and ``hammer_positions`` are nominal positions [m]; ``chains`` has one entry per sensor.
    ``temperatures`` are those of the ``campaigns`` [°C]. ``crossing`` and ``switch`` are as filed, None on other track.
    """

    zones: tuple[tuple[float, float], ...]
    nominal: tuple[dict[str, float], ...]
    sensors: tuple[float, ...]
    hammer_positions: tuple[float, ...]
    trains: dict[str, Train]
    true_trains: dict[str, Train]
    passages: list[PlannedPassage]
    temperatures: tuple[float, ...]
    world: World
    chains: tuple[MeasurementChain, ...]
    force: MeasurementChain
    roughness: dict[Any, Callable[..., np.ndarray]] = field(default_factory=dict)
    tip: float = 1.1e9
    crossing: Crossing | None = None
    switch: Switch | None = None
    campaigns: tuple[datetime, ...] = CAMPAIGNS

    def passage_time(self, k: int) -> datetime:
        """Time of a passage.

        Parameters
        ----------
        k : int
            Number of the passage.

        Returns
        -------
        datetime
            UTC, without a time zone.
        """
        return self.passages[k].when or FIRST_PASSAGE + k * PASSAGE_INTERVAL

    def names(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(f"A{i + 1}" for i in range(len(self.sensors)))


def draw_site(
    rng: np.random.Generator, same_temperature: bool | None = None, one_speed: bool | None = None, panel: str = PLAIN
) -> Site:
    """Draw a site.

    ``same_temperature`` in both campaigns or not (None: in one case of four), ``one_speed`` for all trains or not
    (None: in one case of ten), ``panel`` of ``PANELS``.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    same_temperature : bool or None
        Whether both campaigns have the same temperature; None: in one case of four.
    one_speed : bool or None
        Whether all trains have one speed; None: in one case of ten.
    panel : str
        One of ``PANELS``.

    Returns
    -------
    Site
        The site.
    """
    one_speed = bool(rng.random() < 0.1) if one_speed is None else one_speed
    boundary = float(rng.choice([3.9, 4.5, 5.7, 6.9]))
    zones = ((-45.0, boundary), (boundary, 57.0))
    nominal = _draw_nominal(rng)
    sensors = SENSOR_SETS[rng.integers(len(SENSOR_SETS))]
    unused_sensor = int(rng.integers(1, 3))
    trains = _nominal_trains()
    temperatures = _draw_temperatures(rng, same_temperature)
    chains = tuple(
        MeasurementChain(
            f"A{i + 1}", 1000.0, float(1.0 + 0.01 * rng.normal()), float(rng.uniform(2500, 4500)),
            float(rng.uniform(10, 25)), noise=float(rng.uniform(0.02, 0.06)),
        )
        for i in range(len(sensors))
    )  # fmt: skip
    force = MeasurementChain(
        "force", 22.2e3, float(1.0 + 0.01 * rng.normal()), 0.0, noise=2.0, drift=0.5, coupling=0.05
    )
    site = Site(
        zones, nominal, sensors, tuple(x for k, x in enumerate(sensors) if k != unused_sensor), trains,
        {name: _draw_true_train(train, rng) for name, train in trains.items()},
        _draw_passages(rng, temperatures, one_speed), temperatures, _draw_world(rng, zones, nominal), chains, force,
        tip=1.1e9 * float(np.exp(0.1 * rng.normal())),
    )  # fmt: skip
    site.world.sensor_shift = {c.name: float(0.015 * rng.normal()) for c in chains}
    site.roughness = _draw_roughness(rng, site.true_trains)
    return {CROSSING: with_crossing, SWITCH: with_switch}[panel](rng, site) if panel != PLAIN else site


def _lay_bearers(rng: np.random.Generator, site: Site) -> float:
    """Long bearers instead of sleepers from the zone boundary on; returns this boundary. [m]"""
    (west, east), boundary = site.nominal, site.zones[1][0]
    nominal_factor, true_factor = draw_bearer_mass_ratio(rng)
    site.nominal = west, {**east, "mass": round(nominal_factor * east["mass"])}
    site.world.mass[site.world.position > boundary] *= true_factor
    return boundary


def with_crossing(rng: np.random.Generator, site: Site) -> Site:
    """The site with bearers from the zone boundary on, and a crossing behind it.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    Site
        The same site, changed.
    """
    boundary = _lay_bearers(rng, site)
    true_crossing, site.crossing = draw_crossing(rng, boundary)
    add_crossing(rng, site.world, true_crossing, site.trains)
    site.chains = tuple(replace(c, full_scale=5.0 * c.full_scale) for c in site.chains)  # impacts at the nose are hard
    return site


def with_switch(rng: np.random.Generator, site: Site) -> Site:
    """The site with long bearers from the zone boundary on, and a blade near the sensors.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    Site
        The same site, changed.
    """
    _lay_bearers(rng, site)
    true_switch, site.switch = draw_switch(rng, site.world.position, site.world.grid)
    add_switch(rng, site.world, true_switch, site.trains)
    site.chains = tuple(replace(c, full_scale=5.0 * c.full_scale) for c in site.chains)  # impacts at the change
    return site


def _draw_nominal(rng: np.random.Generator) -> tuple[dict[str, float], ...]:
    first = {name: float(rng.uniform(*span)) for name, span in NOMINAL_RANGES.items()}
    second = {name: value * float(np.exp(rng.uniform(-0.35, 0.35))) for name, value in first.items()}
    second["mass"] = first["mass"]
    digits = {"pad": -6, "ballast": -6, "pad_damping": -2, "ballast_damping": -2, "mass": 0}
    return tuple({k: round(v, digits[k]) for k, v in zone.items()} for zone in (first, second))


def _draw_temperatures(rng: np.random.Generator, same: bool | None) -> tuple[float, float]:
    same = bool(rng.random() < 0.25) if same is None else same
    cold, warm = float(rng.uniform(-4.0, 9.0)), float(rng.uniform(20.0, 33.0))
    return (warm, warm + float(rng.uniform(-1.0, 1.0))) if same else (cold, warm)


def _nominal_trains() -> dict[str, Train]:
    return {
        "railcar": Train("railcar", (vehicle.RAILCAR, vehicle.RAILCAR), 0.43, 9.3e10),
        "locomotive": Train("locomotive", (vehicle.LOCOMOTIVE,), 0.61, 1.0e11),
        "loaded": Train("loaded", (vehicle.LOADED_WAGON, vehicle.LOADED_WAGON), 0.46, 9.4e10),
    }


def _draw_true_train(train: Train, rng: np.random.Generator) -> Train:
    """The true train: masses, springs, dampers, wheels and axle positions with their deviations from the file."""

    def car(c: Car) -> Car:
        spread = {"body": 0.03, "bogie": 0.03, "wheelset": 0.02, "primary": 0.1, "secondary": 0.1}
        spread |= {"primary_damping": 0.2, "secondary_damping": 0.2, "body_inertia": 0.05, "bogie_inertia": 0.05}
        values = {k: getattr(c, k) * float(np.exp(s * rng.normal())) for k, s in spread.items()}
        values |= {"base": c.base + 0.003 * float(rng.normal()), "pivots": c.pivots + 0.008 * float(rng.normal())}
        return Car(**{**c.__dict__, **values})

    radius = train.radius - float(rng.uniform(0.0, 0.02))
    return Train(train.name, tuple(car(c) for c in train.cars), radius, train.contact * float(rng.uniform(0.9, 1.1)))


def _draw_passages(
    rng: np.random.Generator, temperatures: tuple[float, float], one_speed: bool
) -> list[PlannedPassage]:
    plan = [("railcar", 25.0), ("railcar", 33.0), ("railcar", 42.0), ("locomotive", 28.0), ("locomotive", 38.0)]
    plan += [("loaded", 20.0), ("loaded", 25.0), ("loaded", 29.0)]
    order = rng.permutation(len(plan))
    common_speed = float(rng.uniform(24.0, 29.0))
    passages = []
    for k in order:
        name, speed = plan[k]
        speed = (common_speed if one_speed else speed) * float(np.exp((0.002 if one_speed else 0.05) * rng.normal()))
        temperature = temperatures[1] + float(rng.uniform(-3.0, 3.0))
        passages.append(PlannedPassage(name, speed, float(rng.uniform(0.0, 2.0 * np.pi)), temperature))
    return passages


def _draw_world(
    rng: np.random.Generator, zones: tuple[tuple[float, float], ...], nominal: tuple[dict[str, float], ...]
) -> World:
    grid = Grid()
    n_support = int((grid.end - grid.start - 1.0) / SPACING)
    ideal = grid.start + SPACING * np.arange(1, n_support + 1)
    position = ideal + 0.008 * rng.normal(size=n_support)
    values: dict[str, Any] = {}
    common = {name: float(np.exp(s * rng.normal())) for name, s in COMMON_ERROR.items()}
    for name, s in SUPPORT_SCATTER.items():
        base = np.where(ideal < zones[0][1], nominal[0][name], nominal[1][name])
        values[name] = base * common[name] * np.exp(s * rng.normal(size=n_support))
    damping = RAIL_DAMPING * float(np.exp(0.25 * rng.normal()))
    rail = Rail(6.378e6 * (1 + 0.01 * rng.normal()), 2.435e8 * (1 + 0.02 * rng.normal()), damping=damping)
    mean_ballast = float(np.mean(values["ballast"]))
    world = World(grid, rail, position, **values, shear=0.04 * mean_ballast, shear_damping=2e3)
    slope = float(rng.uniform(0.0, 6e-4))
    world.softening = lambda kelvin: 1.0 - slope * kelvin
    return world


def _draw_roughness(rng: np.random.Generator, trains: Mapping[str, Train]) -> dict[Any, Callable[..., np.ndarray]]:
    """Functions that give dips: "rail" of position; (train, axle) of position and phase."""
    roughness: dict[Any, Callable[..., np.ndarray]] = {"rail": rail_roughness(rng, float(rng.uniform(-3.0, 4.0)))}
    for train in trains.values():
        level = float(rng.uniform(-8.0, -1.0))
        for axle in range(1, train.axles().size + 1):
            roughness[train.name, axle] = wheel_roughness(rng, level, train.radius)
    return roughness
