"""A planned campaign as a case: its data are predictions of the base model with errors typical of such recordings.

It serves to compute which effects a campaign can distinguish, and to make simulated campaigns for exercises and tests.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout import passage_band, passage_observation, receptance_observation
from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput, PassageInput
from turnout.mismatch.turnout.candidates.catalogue import list_candidates
from turnout.mismatch.turnout.case import TrackCase
from turnout.mismatch.turnout.case_data import CaseData
from turnout.mismatch.turnout.chair_scatter import chair_errors, with_chair_errors
from turnout.mismatch.turnout.lifting_chairs import count_alike
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.receptance_samples import PairSamples
from turnout.mismatch.turnout.site import site_of
from turnout.mismatch.turnout.support_scatter import support_errors
from turnout.mismatch.turnout.wheel_roughness import wheel_modes
from turnout.records import Impact, Recording
from turnout.simulate.hammer import Hammer, simulate_hammer
from turnout.simulate.passage import simulate_passage
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import PER_SUPPORT, uniform_track
from turnout.simulate.train import couple
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Vehicle, car

if TYPE_CHECKING:
    from turnout.physics.term import PhysicsTerm
    from turnout.simulate.track import Track

PLANNED_PEAK = 12e3  # N, of a planned impact: about that of 5.5 kg with a plastic tip at 1.2 m/s
PLANNED_CONTACT = 1.2e-3  # s, of a planned impact
PLANNED_PRETRIGGER, PLANNED_DURATION = 0.01, 0.2  # s, before a planned impact and of its whole record
HAMMER_RATE = 20e3  # Hz, of a planned impact
NOISE_SHARE = 0.02  # standard deviation of a sensor's noise over its own rms
PLANNED_LEAD = 0.45  # s from the start of a planned or simulated recording to the first wheel at the first sensor

# What a planned passage has recorded so far.
NO_RECORDING = Recording(np.zeros((0, 1)), 1.0, ())


class PlannedCase(TrackCase):
    """``TrackCase`` of a ``Plan``: nothing is measured and nothing is fitted.

    Parameters
    ----------
    plan : Plan
    settings : MismatchSettings or None
        None: the defaults.
    families : collection of str or None
        Effects to which the candidates are restricted; None: all.
    solver : Track1D or None
        Settings of the simulation of passages.
    """

    def __init__(
        self,
        plan: Plan,
        settings: MismatchSettings | None = None,
        families: Collection[str] | None = None,
        solver: Track1D | None = None,
    ):
        data, predictor = planned_data(plan, settings or MismatchSettings(), solver or Track1D())
        self._set_up(data, predictor, list_candidates(data, families), ())


def planned_data(plan: Plan, settings: MismatchSettings, solver: Track1D) -> tuple[CaseData, Predictor]:
    """Predicted observations of a plan, and the predictor of its recordings.

    Parameters
    ----------
    plan : Plan
    settings : MismatchSettings
    solver : Track1D
        Settings of the simulation of passages.

    Returns
    -------
    data : CaseData
    predictor : Predictor
        With the rail of the track file.
    """
    campaign = _planned_campaign(plan)
    site = site_of(campaign)
    aligned = {p.name: _planned_passage(p, plan.sensors) for p in campaign.passages}
    predictor = Predictor(site, solver).with_recordings(_planned_pairs(campaign), aligned)
    values = {n.name: n.mean for n in site.nuisances(campaign.passages)}
    pairs, observations = {}, []
    for pair in predictor.frf_pairs.values():
        samples = PairSamples([pair], predictor.pair_sensitivity(values, (), pair))
        (h,) = predictor.predict_receptances(values, (), samples)
        h = h[: receptance_observation.LINES.size] + 1j * h[receptance_observation.LINES.size :]
        pairs[pair.name] = scaled = receptance_observation.with_magnitude(pair, np.abs(h))
        error = NOISE_SHARE * np.abs(h)
        observations.append(receptance_observation.observation_of(scaled, h, error, settings.pair_tolerance))
    predictor = predictor.with_recordings(pairs, aligned)
    observations = [
        o.with_errors(errors, count_alike(pairs[o.name], pairs.values(), ()))
        for o, errors in zip(observations, support_errors(predictor, values, observations))
    ]
    errors_of_chairs = chair_errors(predictor, values, list(pairs.values()))
    observations = [
        with_chair_errors(o, pairs[o.name], errors_of_chairs[o.name]) if o.name in errors_of_chairs else o
        for o in observations
    ]
    for a in aligned.values():
        data = predictor.predict_passage(values, (), a).reshape(len(a.sensors), -1)
        noise = NOISE_SHARE * np.std(data, axis=1)
        observation = passage_observation.observation_of(a, data, noise, settings.materiality)
        if predictor.track(a.passage.route).blade is not None:
            observation = passage_observation.with_chatter(observation)
        observations.append(replace(observation, modes=wheel_modes(predictor, values, a, observation.sigma)))
    return CaseData(campaign, settings, site, pairs, aligned, tuple(observations)), predictor


def _planned_campaign(plan: Plan) -> CampaignInput:
    """Hammer tests and passages of a plan without recordings."""
    tests = tuple(
        HammerInput(
            f"impacts {k + 1}",
            position,
            (),
            visit=f"{temperature:.0f} °C",
            conditions={"rail_temperature": temperature},
        )
        for k, (position, temperature) in enumerate(plan.hammer_points)
    )
    passages = tuple(
        PassageInput(
            f"{train.name} {k + 1}",
            NO_RECORDING,
            train.vehicle,
            train.speed,
            train.name,
            conditions={} if train.temperature is None else {"rail_temperature": train.temperature},
        )
        for k, train in enumerate(plan.trains)
    )
    return CampaignInput(plan.turnout, plan.sensors, tests, passages)


class PlannedPair(FrfPair):
    """A response channel of a planned hammer test, which has no impacts yet."""

    @cached_property
    def typical_impact(self) -> Impact:
        """A half sine. Its peak does not matter to supports that press and pull differently: they are homogeneous."""
        rate = HAMMER_RATE
        time = np.arange(round(PLANNED_DURATION * rate)) / rate - PLANNED_PRETRIGGER
        in_contact = (time >= 0.0) & (time <= PLANNED_CONTACT)
        force = np.where(in_contact, PLANNED_PEAK * np.sin(np.pi * time / PLANNED_CONTACT), 0.0)
        onset = round(PLANNED_PRETRIGGER * rate)
        end = onset + round(PLANNED_CONTACT * rate)
        impulse = 2.0 / np.pi * PLANNED_PEAK * PLANNED_CONTACT
        return Impact(
            force, np.zeros_like(force), rate, onset, end, end, PLANNED_PEAK, PLANNED_CONTACT, impulse, 0.0, 0.0,
            1.0 / PLANNED_CONTACT,
        )  # fmt: skip


def _planned_pairs(campaign: CampaignInput) -> dict[str, FrfPair]:
    """Pairs of every test and sensor, on all lines and of magnitude 1."""
    lines, pairs = receptance_observation.LINES, dict[str, FrfPair]()
    for test in campaign.hammer:
        for sensor in campaign.sensors:
            name, size = f"{test.name}:{sensor.name}", np.ones(lines.size)
            pairs[name] = PlannedPair(name, test, sensor.name, sensor, lines, size, dict(test.conditions))
    return pairs


def _planned_passage(passage: PassageInput, sensors: tuple[Sensor, ...]) -> AlignedPassage:
    """A passage that reaches the first sensor after ``PLANNED_LEAD``."""
    stop = passage_observation.duration_of(passage, passage.speed, sensors) + PLANNED_LEAD + SIMULATION.edge_time
    time = np.arange(PLANNED_LEAD - SIMULATION.edge_time, stop, 1.0 / passage_band.sample_rate_of(passage.speed))
    return AlignedPassage(passage.name, passage, sensors, time, PLANNED_LEAD, passage.speed)


@dataclass(frozen=True)
class Train:
    """A planned passage: vehicle, its name, speed [m/s], rail temperature [°C]."""

    vehicle: Vehicle
    name: str
    speed: float
    temperature: float | None = 15.0


@dataclass(frozen=True)
class Plan:
    """What a campaign will measure: sensors, hammer tests and passages on one turnout.

    ``hammer_points`` are (position [m], temperature [°C]); ``reserved`` are names of recordings that no fit reads.
    ``scatter`` of support values, ``roughness`` [dB over the limit of ISO 3095] and ``noise`` make the simulated
    campaign as irregular as a measured one.
    """

    turnout: TurnoutTrack
    sensors: tuple[Sensor, ...]
    hammer_points: tuple[tuple[float, float], ...] = ()
    trains: tuple[Train, ...] = ()
    reserved: tuple[str, ...] = ()
    roughness: float | None = -6.0
    scatter: float = 0.05
    n_impacts: int = 4
    noise: float = 0.02
    rate: float = 10e3
    options: dict[str, Any] = field(default_factory=dict)


def small_plan(
    temperatures: Sequence[float] = (5.0, 25.0),
    speeds: Sequence[float] = (28.0, 40.0),
    hammer_positions: Sequence[float] = (20.4, 24.0, 27.6),
    passages: bool = True,
) -> Plan:
    """Three hammer points, eight passages of a light and a heavy car, four sensors on 48 m of track.

    Parameters
    ----------
    temperatures : sequence of float
        Rail temperatures. [°C]
    speeds : sequence of float
        Speeds. [m/s]
    hammer_positions : sequence of float
        Positions of impacts. [m]
    passages : bool
        Whether there are passages.

    Returns
    -------
    Plan
    """
    turnout = TurnoutTrack(uniform_track(48.0), {"main": ((),)})
    sensors = (Sensor("S1", 21.0), Sensor("S2", 23.4, "sleeper"), Sensor("S3", 24.6), Sensor("S4", 27.3))
    light = car("light", body_mass=8000.0, half_pivot=5.0)
    heavy = car("heavy", body_mass=34000.0, body_inertia=1.6e6, half_pivot=6.0, half_base=0.95)
    trains = tuple(
        Train(vehicle, vehicle.name, speed, t) for vehicle in (light, heavy) for speed in speeds for t in temperatures
    )
    reserved = ("light 2", "heavy 3") if passages and len(trains) == 8 else ()
    hammer_points = tuple((x, t) for x in hammer_positions for t in temperatures)
    return Plan(turnout, sensors, hammer_points, trains if passages else (), reserved)


def turnout_plan() -> Plan:
    """A whole turnout: eight hammer points, twenty passages of two coupled cars each, twelve sensors over 27 m.

    Returns
    -------
    Plan
    """
    temperatures, speeds = (5.0, 25.0), (22.0, 25.0, 28.0, 32.0, 36.0)  # [°C], [m/s]
    turnout = TurnoutTrack(uniform_track(72.0), {"main": ((),)})
    positions = np.round(21.6 + 2.4 * np.arange(12) + 0.3 * (np.arange(12) % 3), 3)
    sensors = tuple(Sensor(f"S{k + 1}", float(x), "rail" if k % 4 else "sleeper") for k, x in enumerate(positions))
    light = car("light", body_mass=8000.0, half_pivot=5.0, length=15.5, overhang=1.5)
    heavy = car(
        "heavy", body_mass=34000.0, body_inertia=1.6e6, half_pivot=6.0, half_base=0.95, length=17.0, overhang=1.55
    )
    coupled_cars = [couple(name, (vehicle, vehicle)) for name, vehicle in (("light", light), ("heavy", heavy))]
    trains = tuple(Train(pair, pair.name, speed, t) for pair in coupled_cars for speed in speeds for t in temperatures)
    hammer_points = tuple((float(x), t) for x in np.round(22.8 + 3.6 * np.arange(8), 3) for t in temperatures)
    return Plan(turnout, sensors, hammer_points, trains, ("light 3", "heavy 8"))


def measured_campaign(plan: Plan, terms: Sequence[PhysicsTerm] = (), seed: int = 0) -> CampaignInput:
    """Simulated ``CampaignInput`` of a ``plan`` with ``terms`` in the track, the wheels or the sensors.

    Supports scatter, the rail is rough, speeds and loads have errors, sensors have wrong gains and noise.

    Parameters
    ----------
    plan : Plan
        The plan.
    terms : sequence of PhysicsTerm
        Effects that the track, the wheels or the sensors have.
    seed : int
        Of all random numbers.

    Returns
    -------
    CampaignInput
    """
    rng = np.random.default_rng([seed, 7])
    true = _scatter_supports(plan, rng)
    gains = 1.0 + 0.01 * rng.normal(size=len(plan.sensors))
    sensors = tuple(replace(s, gain=s.gain * g, noise=plan.noise) for s, g in zip(plan.sensors, gains))
    hammer = tuple(_hammer_test(plan, true, sensors, terms, k, seed) for k in range(len(plan.hammer_points)))
    count: dict[str, int] = {}
    passages = []
    for k, planned in enumerate(plan.trains):
        count[planned.name] = count.get(planned.name, 0) + 1
        name = f"{planned.name} {count[planned.name]}"
        passages.append(_simulated_passage(plan, true, sensors, terms, planned, name, seed, k, rng))
    return CampaignInput(plan.turnout, plan.sensors, hammer, tuple(passages), plan.reserved)


def _scatter_supports(plan: Plan, rng: np.random.Generator) -> TurnoutTrack:
    def scatter(track: Track) -> Track:
        values = {}
        for name in ("pad_stiffness", "ballast_stiffness"):
            values[name] = getattr(track, name) * np.exp(plan.scatter * rng.normal(size=track.support.size))
        common = np.exp(0.08 * rng.normal(size=4))
        for f, name in zip(common, ("pad_stiffness", "pad_damping", "ballast_stiffness", "ballast_damping")):
            values[name] = f * values.get(name, getattr(track, name))
        return track.with_(**{k: v for k, v in values.items() if k in PER_SUPPORT})

    base = plan.turnout
    return replace(base, track=scatter(base.track), tracks={k: scatter(t) for k, t in base.tracks.items()})


def _hammer_test(
    plan: Plan, true: TurnoutTrack, sensors: tuple[Sensor, ...], terms: Sequence[PhysicsTerm], k: int, seed: int
) -> HammerInput:
    position, temperature = plan.hammer_points[k]
    conditions = {"rail_temperature": temperature}
    under = tuple(t.under_conditions(conditions) for t in terms)
    accelerometers = tuple(replace(s, noise=0.02) for s in sensors)
    recordings = simulate_hammer(
        true, position, Hammer(position_spread=0.004), accelerometers, plan.n_impacts, under, seed=1000 * seed + k,
        half_length=200.0, conditions=conditions,
    )  # fmt: skip
    visit = f"{temperature:.0f} °C"
    return HammerInput(f"impacts {k + 1}", position, recordings, "hammer", visit, conditions)


def _simulated_passage(
    plan: Plan,
    true: TurnoutTrack,
    sensors: tuple[Sensor, ...],
    terms: Sequence[PhysicsTerm],
    planned: Train,
    name: str,
    seed: int,
    k: int,
    rng: np.random.Generator,
) -> PassageInput:
    conditions = {} if planned.temperature is None else {"rail_temperature": planned.temperature}
    loads = tuple(2.0 * load for load in planned.vehicle.static_loads)
    term_conditions = {"axle_loads": loads, "train": planned.name, "name": name, **conditions}
    under = tuple(t.under_conditions(term_conditions) for t in terms)
    vehicle = planned.vehicle
    bodies = tuple(replace(b, mass=b.mass * np.exp(0.02 * rng.normal())) for b in vehicle.bodies)
    speed = planned.speed * (1.0 + 0.003 * rng.normal())
    recording = simulate_passage(
        true, vehicle.with_(bodies=bodies), speed, sensors, terms=under, seed=seed, rate=plan.rate,
        roughness=plan.roughness, lead=PLANNED_LEAD, tail=0.25, **plan.options,
    )  # fmt: skip
    recording = replace(recording, conditions={**recording.conditions, "record": k})
    return PassageInput(name, recording, planned.vehicle, planned.speed, planned.name, conditions=conditions)
