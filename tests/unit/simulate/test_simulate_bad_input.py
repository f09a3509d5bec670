"""Bad input is rejected with time, position and value; a run never returns NaN."""

import numpy as np
import pytest

from turnout.errors import ConfigError, SimulationError
from turnout.physics import SensorPosition
from turnout.simulate import (
    Sensor,
    car,
    divided_step,
    load_track,
    load_vehicle,
    prepare_passage,
    simulate_hammer,
    simulate_passage,
    statics,
    uniform_track,
)
from turnout.simulate.force_laws import PowerLaw, TableLaw
from turnout.simulate.links import Link
from turnout.simulate.matrices import assemble
from turnout.simulate.path_checks import check_path
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import Track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Body, Vehicle, lone_wheels
from turnout.simulate.wheel_path import Sections

TRACK = uniform_track(24.0)
SENSOR = [Sensor("A", 12.0)]


def test_an_error_states_which_wheel_leaves_the_track_when_and_where():
    drive = Drive(20.0, 40.0, entry=0.0)
    with pytest.raises(SimulationError, match=r"wheel 0 leaves the track at 0\.1000 s: it is at 24\.001 m"):
        run(prepare(TRACK, 1e-4), 0.5, [Probe(12.0)], lone_wheels(700.0), drive)


def test_an_error_states_which_wheel_is_off_the_track_at_time_zero():
    with pytest.raises(SimulationError, match=r"wheel 1 leaves the track at 0\.0000 s: it is at -0\.500 m"):
        run(prepare(TRACK, 1e-4), 0.1, [], lone_wheels(700.0, (0.0, 2.5)), Drive(2.0, 10.0, entry=0.0))


@pytest.mark.parametrize("speed", [0.0, -3.0, np.nan, np.inf])
def test_a_speed_that_is_not_positive_and_finite_is_rejected(speed):
    with pytest.raises(SimulationError, match="speed must be above 0 m/s"):
        simulate_passage(TRACK, car(), speed, SENSOR)


def test_an_error_about_the_number_of_values_states_both_numbers():
    with pytest.raises(SimulationError, match="pad_stiffness has 12 values for 41 supports"):
        TRACK.with_(pad_stiffness=np.ones(12))


def test_an_error_about_negative_stiffness_states_support_position_and_value():
    stiffness = TRACK.ballast_stiffness.copy()
    stiffness[7] = -1e6
    with pytest.raises(SimulationError, match=r"ballast_stiffness of support 7 at 4\.200 m is negative: -1e\+06\."):
        TRACK.with_(ballast_stiffness=stiffness)


def test_a_value_that_is_no_number_is_rejected():
    with pytest.raises(SimulationError, match="pad_damping holds"):
        TRACK.with_(pad_damping=np.nan)


def test_an_error_about_a_step_of_a_path_states_its_position():
    def step(x, wheel=0):
        return np.where(np.asarray(x) > 12.3, 3e-3, 0.0)

    with pytest.raises(SimulationError, match=r"jumps by 3\.00 mm at 12\.\d+ m"):
        check_path((step,), 0.0, 24.0)
    with pytest.raises(SimulationError, match="jumps"):
        simulate_passage(TurnoutTrack(TRACK, {"main": ((step,),)}), car(half_pivot=3.0), 30.0, SENSOR)
    check_path((Sections((3.0, 4.0, 5.0), (0.0, 2e-3, 0.0)),), 0.0, 24.0)


def test_an_error_about_a_path_that_is_no_number_states_the_position():
    with pytest.raises(SimulationError, match=r"not a number at 12\.00"):
        simulate_passage(
            TurnoutTrack(TRACK, {"main": ((lambda x, wheel=0: np.where(x > 12.0, np.nan, 0.0),),)}), car(), 30.0, SENSOR
        )


def test_an_error_about_convergence_states_time_wheel_and_residual(monkeypatch):
    """The force has a step: with the contact open it closes, with the contact closed it opens, and so on."""
    monkeypatch.setattr(divided_step, "MAX_DIVISIONS", 0)
    step = TableLaw((-1.0, 2.9e-5, 2.9e-5 + 1e-12, 1.0), (0.0, 0.0, 6e4, 6e4), (0.0, 0.0, 0.0, 0.0))
    wheel = lone_wheels(700.0, contact=step, gravity=0.0)
    drive = Drive(12.0, 0.0, entry=0.0, free_fall=(0.0, 1.0))
    with pytest.raises(SimulationError, match=r"did not converge at 0\.0\d+ s: residual .* N at wheel 0"):
        run(prepare(TRACK, 1e-4), 0.05, [], wheel, drive)


def test_an_equilibrium_whose_steps_diverge_is_an_error_of_the_simulation(monkeypatch):
    """LAPACK gives up on numbers of very different size. A fit takes a shorter step then, as for any other error."""

    def diverging(*args, **kwargs):
        raise np.linalg.LinAlgError("SVD did not converge in Linear Least Squares")

    monkeypatch.setattr(np.linalg, "lstsq", diverging)
    monkeypatch.setattr(statics, "TOLERANCE", 0.0)  # else the first guess is the equilibrium of this wheel
    with pytest.raises(SimulationError, match="static equilibrium at time 0 s not found: residual"):
        run(prepare(TRACK, 1e-4), 0.05, [], lone_wheels(700.0), Drive(12.0, 10.0, entry=0.0))


def test_a_track_that_carries_nothing_is_rejected():
    with pytest.raises(SimulationError, match="carries no load"):
        prepare(TRACK.with_(ballast_stiffness=0.0), 1e-4)


def test_a_body_without_support_is_rejected():
    floating = Vehicle("v", (Body("box", 1e3, 1e3, 1.0), Body("wheel", 700.0, None, 0.0)), (), (1,))
    with pytest.raises(SimulationError, match="rests on nothing"):
        simulate_passage(TRACK, floating, 30.0, SENSOR)


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda: Track(TRACK.rail, [0.0, 2.0, 1.0], 1e8, 0.0, layers=1), "rising positions"),
        (lambda: assemble(TRACK).weights(99.0), "outside the track"),
        (lambda: assemble(TRACK).weights(("ballast", 3)), "no degree of freedom"),
        (lambda: Link(()), "acts on no degree"),
        (lambda: Link(((("rail", 1), 1.0),), float("inf")), "not a finite number"),
        (lambda: PowerLaw(-1.0), "not those of a contact"),
        (lambda: TableLaw((0.0, 0.0), (0.0, 1.0), (0.0, 0.0)), "must rise"),
        (lambda: prepare(TRACK, 0.0), "time step must be above 0"),
        (lambda: prepare(TRACK, 1e-4, "euler"), "none of midpoint, radau, gauss"),
        (lambda: simulate_passage(TRACK, car(), 30.0, []), "records nothing"),
        (lambda: simulate_passage(TRACK, car(), 30.0, SENSOR, "sideways"), "neither 'facing' nor 'trailing'"),
        (lambda: simulate_passage(TRACK, car(), 30.0, [Sensor("Z", 40.0)]), "'Z' at 40.000 m is outside"),
        (lambda: simulate_passage(TurnoutTrack(TRACK), car(), 30.0, SENSOR, route="siding"), "no route 'siding'"),
        (
            lambda: simulate_passage(TRACK, car(), 30.0, SENSOR, prepared=prepare_passage(TRACK, rate=10e3)),
            r"for steps of 0\.0001 s, but 20000\.0 Hz with 1 per sample ask for 5e-05 s",
        ),
        (lambda: simulate_hammer(TRACK, "A7"), "no section 'A7'"),
        (lambda: load_vehicle("tgv"), r"no file config/vehicles/tgv.yaml\. Write one of .*coach"),
        (lambda: load_vehicle("ic3", load=7.0), "load 7.0"),
        (lambda: load_track("nowhere"), "Write one of tommerup"),
    ],
)
def test_errors_about_other_bad_input_state_what_is_wrong(build, expected):
    with pytest.raises(SimulationError, match=expected):
        build()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mass: {value: 3, unit: kg}", "a number without source"),
        ("mass: {value: 3, unit: stone, source: x}", "unknown unit 'stone'"),
        ("mass: {value: three, unit: kg, source: x}", "'three' is not a number"),
        ('mass: {value: "3,5", unit: kg, source: x}', "Write a number, with a decimal point: 3.5."),
        ("mass: {value: 3, unit: kg, source: estimate}", "an estimate without a prior"),
        ("mass: {value: 3, unit: kg, source: x, sauce: y}", "unknown key 'sauce'"),
        ("name: [1, 2", "line"),
    ],
)
def test_an_error_of_a_parameter_file_states_the_file_and_the_cause(tmp_path, text, expected):
    path = tmp_path / "wrong.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=expected) as caught:
        load_vehicle(str(path))
    assert "wrong.yaml" in str(caught.value)


@pytest.mark.parametrize(("direction", "place"), [("facing", 8.9), ("trailing", 15.1)])
@pytest.mark.parametrize("mounting", ["rail web", "sleeper"])
def test_a_sensor_where_wheels_are_not_yet_on_the_track_is_rejected_with_both_limits(direction, place, mounting):
    sensors = [*SENSOR, Sensor("B", place, mounting)]
    with pytest.raises(SimulationError, match=rf"'B' at {place:.3f} m.* only between 9\.000 m and 15\.000 m"):
        simulate_passage(TRACK, car(), 30.0, sensors, direction)


def test_the_limit_applies_to_the_true_position_of_a_sensor():
    with pytest.raises(SimulationError, match=r"'A' at 8\.900 m"):
        simulate_passage(TRACK, car(), 30.0, [Sensor("A", 9.4)], terms=(SensorPosition("A", -0.5),))


def test_a_sensor_at_the_limit_records_the_same_as_one_in_the_middle():
    """A uniform track is the same everywhere: the highest deflection under a wheel agrees to 1 %, with its own
    stand-in behind the limit; 3 m from the end it is a hundredth."""
    sensors = [Sensor(name, x, quantity="displacement", cutoff=None) for name, x in zip("ABC", (9.0, 18.0, 27.0))]
    wheel = lone_wheels(600.0, (0.0,), pressing=50e3)
    track = uniform_track(36.0, end_length=9.0, end_damping=400.0)
    peak = simulate_passage(track, wheel, 44.0, sensors, rate=10e3, lead=0.25, tail=0.1).samples.max(axis=1)
    assert peak == pytest.approx(peak[1], rel=0.01)
