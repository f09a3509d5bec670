"""Simulated recordings: hammer tests and passages of a site in a given world."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

from turnout.records import Channel, Recording
from turnout_blind.instrument import digitise
from turnout_blind.march import TIME_STEP
from turnout_blind.run import ENGAGE_LENGTH, simulate_impacts, simulate_passage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

RATE = 1.0 / TIME_STEP
HAMMER_DECIMATION, PASSAGE_DECIMATION = 3, 12  # 20 kHz and 5 kHz
HAMMER_DURATION, PRETRIGGER, PASSAGE_DURATION = 0.25, 0.025, 3.5  # [s]
N_IMPACTS = 6


def sensor_positions(site: Site, world: World) -> list[float]:
    """True positions of the sensors.

    Parameters
    ----------
    site : Site
        The site.
    world : World
        True state of the site.

    Returns
    -------
    list of float
        Positions. [m]
    """
    return [x + world.sensor_shift.get(c.name, 0.0) for x, c in zip(site.sensors, site.chains)]


def channels(site: Site) -> tuple[Channel, ...]:
    """Channels of the sensors as the owner describes them.

    Parameters
    ----------
    site : Site
        The site.

    Returns
    -------
    tuple of Channel
        One channel for each sensor.
    """
    return tuple(
        Channel(c.name, "acceleration", x, "rail web", limit=c.full_scale, resolution=c.step)
        for x, c in zip(site.sensors, site.chains)
    )


def hammer_test(
    site: Site, world: World, campaign: int, position: float, rng: np.random.Generator, decoys: Mapping[Any, Any]
) -> list[Recording]:
    """Recordings of a hammer test.

    Parameters
    ----------
    site : Site
        The site.
    world : World
        True state of the site.
    campaign : int
        Number of the campaign in ``site.campaigns``.
    position : float
        Position of the impacts, one of ``site.hammer_positions``. [m]
    rng : Generator
        Source of the random numbers.
    decoys : mapping
        Disturbances from ``draw_decoys``.

    Returns
    -------
    list of Recording
        One recording for each impact.
    """
    force = Channel("force", "force", position, "hammer", limit=site.force.full_scale, resolution=site.force.step)
    recordings, start = [], site.campaigns[campaign] + timedelta(minutes=20 * site.hammer_positions.index(position))
    for k in range(N_IMPACTS):
        f, a = _draw_impact(
            site, world, site.temperatures[campaign], position, rng, decoys.get(("blow", campaign, position, k))
        )
        rows = [digitise(site.force, f, RATE, HAMMER_DECIMATION, rng)]
        for i, chain in enumerate(site.chains):
            faults = [fault("hammer", rng) for fault in world.channels.get(chain.name, ())]
            rows.append(digitise(chain, a[i], RATE, HAMMER_DECIMATION, rng, faults))
        when = start + timedelta(seconds=20 * k)
        recordings.append(
            Recording(np.array(rows), RATE / HAMMER_DECIMATION, (force, *channels(site)), "hammer", started_at=when)
        )
    return recordings


def _draw_impact(
    site: Site, world: World, temperature: float, position: float, rng: np.random.Generator, fault: str | None
) -> tuple[np.ndarray, np.ndarray]:
    """(force, accelerations) of one impact: beside the mark, slightly off centre, and with the given ``fault``."""
    speed = 0.95 * float(np.exp(0.12 * rng.normal()))
    offset = float(np.clip(0.008 * rng.normal(), -0.02, 0.02))
    times, speeds = [PRETRIGGER], [speed]
    if fault == "double":
        times, speeds = [*times, PRETRIGGER + float(rng.uniform(0.009, 0.016))], [speed, 0.4 * speed]
    if fault == "overload":
        speeds = [1.9 * speed]
    f, a, _ = simulate_impacts(
        world,
        sensor_positions(site, world),
        position + offset,
        times,
        speeds,
        HAMMER_DURATION,
        temperature,
        tip=site.tip,
    )
    twist = _torsion_acceleration(f, float(rng.normal()) * 0.02, site)
    decay = np.exp(-np.abs(np.array(site.sensors) - position) / 1.5)
    return f, a + decay[:, None] * twist


def _torsion_acceleration(force: np.ndarray, share: float, site: Site) -> np.ndarray:
    """Acceleration by torsion of the rail under an off-centre impact: one mode of 60 kg near 460 Hz.

    A beam model of vertical motion cannot have it.
    """
    omega, zeta = 2.0 * np.pi * 460.0, 0.06
    b, a = signal.bilinear([1.0, 0.0, 0.0], [1.0, 2.0 * zeta * omega, omega**2], RATE)
    return share * signal.lfilter(b, a, force) / 60.0


def passage(site: Site, world: World, k: int, rng: np.random.Generator, decoys: Mapping[Any, Any]) -> Recording:
    """Recording of one passage.

    Parameters
    ----------
    site : Site
        The site.
    world : World
        True state of the site.
    k : int
        Number of the passage.
    rng : Generator
        Source of the random numbers.
    decoys : mapping
        Disturbances from ``draw_decoys``.

    Returns
    -------
    Recording
        The recording.
    """
    plan = site.passages[k]
    a = passage_motion(site, world, k, rng)
    rows = []
    for i, chain in enumerate(site.chains):
        faults = [fault("passage", rng) for fault in world.channels.get(chain.name, ())]
        x = a[i] + decoys[chain.name](np.arange(a.shape[1]) / RATE, rng) if chain.name in decoys else a[i]
        rows.append(digitise(chain, x, RATE, PASSAGE_DECIMATION, rng, faults))
    conditions = {"rail_temperature": round(plan.temperature + float(rng.normal()), 1)}
    return Recording(
        np.array(rows),
        RATE / PASSAGE_DECIMATION,
        channels(site),
        "passage",
        started_at=site.passage_time(k),
        conditions=conditions,
    )


def passage_motion(site: Site, world: World, k: int, rng: np.random.Generator | None) -> np.ndarray:
    """True accelerations of one passage.

    Parameters
    ----------
    site : Site
        The site.
    world : World
        True state of the site.
    k : int
        Number of the passage.
    rng : Generator or None
        Source of the noise of other sources; not used without one.

    Returns
    -------
    (n_sensor, n) array of float
        Accelerations. [m/s²]
    """
    plan = site.passages[k]
    train = site.true_trains[plan.train]
    positions = sensor_positions(site, world)

    def roughness(i: int, x: np.ndarray) -> np.ndarray:
        return site.roughness["rail"](x) + site.roughness[plan.train, i + 1](x, plan.phase)

    a, _, _ = simulate_passage(
        world, train, plan.speed, positions, PASSAGE_DURATION, lead_time(world, positions, plan.speed),
        plan.temperature, roughness, plan.phase, n_passages=float(k),
    )  # fmt: skip
    for source in world.passage_noise:
        a = a + source(np.arange(a.shape[1]) / RATE, positions, k, rng)
    return a


def lead_time(world: World, positions: Sequence[float], speed: float) -> float:
    """Time from the start until the first wheel reaches the first sensor; it starts where it engages the rail.

    Parameters
    ----------
    world : World
        True state of the site.
    positions : sequence of float
        True positions of the sensors. [m]
    speed : float
        Speed of the train. [m/s]

    Returns
    -------
    float
        Time. [s]
    """
    return (min(positions) - world.grid.start - 0.25 * ENGAGE_LENGTH) / speed
