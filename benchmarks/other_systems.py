"""Two systems of others that copies of ``examples/own_system.py`` diagnose: the table of docs/own_simulator.md.

The recordings come from scipy's adaptive Runge-Kutta scheme of order 8, not from the simulation of the example. The
isolator is a mass on a cubic spring under sweeps of force, with its displacement in mm. The pendulum has Coulomb
friction and a noisy sensor of its angle; its copy of the example has ``np.sin(y)`` in place of ``y``.

python -m benchmarks.other_systems
"""

import runpy
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from turnout.mismatch import diagnose

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_system.py"
TOLERANCES = {"rtol": 1e-9, "atol": 1e-12}
RATE = 500.0  # Hz
ISOLATOR = {"frequency": 12.0, "damping": 0.03, "mass": 10.0, "sweep": (5.0, 25.0, 5.0)}  # Hz, -, kg, (Hz, Hz, s)
PENDULUM = {"frequency": 0.8, "damping": 0.002, "friction": 0.006, "noise": 0.001}  # Hz, -, rad, rad
PENDULUM_RATE, PENDULUM_SECONDS = 50.0, 30.0  # Hz, s


@cache
def example(old="", new=""):
    """The names of the example, or of a copy in which one text is replaced by another."""
    source = EXAMPLE.read_text(encoding="utf-8")
    if old and source.count(old) != 1:
        raise ValueError(f"{EXAMPLE.name} holds {old!r} {source.count(old)} times, not once")
    folder = tempfile.mkdtemp()
    path = Path(folder) / EXAMPLE.name
    path.write_text(source.replace(old, new) if old else source, encoding="utf-8")
    return runpy.run_path(str(path))


def isolator(cubic, level, seed, noise=0.002):
    """Force [N] and displacement [mm] under a sweep; ``cubic`` [1/mm²] is the cubic over the linear stiffness."""
    omega, mass = 2.0 * np.pi * ISOLATOR["frequency"], ISOLATOR["mass"]
    low, high, seconds = ISOLATOR["sweep"]
    t = np.arange(round(seconds * RATE)) / RATE
    force = level * np.sin(2.0 * np.pi * (low * t + 0.5 * (high - low) / seconds * t**2))

    def derivative(time, state):
        y, v = state
        spring = omega**2 * (y + cubic * y**3)
        return v, 1e3 * np.interp(time, t, force) / mass - 2.0 * ISOLATOR["damping"] * omega * v - spring

    y = solve_ivp(derivative, (0.0, t[-1]), (0.0, 0.0), "DOP853", t, max_step=1.0 / RATE, **TOLERANCES).y[0]
    return force, y + noise * np.std(y) * np.random.default_rng(seed).normal(size=y.size)


def pendulum(start, seed):
    """Force (none) and angle [rad] of a pendulum that is released from rest."""
    omega = 2.0 * np.pi * PENDULUM["frequency"]
    t = np.arange(round(PENDULUM_SECONDS * PENDULUM_RATE)) / PENDULUM_RATE

    def derivative(_, state):
        y, v = state
        friction = PENDULUM["friction"] * np.tanh(v / (1e-4 * omega * start))
        return v, -(omega**2) * (np.sin(y) + friction) - 2.0 * PENDULUM["damping"] * omega * v

    y = solve_ivp(derivative, (0.0, t[-1]), (start, 0.0), "DOP853", t, max_step=0.01, **TOLERANCES).y[0]
    return np.zeros(t.size), y + PENDULUM["noise"] * np.random.default_rng(seed).normal(size=t.size)


def diagnosed_isolator(cubic):
    """Diagnosis and true amount of the isolator: sweeps of 20, 60 and 120 N, that of 90 N held out."""
    records = [(f"{level} N", f"{level} N", *isolator(cubic, level, k)) for k, level in enumerate((20, 60, 120, 90))]
    gain = 1e3 / ISOLATOR["mass"]
    case = example()["Mount"](records[:3], records[3:], RATE, (11.5, 1.0), (0.03, 0.02), (gain, 0.1 * gain))
    return diagnose(case), cubic * case.scale**2


def diagnosed_pendulum(noise):
    """Diagnosis and true amount of the pendulum: released from 0.6, 0.4 and 0.2 rad, that from 0.5 rad held out."""
    records = [(f"{start} rad", f"{start} rad", *pendulum(start, k)) for k, start in enumerate((0.6, 0.4, 0.2, 0.5))]
    copy = example("(y + scale * missing)", "(np.sin(y) + scale * missing)")
    case = copy["Pendulum"](records[:3], records[3:], PENDULUM_RATE, (0.78, 0.05), (0.005, 0.005), noise=noise)
    return diagnose(case), PENDULUM["friction"] / case.scale


def row(system, diagnosis, true):
    """One line of the table; an amount has two significant digits of its 95 % half width."""
    verdict = diagnosis.verdict
    if verdict.answer != "named":
        return f"| {system} | {verdict.answer} | | {true:.4g} |"
    amount = diagnosis.fit.estimates[0].removeprefix("amount ")
    digits = len(amount.split()[0].partition(".")[2])
    return f"| {system} | {verdict.names[0].replace('_', ' ')}, grade {verdict.grade} | {amount} | {true:.{digits}f} |"


def table():
    """The lines of the table, with the header."""
    yield "| system | answer | amount | true |"
    yield "|---|---|---|---|"
    yield row("isolator of 12 Hz with a cubic spring, sweeps of 20, 60 and 120 N", *diagnosed_isolator(0.0005))
    beyond = "the same with a stronger cubic spring, beyond the range of 2 in `LAWS`"
    yield row(beyond, *diagnosed_isolator(0.02))
    pendulum = "pendulum of 0.8 Hz with Coulomb friction of 6 mrad and 1 mrad of noise"
    yield row(pendulum, *diagnosed_pendulum(PENDULUM["noise"]))
    yield row("the same without `noise`", *diagnosed_pendulum(0.0))


if __name__ == "__main__":
    for line in table():
        print(line, flush=True)
