"""Benchmarks of the simulation: cost, growth of cost, accuracy against closed forms and curves of other programs.

Floquet: an endless even track in closed form. Radau and midpoint are schemes of time integration. Other programs are
not run here: figures named "quoted" were taken from other sources, ROSE from a secondary one (docs/simulation.md).
"""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.oracles.march_numpy import march_numpy
from tests.published.test_simulate_moving_load import below, dip_force, p2_force, spectral_line

from benchmarks.bar import Bar, stopwatch
from turnout.simulate import Sensor, car, load_track, load_vehicle, simulate_passage, uniform_track
from turnout.simulate.discretization_error import BANDS, PassageCase, compare_recordings, end_error, numerical_error
from turnout.simulate.frequency_response import receptance
from turnout.simulate.infinite_track import floquet_receptance, winkler_receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.passage import prepare_passage
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.vehicle import lone_wheels
from turnout.simulate.wheel_path import Kink

SPEED = 160.0 / 3.6
CURVES = Path(__file__).resolve().parents[2] / "shared" / "data" / "reference_track_models"
SENSORS = tuple(Sensor(name, x) for name, x in (("A4", 9.0), ("A7", 24.6), ("A11", 36.0)))
START_UP = """
import time
from turnout.simulate import Sensor, car, simulate_passage, uniform_track
simulate_passage(uniform_track(24.0), car(), 30.0, [Sensor("A", 12.0)], lead=0.1, tail=0.1)
print(time.process_time())
"""


def bars():
    """Every bar of the simulation."""
    for group in (cost, growth, trains, accuracy, mass_matrices, dips, sleeper_passing, other_programs):
        for bar in group():
            yield replace(bar, figure=float(bar.figure))


def best_of(n, work):
    """Least CPU seconds of ``n`` repetitions: on a shared machine the least is that of the program."""
    least = np.inf
    for _ in range(n):
        with stopwatch() as watch:
            work()
        least = min(least, watch.cpu)
    return least


def reference_run(prepared, duration=1.0, start=40.0, positions=(48.0, ("sleeper", 80))):
    """One simulated second: 96 m, 160 bays, four elements each, a car of four wheels."""
    return run(prepared, duration, [Probe(p) for p in positions], car(), Drive(start, 30.0, entry=0.0), forces=False)


def cost():
    """Reference run, start-up, receptance, throughput of fits."""
    for scheme, limit in (("midpoint", 0.15), ("radau", 0.30)):
        prepared = prepare(uniform_track(96.0), 1e-4, scheme)
        reference_run(prepared, 0.01)
        seconds = best_of(5, lambda p=prepared: reference_run(p))
        note = "default scheme" if scheme == "radau" else ""
        yield Bar(f"reference run, {scheme}, 1 simulated second", seconds, limit, "CPU s", n="best of 5", note=note)
    seconds = best_of(5, lambda: prepare(uniform_track(96.0), 1e-4))
    yield Bar("prepare: assemble, factorise, windows", seconds, None, "CPU s", n="best of 5")
    command = [sys.executable, "-c", START_UP]
    subprocess.run(command, check=True, capture_output=True)
    spent = min(float(subprocess.run(command, check=True, capture_output=True).stdout) for _ in range(3))
    yield Bar("start-up of a cached process with a first short run", spent, 1.5, "CPU s", n="best of 3")
    matrices, lines = assemble(uniform_track(96.0)), np.arange(20.0, 1001.0)
    receptance(matrices, lines[:2], 48.0, 48.0)
    seconds = best_of(5, lambda: receptance(matrices, lines, 48.0, 48.0))
    yield Bar("receptance, 981 lines, 1443 degrees of freedom", seconds, 0.1, "CPU s", n="best of 5")
    for scheme, limit in (("midpoint", 25.0), ("radau", 10.0)):
        prepared = prepare(uniform_track(60.0), 1e-4, scheme)
        reference_run(prepared, 0.01, 25.0, (30.0,))
        seconds = best_of(7, lambda p=prepared: reference_run(p, 0.5, 25.0, (30.0,)))
        name = f"fit throughput, {scheme}, 60 m x 0.5 s"
        yield Bar(name, 1.0 / seconds, limit, "runs/s/core", ">=", n="best of 7")


def growth():
    """Cost against length, time step and number of wheels, compared with proportional growth."""
    seconds = {}
    for length in (48.0, 96.0, 192.0, 384.0):
        prepared = prepare(uniform_track(length), 1e-4)
        positions = (length / 2, ("sleeper", 20))
        seconds[length] = best_of(3, lambda p=prepared, at=positions: reference_run(p, 0.2, 40.0, at))
        yield Bar(f"length {length:.0f} m, 0.2 s", seconds[length], None, "CPU s", n="best of 3")
        memory = sum(a.nbytes for a in prepared.arrays if isinstance(a, np.ndarray)) / length
        yield Bar(f"length {length:.0f} m, memory per metre", memory / 1e3, None, "kB/m", note="constant: O(n)")
    yield Bar("length 384 m over 96 m, 4 is linear", seconds[384.0] / seconds[96.0], 4.6, "")
    step = {}
    for dt in (1e-4, 2.5e-5):
        prepared = prepare(uniform_track(96.0), dt)
        step[dt] = best_of(3, lambda p=prepared: reference_run(p, 0.2))
    yield Bar("dt 2.5e-5 s over 1e-4 s, 4 is linear", step[2.5e-5] / step[1e-4], 4.6, "")
    prepared, wheels = prepare(uniform_track(192.0), 1e-4), {}
    for count in (1, 4):
        train = load_vehicle("coach", 0.5, units=count)
        drive = Drive(150.0, 30.0, entry=0.0)
        wheels[count] = best_of(3, lambda t=train, d=drive: run(prepared, 0.2, [Probe(96.0)], t, d, forces=False))
    yield Bar("16 wheels over 4 wheels, 4 would be proportional", wheels[4] / wheels[1], 2.0, "")


def trains():
    """Whole trains over the 100 m turnout with 12 sensors at 20 kHz, as a share of real time."""
    turnout = load_track("tommerup")
    sensors = [Sensor(f"A{k + 1}", x, noise=0.05) for k, x in enumerate(np.linspace(-12.0, 38.0, 12))]
    prepared = prepare_passage(turnout)
    for name, speed, limit in (("ic3", SPEED, 1.0), ("freight", 100.0 / 3.6, 3.0), ("intercity", SPEED, None)):
        vehicle = load_vehicle(name, 0.5)
        recording = None
        least = np.inf
        for _ in range(2 if name == "ic3" else 1):
            with stopwatch() as watch:
                recording = simulate_passage(turnout, vehicle, speed, sensors, prepared=prepared, seed=1)
            least = min(least, watch.cpu)
        title = f"{name}, {len(vehicle.wheels)} axles, 102 m, 12 sensors, 20 kHz"
        yield Bar(title, least / recording.duration, limit, "x real time", note=f"{recording.duration:.1f} s")


def accuracy():
    """Accuracy against closed forms, and the discretization error by halving step and mesh."""
    rail = Rail(210e9 * 3.055e-5, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5, damping=2.0)
    frequency = np.arange(20.0, 901.0, 2.0)
    for elements in (4, 8, 16):
        track = uniform_track(96.0, rail=rail, elements_per_bay=elements)
        worst = np.zeros(2)
        for offset in (0.0, 0.15, 0.3):
            computed = receptance(assemble(track), frequency, 48.0 + offset, 48.0 + offset)
            error = np.abs(np.abs(computed / floquet_receptance(frequency, track, offset)) - 1.0)
            worst = np.maximum(worst, [error[frequency <= 500.0].max(), error.max()])
        yield Bar(f"Floquet, {elements} elements per bay, to 500 Hz", 100 * worst[0], 0.5, "%")
        yield Bar(f"Floquet, {elements} elements per bay, to 900 Hz", 100 * worst[1], 2.0, "%")
    h = 0.15
    beam = Rail(6.42e6, 60.21, 2.4e8, beam="euler")
    track = uniform_track(96.0, h, beam, layers=1, pad_stiffness=1e8 * h, pad_damping=3e4 * h, elements_per_bay=1)
    lines = np.array([20.0, 205.0, 500.0, 1000.0])
    error = np.abs(
        receptance(assemble(track), lines, 48.0, 48.0) / winkler_receptance(lines, 6.42e6, 60.21, 1e8, 3e4) - 1
    )
    yield Bar("Winkler beam, 20-1000 Hz", error.max(), 1e-3, "")
    prepared = prepare(uniform_track(24.0, end_length=4.0, end_damping=400.0), 1e-4)
    drive = Drive(11.5, SPEED, surfaces=((Kink(12.1, 1e-3, 0.4, 0.6),),), entry=3.0)
    vehicle = car(half_pivot=2.6)
    plain = run(prepared, 0.02, [Probe(12.0)], vehicle, drive, marcher=march_numpy)
    compiled = run(prepared, 0.02, [Probe(12.0)], vehicle, drive)
    difference = np.max(np.abs(compiled.signals - plain.signals)) / np.max(np.abs(compiled.signals))
    yield Bar("compiled march against plain numpy, relative", difference, 1e-9, "")
    case = PassageCase(load_track("tommerup"), car(half_pivot=4.0), SPEED, SENSORS, {"lead": 0.3, "tail": 0.2})
    report = numerical_error(case)
    for k, (low, high) in enumerate(report.bands):
        title = f"own error {low:.0f}-{high:.0f} Hz: step, waveform, worst sensor"
        yield Bar(title, 100 * report.step[:, k].max(), 2.0, "%")
        mesh, level = 100 * report.mesh[:, k].max(), np.abs(report.level_mesh[:, k]).max()
        yield Bar(f"own error {low:.0f}-{high:.0f} Hz: mesh, waveform", mesh, None, "%", note=f"level {level:.2f} dB")
    ends = 100 * end_error(case)
    yield Bar("own error: absorbing ends, 5-600 Hz, worst band", ends[:, :4].max(), None, "%")
    yield Bar("own error: absorbing ends, 600-1000 Hz", ends[:, 4].max(), None, "%")


def mass_matrices():
    """The same passage with either mass matrix of the rail, against 16 elements per bay with the same matrix."""
    turnout = load_track("tommerup")

    def passage(mass_matrix, elements):
        rail = replace(turnout.track.rail, mass_matrix=mass_matrix)
        stretches = tuple(replace(s, rail=replace(s.rail, mass_matrix=mass_matrix)) for s in turnout.track.stretches)
        track = turnout.with_track(elements_per_bay=elements, rail=rail, stretches=stretches)
        sensors = tuple(replace(sensor, cutoff=None) for sensor in SENSORS)
        return simulate_passage(track, car(half_pivot=4.0), SPEED, sensors, lead=0.3, tail=0.2).samples

    for mass_matrix, numbers in (("consistent", (4, 8)), ("corrected", (4, 5, 8))):
        finest = passage(mass_matrix, 16)
        for elements in numbers:
            with stopwatch() as watch:
                samples = passage(mass_matrix, elements)
            errors = 100 * compare_recordings(samples, finest, 20e3)[0].max(axis=0)
            for (low, high), error in list(zip(BANDS, errors))[3:]:
                title = f"{mass_matrix} mass, {elements} elements, {low:.0f}-{high:.0f} Hz, worst sensor"
                yield Bar(title, error, None, "%", note=f"{watch.cpu:.2f} CPU s")


def dips():
    """Second peak of the contact force at a dip, against the formula of Jenkins et al. 1974."""
    prepared = prepare(uniform_track(96.0), 5e-5)
    for mass, speed, angles in (
        (600.0, SPEED, (5e-3, 10e-3, 20e-3)),
        (900.0, 100 / 3.6, (20e-3,)),
        (300.0, 100 / 3.6, (20e-3,)),
    ):
        for angle in angles:
            time, force = dip_force(prepared, mass, angle, speed)
            after, formula = (time > 0.0) & (time < 0.012), p2_force(mass, angle, speed)
            title = f"second peak at a dip, {mass:.0f} kg, {1e3 * angle:.0f} mrad, {3.6 * speed:.0f} km/h"
            for limit in (100.0, *((80.0, 90.0, 120.0, 150.0) if angle == 5e-3 else ())):
                peak = below(limit, force, 5e-5)[after].max()
                yield Bar(f"{title}, below {limit:.0f} Hz", peak / 1e3, None, "kN", note=f"formula {formula / 1e3:.0f}")
            late = force[(time > 3e-3) & (time < 0.02)].max()
            yield Bar(f"{title}, from 3 ms on, no filter", late / 1e3, None, "kN", note=f"formula {formula / 1e3:.0f}")


def sleeper_passing():
    """Force lines of a wheel at the first four multiples of speed over bay, by elements per bay."""
    wheel, n = lone_wheels(750.0, gravity=0.0, pressing=53.96e3), round(72 * 0.6 / SPEED / 1e-4)
    for elements in (4, 16):
        prepared = prepare(uniform_track(96.0, elements_per_bay=elements), 1e-4)
        outcome = run(prepared, 1.35, [], wheel, Drive(18.0, SPEED, entry=0.0))
        force, time = outcome.force[0][-n:], outcome.time[-n:]
        for k in (1, 2, 3, 4):
            title = f"force line at {k * SPEED / 0.6:.0f} Hz, {elements} elements per bay"
            yield Bar(title, spectral_line(force, time, k * SPEED / 0.6), None, "N")


def other_programs():
    """Curves of other models, if they lie beside the checkout, and quoted costs."""
    if CURVES.is_dir():
        yield from rolland()
        yield from nordborg()
    for name, seconds in (
        ("ROSE, elapsed", 9.4),
        ("railFE, one wheel, 49 m", 238.0),
        ("UVEC, vehicle only, at least", 2.0),
    ):
        yield Bar(f"quoted: {name}, 1 simulated second", seconds, None, "s", note="not run here")
    yield Bar(
        "quoted: ROSE force lines at 73.8 and 148.8 Hz, ratio",
        802.0 / 118.0,
        None,
        "",
        note="not run here; its pads and vehicle are not known",
    )


def rolland():
    """Mobility of the two discretely supported tracks of rolland's tests.

    Their columns are computed, not digitised. The difference is the mass of the rail: 60.21 kg/m, or density times
    area, 60.34 kg/m. It shifts the resonances by 0.1 % and the slopes behind them by 0.1 dB.
    """
    table = np.genfromtxt(CURVES / "rolland_data_analytical_methods.csv", delimiter=",", names=True)
    rail = Rail(210e9 * 3038.3e-8, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3038.3e-8)
    slab = {"layers": 1, "pad_loss_factor": 0.25}
    ballast = {"sleeper_mass": 162.0, "ballast_stiffness": 50e6, "ballast_damping": 0.0}
    ballast |= {"ballast_loss_factor": 1.0, "pad_loss_factor": 0.25}
    frequency = table["Frequency"]
    low = frequency <= 900.0
    for column, values in (("TSDiscr1LSupp", slab), ("TSDiscr2LSupp", ballast)):
        track = uniform_track(144.0, rail=rail, pad_damping=0.0, elements_per_bay=8, **values)
        mobility = 2.0 * np.pi * frequency[low] * np.abs(receptance(assemble(track), frequency[low], 72.0, 72.0))
        error = 20.0 * np.log10(mobility / table[column][low])
        yield Bar(f"rolland {column}, 20-900 Hz, largest difference", np.abs(error).max(), 0.15, "dB")


def nordborg():
    """Nordborg's receptance, digitised by others to about 1 dB: a load moving at 60 m/s."""
    text = (CURVES / "nordborg_data.csv").read_text().replace(",", ".").splitlines()
    frequency, level = np.array([[float(v) for v in line.split(";")] for line in text]).T
    rail = Rail(2.1e11 * 22.5e-6, 60.0, 1.0, beam="euler")
    track = uniform_track(
        96.0, rail=rail, pad_stiffness=300e6, pad_damping=18e3, ballast_stiffness=150e6, ballast_damping=48e3
    )
    inside = (frequency > 20.0) & (frequency < 900.0)
    computed = 20.0 * np.log10(np.abs(receptance(assemble(track), frequency[inside], 48.3, 48.3)))
    error = computed - level[inside]
    note = f"median {np.median(error):+.2f} dB"
    yield Bar(
        "Nordborg, 20-900 Hz, standing load, 90 % of points within",
        np.quantile(np.abs(error), 0.9),
        None,
        "dB",
        note=note,
    )
