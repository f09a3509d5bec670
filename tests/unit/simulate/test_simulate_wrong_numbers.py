"""A number that a simulation cannot use is an error that names it; numbers at a limit are used."""

from datetime import UTC, datetime
from functools import cache

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.simulate import Hammer, Sensor, prepare_passage, simulate_hammer, simulate_passage
from turnout.simulate.force_laws import FrictionLaw, GapLaw, LiftLaw, LinearLaw, PowerLaw, TableLaw
from turnout.simulate.number_checks import check_count, check_number
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import run
from turnout.simulate.track import RailStretch, uniform_track
from turnout.simulate.train import couple
from turnout.simulate.vehicle import lone_wheels
from turnout.simulate.wheel_path import (
    BladeTop,
    Corrugation,
    Cosine,
    Dip,
    Kink,
    OutOfRound,
    Sampled,
    Sections,
    StockFall,
    WheelFlat,
)

NAN, INF = float("nan"), float("inf")
TRACK = uniform_track(24.0)
WHEEL = lone_wheels(700.0, gravity=0.0, pressing=5e4)


@cache
def prepared_passage():
    return prepare_passage(TRACK, rate=5e3)


def passage(speed=40.0, **options):
    return simulate_passage(TRACK, WHEEL, speed, [Sensor("A", 12.0)], rate=5e3, lead=0.05, tail=0.05, **options)


def impact(**options):
    return simulate_hammer(TRACK, 12.0, n_impacts=1, **{"duration": 0.06, "rate": 5e3, **options})


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda: passage("40"), "speed must be above 0 m/s, got '40'"),
        (
            lambda: passage(1e6),
            r"distance at 1e\+06 m/s with lead and tail must be above 0 and below 100000 m",
        ),
        (lambda: simulate_passage(TRACK, WHEEL, 1.0, [Sensor("A", 12.0)], tail=9e3), "duration .* below 3600 s"),
        (
            lambda: simulate_passage(TRACK, WHEEL, 40.0, [Sensor("A", 12.0)], lead=NAN),
            "lead must be a finite number",
        ),
        (lambda: simulate_passage(TRACK, WHEEL, 40.0, [Sensor("A", 12.0)], tail=-9.0), "distance .* got -320"),
        (lambda: passage(entry=-1.0), "entry must be at least 0 m, got -1"),
        (lambda: passage(roughness=NAN), "roughness must be a finite number in dB"),
        (lambda: passage(substeps=0), "substeps must be a whole number of at least 1, got 0"),
        (lambda: passage(substeps=1.5, prepared=prepared_passage()), "substeps must be a whole number"),
        (lambda: passage(irregularities=[WheelFlat(1, 0.05, 0.43)]), r"wheel 1; 'wheels' has wheels 0 to 0"),
        (lambda: passage(irregularities=[OutOfRound(-1, 1e-4, 3, 0.43)]), r"wheel -1; 'wheels' has"),
        (lambda: prepare_passage(TRACK, rate=0.0), "rate must be above 0 Hz, got 0"),
        (lambda: impact(rate=NAN), "rate must be above 0 Hz, got nan"),
        (lambda: impact(duration=0.02), "duration must be above 0.05 s, got 0.02"),
        (lambda: impact(pretrigger=-0.1), "pretrigger must be at least 0 s"),
        (lambda: impact(half_length=NAN), "half_length must be above 0 m"),
        (lambda: impact(pulse=lambda t: np.where(t > 1e-3, NAN, 1.0)), r"force is not a number at 0\.001"),
        (lambda: simulate_hammer(TRACK, 12.0, n_impacts=0), "n_impacts must be a whole number of at least 1, got 0"),
        (lambda: simulate_hammer(TRACK, NAN), "location must be a finite number in m"),
        (lambda: Hammer(velocity=-1.2), "hammer: velocity must be above 0 m/s, got -1.2"),
        (lambda: Hammer(velocity=0.0), "hammer: velocity must be above 0"),
        (lambda: Hammer(mass=INF), "hammer: mass must be above 0 kg, got inf"),
        (lambda: Hammer(velocity_spread=-0.1), "velocity_spread must be at least 0"),
        (lambda: Sensor("A", 1.0, noise=-1.0), "sensor 'A': noise must be at least 0"),
        (lambda: Sensor("A", 1.0, limit=0.0), "sensor 'A': limit must be above 0, or None"),
        (lambda: Sensor("A", 1.0, limit="5"), "sensor 'A': limit must be above 0, or None, got '5'"),
        (lambda: Sensor("A", "12.0"), "sensor 'A': place must be a finite number, got '12.0'"),
        (lambda: Sensor("A", 1.0, gain=NAN), "sensor 'A': gain must be a finite number"),
        (lambda: prepare(TRACK, INF), "time step must be above 0 s, got inf"),
        (lambda: run(prepare(TRACK, 1e-4), NAN), "duration must be above 5e-05 s, got nan"),
        (lambda: uniform_track(24.0, 0.0), "spacing must be above 0 m"),
        (lambda: uniform_track(NAN), "length must be above 0 m, got nan"),
        (lambda: TRACK.with_(elements_per_bay=2.5), "elements_per_bay must be a whole number of at least 1, got 2.5"),
        (lambda: TRACK.with_(end_length=3.0, end_damping=-300.0), "end_damping must be at least 0 1/s, got -300"),
        (lambda: TRACK.with_(end_length=NAN), "end_length must be at least 0 m"),
        (lambda: RailStretch(14.0, 11.0, TRACK.rail), "rail stretch from 14 m: end must be above 14 m, got 11"),
        (lambda: Rail(INF, 60.0, 2e8), "rail: bending_stiffness must be above 0, got inf"),
        (lambda: lone_wheels(INF), "has mass inf"),
        (lambda: lone_wheels(700.0, gravity=NAN), "gravity must be a finite number"),
        (lambda: lone_wheels(700.0, pressing=NAN), "pressing of wheel 0 must be a finite number in N"),
        (lambda: WheelFlat(0, -0.05, 0.43), "flat of wheel 0: length must be at least 0 m"),
        (lambda: WheelFlat(0, 0.05, 0.0), "flat of wheel 0: radius must be above 0 m"),
        (lambda: OutOfRound(2, 1e-4, 3, 0.0), "out-of-round wheel 2: radius must be above 0 m"),
        (lambda: Corrugation(20.0, 15.0, 1e-4, 0.1), "corrugation from 20 m: end must be above 20 m, got 15"),
        (lambda: passage(irregularities=[WheelFlat(0.5, 0.05, 0.43)]), r"wheel 0\.5; 'wheels' has wheels 0 to 0"),
        (lambda: WheelFlat(0, 0.05, 0.43, NAN), "flat of wheel 0: phase must be a finite number"),
        (lambda: OutOfRound(0, INF, 3, 0.43), "out-of-round wheel 0: amplitude must be a finite number"),
        (lambda: Dip(INF, 1e-3, 0.5), "dip at inf m: place must be a finite number"),
        (lambda: Cosine(12.0, 1e-3, INF), "cosine at 12.000 m: length must be a finite number"),
        (lambda: Kink(12.0, NAN, 0.5), "kink at 12.000 m: depth must be a finite number"),
        (lambda: BladeTop(12.0, INF, 1e-2), "blade top at 12.000 m: length must be a finite number"),
        (lambda: StockFall(12.0, 1.0, 1e-2, INF), "stock rail at 12.000 m: power must be a finite number"),
        (lambda: Corrugation(11.0, 13.0, 1e-5, INF), "corrugation at 11.000 m: wavelength must be a finite number"),
        (lambda: Sections((11.0, NAN), (0.0, 0.0)), "sections: not all places and dips are numbers"),
        (lambda: Sampled(NAN, 0.01, np.zeros(9)), "sampled dip: start must be a finite number"),
        (lambda: Sampled(11.0, 0.0, np.zeros(9)), "sampled dip: step must be above 0 m"),
        (lambda: Sampled(11.0, 0.01, 1e-3), "sampled dip: needs two values or more in a row, got 0.001"),
        (lambda: passage(irregularities=[Corrugation(11.0, 13.0, 2e-5, 0.008)]), "changes too quickly .* 5 mm, misses"),
        (lambda: passage(irregularities=[WheelFlat(0, 0.01, 0.43)]), "changes too quickly at .* misses 40%"),
        (lambda: passage(seed=-1), "^seed must be a whole number of at least 0, got -1"),
        (lambda: passage(seed=1.5), "^seed must be a whole number of at least 0, got 1.5"),
        (lambda: passage(rail_seed=(3, -1)), "^rail_seed must be a whole number of at least 0, got -1"),
        (lambda: impact(seed=NAN), "^seed must be a whole number of at least 0, got nan"),
        (lambda: passage(started_at="2024-05-13"), "started_at must be a datetime in UTC without a time zone, or None"),
        (lambda: impact(started_at=datetime(2024, 5, 13, tzinfo=UTC)), "started_at must be a datetime in UTC without"),
        (lambda: simulate_passage(TRACK, WHEEL, 40.0, [Sensor("A", 12.0)] * 2), "2 sensors have the name 'A'"),
        (lambda: impact(sensors=[Sensor("hammer", 12.0)]), "2 sensors have the name 'hammer'"),
        (lambda: impact(duration=1e9), r"number of time steps must be below 1e\+08, got 49"),
        (lambda: impact(rate=1e12), r"number of time steps must be below 1e\+08"),
        (
            lambda: simulate_hammer(TRACK, 24.0),
            r"impacts at 24\.000 m, of which some are 0\.020 m away, are not all on",
        ),
        (lambda: simulate_hammer(TRACK, 26.0), "not all on the track, which goes from 0.000 m to 24.000 m"),
        (lambda: couple("train", []), "train: a train of no vehicles"),
        (lambda: couple("train", [WHEEL, lone_wheels(700.0)]), "vehicles of one train need the same gravity"),
        (lambda: PowerLaw(INF), "not those of a contact"),
        (lambda: GapLaw(-1e8), "gap law: stiffness must be at least 0 N/m"),
        (lambda: GapLaw(1e8, onset=0.0), "gap law: onset must be above 0 m"),
        (lambda: LinearLaw(NAN), "linear law: stiffness must be a finite number"),
        (lambda: FrictionLaw(1e3, 0.0), "friction law: slip_rate must be above 0 m/s"),
        (lambda: LiftLaw(-1.0, 0.0, 0.0), "lift law: stiffness must be at least 0 N/m"),
        (lambda: TableLaw((0.0, 1.0), (NAN, 1.0), (0.0, 0.0)), "table law: not all values are numbers"),
    ],
)
def test_a_number_that_cannot_be_used_is_named_with_its_limits(build, expected):
    with pytest.raises(SimulationError, match=expected):
        build()


@pytest.mark.parametrize("speed", [40, np.float32(40.0), np.int64(40), np.array(40.0)])
def test_any_type_of_number_is_used(speed):
    assert np.array_equal(passage(speed).samples, passage(40.0).samples)


@pytest.mark.parametrize(
    "build",
    [
        lambda: WheelFlat(0, 0.0, 0.43),
        lambda: passage(irregularities=[WheelFlat(0, 0.015, 0.43), Corrugation(11.0, 13.0, 1e-5, 0.015)]),
        lambda: simulate_hammer(TRACK, 24.0, Hammer(position_spread=0.0), [Sensor("A", 24.0)], 1),
        lambda: Sensor("A", 1.0, noise=0.0, cutoff=None, limit=INF, resolution=0.0),
        lambda: Hammer(velocity_spread=0.0, position_spread=0.0),
        lambda: LinearLaw(-1e6, 0.0, -2e3),
        lambda: LiftLaw(0.0, 0.0, -5.0),
        lambda: check_count("substeps", np.int64(1)),
        lambda: check_number("lead", -0.3),
        lambda: simulate_passage(TRACK, WHEEL, 40.0, [Sensor("A", 12.0)], rate=5e3, lead=-0.1, tail=0.3, entry=0.0),
    ],
)
def test_a_number_at_its_limit_is_no_error(build):
    build()
