"""Simulated recordings: hammer tests and passages of a site in a given world."""

from datetime import datetime, timedelta

import numpy as np
from scipy import signal

from turnout.records import Channel, Recording
from turnout_blind.instrument import digitised
from turnout_blind.march import STEP
from turnout_blind.run import RAMP, roll, strike

RATE = 1.0 / STEP
HAMMER_DOWN, PASSAGE_DOWN = 3, 12  # 20 kHz and 5 kHz
HAMMER_LENGTH, PRETRIGGER, PASSAGE_LENGTH = 0.25, 0.025, 3.5  # [s]
N_BLOWS = 6
CAMPAIGNS = (datetime(2024, 2, 6, 9, 0), datetime(2024, 7, 16, 9, 0))
FIRST_PASSAGE, BETWEEN = datetime(2024, 7, 16, 11, 0), timedelta(minutes=30)


def sensor_places(site, world):
    """True positions of the sensors [m]."""
    return [x + world.sensor_shift.get(c.name, 0.0) for x, c in zip(site.sensors, site.chains)]


def channels(site):
    """Channels of the sensors as the owner describes them."""
    return tuple(
        Channel(c.name, "acceleration", x, "rail web", limit=c.full_scale, resolution=c.step)
        for x, c in zip(site.sensors, site.chains)
    )


def hammer_test(site, world, campaign, point, rng, decoys):
    """Recordings, one per impact, of a hammer test at ``position`` [m] in campaign 0 or 1."""
    force = Channel("force", "force", point, "hammer", limit=site.force.full_scale, resolution=site.force.step)
    made, start = [], CAMPAIGNS[campaign] + timedelta(minutes=20 * site.blows.index(point))
    for k in range(N_BLOWS):
        f, a = _blow(site, world, site.temperatures[campaign], point, rng, decoys.get(("blow", campaign, point, k)))
        rows = [digitised(site.force, f, RATE, HAMMER_DOWN, rng)]
        for i, chain in enumerate(site.chains):
            faults = [fault("hammer", rng) for fault in world.channels.get(chain.name, ())]
            rows.append(digitised(chain, a[i], RATE, HAMMER_DOWN, rng, faults))
        when = start + timedelta(seconds=20 * k)
        made.append(Recording(np.array(rows), RATE / HAMMER_DOWN, (force, *channels(site)), "hammer", started_at=when))
    return made


def _blow(site, world, temperature, point, rng, bad):
    """(force, accelerations) of one impact: beside the mark, slightly off centre, and with the given ``fault``."""
    speed = 0.95 * float(np.exp(0.12 * rng.normal()))
    beside = float(np.clip(0.008 * rng.normal(), -0.02, 0.02))
    times, speeds = [PRETRIGGER], [speed]
    if bad == "double":
        times, speeds = [*times, PRETRIGGER + float(rng.uniform(0.009, 0.016))], [speed, 0.4 * speed]
    if bad == "overload":
        speeds = [1.9 * speed]
    f, a, _ = strike(
        world, sensor_places(site, world), point + beside, times, speeds, HAMMER_LENGTH, temperature, tip=site.tip
    )
    twist = _torsion(f, float(rng.normal()) * 0.02, site)
    near = np.exp(-np.abs(np.array(site.sensors) - point) / 1.5)
    return f, a + near[:, None] * twist


def _torsion(force, share, site):
    """Acceleration by torsion of the rail under an off-centre impact: one mode of 60 kg near 460 Hz.

    A beam model of vertical motion cannot have it.
    """
    omega, zeta = 2.0 * np.pi * 460.0, 0.06
    b, a = signal.bilinear([1.0, 0.0, 0.0], [1.0, 2.0 * zeta * omega, omega**2], RATE)
    return share * signal.lfilter(b, a, force) / 60.0


def passage(site, world, k, rng, decoys):
    """Recording of the ``k``-th passage."""
    plan = site.passages[k]
    a = passage_motion(site, world, k, rng)
    rows = []
    for i, chain in enumerate(site.chains):
        faults = [fault("passage", rng) for fault in world.channels.get(chain.name, ())]
        x = a[i] + decoys[chain.name](np.arange(a.shape[1]) / RATE, rng) if chain.name in decoys else a[i]
        rows.append(digitised(chain, x, RATE, PASSAGE_DOWN, rng, faults))
    noted = {"rail_temperature": round(plan.temperature + float(rng.normal()), 1)}
    when = FIRST_PASSAGE + k * BETWEEN
    return Recording(np.array(rows), RATE / PASSAGE_DOWN, channels(site), "passage", started_at=when, conditions=noted)


def passage_motion(site, world, k, rng):
    """(n_sensor, n) true accelerations of the ``k``-th passage [m/s²]."""
    plan = site.passages[k]
    train = site.true_trains[plan.train]
    places = sensor_places(site, world)

    def rough(i, x):
        return site.roughness["rail"](x) + site.roughness[plan.train, i + 1](x, plan.phase)

    a, _, _ = roll(
        world, train, plan.speed, places, PASSAGE_LENGTH, lead_of(world, places, plan.speed),
        plan.temperature, rough, plan.phase, grown=float(k),
    )  # fmt: skip
    for source in world.passage_noise:
        a = a + source(np.arange(a.shape[1]) / RATE, places, k, rng)
    return a


def lead_of(world, places, speed):
    """Time from the start until the first wheel reaches the first sensor [s]; it starts where it engages the rail."""
    return (min(places) - world.grid.start - 0.25 * RAMP) / speed
