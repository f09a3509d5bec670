"""Two systems of other fields to start from: one under a known force, one released and left to decay.

Adapt it in three steps: write the equation of motion in ``acceleration``, its parameters in ``Mount`` or ``Pendulum``,
and what may be missing in ``LAWS``. Run it: ``python -m examples.own_system`` makes recordings with a concealed law
and diagnoses them.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from turnout.mismatch import Candidate, Case, Nuisance, Observation, diagnose
from turnout.physics import Parameter

# --- 1. The equation of motion: y'' = f(y, y', force; parameters), and the laws that may be missing

# Name -> (number, meaning, lowest and highest amount). With an amount of 1 a law is as strong as the linear spring
# at the displacement ``scale``.
LAWS = {
    "cubic_spring": (0, "spring force grows with the cube of the displacement", (-2.0, 2.0)),
    "quadratic_drag": (1, "drag grows with the square of the velocity", (0.0, 2.0)),
    "dry_friction": (2, "dry friction opposes the motion", (0.0, 0.5)),
    "quadratic_spring": (3, "spring is stiffer on one side", (-2.0, 2.0)),
}
# Parts of the free laws that are no candidates: with the laws above they follow many laws that no library has.
FREE_PARTS = {
    "absolute_quadratic_spring": (4, "spring force grows with the square of the displacement", (-2.0, 2.0)),
    "state_damping": (5, "damping grows with the square of the displacement", (-2.0, 2.0)),
}
ALL_LAWS = {**LAWS, **FREE_PARTS}
SOURCE = "Worden and Tomlinson 2001, Nonlinearity in structural dynamics, chapter 2"
STICKING = 0.001  # of the largest velocity: below it dry friction is viscous; a larger share makes a body creep to rest


@njit(cache=True)
def law_force(law, y, v):
    """Force of a law over that of the linear spring at y = 1; y and v are over their scales."""
    if law == 0:
        return y**3
    if law == 1:
        return abs(v) * v
    if law == 2:
        return np.tanh(v / STICKING)
    if law == 3:
        return y * y
    if law == 4:
        return abs(y) * y
    return y * y * v


@njit(cache=True)
def acceleration(y, v, force, parameters, laws, amounts, scale):
    """Acceleration of the mass: ``parameters`` are frequency [Hz], damping ratio and gain of the force."""
    omega, damping, gain = 2.0 * np.pi * parameters[0], parameters[1], parameters[2]
    missing = 0.0
    for k in range(laws.size):
        missing += amounts[k] * law_force(laws[k], y / scale, v / (omega * scale))
    return gain * force - 2.0 * damping * omega * v - omega**2 * (y + scale * missing)


@njit(cache=True)
def simulate(force, dt, start, parameters, laws, amounts, scale):
    """Displacement at every sample by the classical Runge-Kutta scheme, from rest at ``start``."""
    out = np.zeros(force.size)
    y, v = start, 0.0
    for n in range(force.size):
        out[n] = y
        after = force[min(n + 1, force.size - 1)]
        middle = 0.5 * (force[n] + after)
        a1 = acceleration(y, v, force[n], parameters, laws, amounts, scale)
        a2 = acceleration(y + 0.5 * dt * v, v + 0.5 * dt * a1, middle, parameters, laws, amounts, scale)
        y3, v3 = y + 0.5 * dt * (v + 0.5 * dt * a1), v + 0.5 * dt * a2
        a3 = acceleration(y3, v3, middle, parameters, laws, amounts, scale)
        y4, v4 = y + dt * v3, v + dt * a3
        a4 = acceleration(y4, v4, after, parameters, laws, amounts, scale)
        y += dt / 6.0 * (v + 2.0 * (v + 0.5 * dt * a1) + 2.0 * v3 + v4)
        v += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not abs(y) < 1e3 * scale:
            out[n + 1 :] = np.nan  # the fit does not use a simulation that is not finite
            break
    return out


# --- 2. The case: recordings, uncertain parameters, candidates, and a prediction


@dataclass(frozen=True)
class Law:
    """A law with its amount, as ``predict`` gets it; ``Fit.estimates`` states amounts with their intervals."""

    name: str
    amount: float

    def sentence(self):
        """The law in words."""
        return ALL_LAWS[self.name][1]


def checked_record(name, force, y):
    """Force and displacement of one record as arrays. ValueError if they are no pair that can be simulated."""
    force, y = np.asarray(force, dtype=float), np.asarray(y, dtype=float)
    if force.ndim != 1 or force.shape != y.shape or y.size < 2:
        raise ValueError(f"{name}: force {force.shape} and displacement {y.shape} must be two rows of equal length")
    if not (np.all(np.isfinite(force)) and np.all(np.isfinite(y))):
        raise ValueError(f"{name}: force or displacement has missing samples (NaN or infinity); cut the record there")
    return force, y


def law_candidates(names, bounds=None):
    """A candidate for each law; its parameter is the amount."""
    candidates = []
    for name in names:
        low, high = bounds or ALL_LAWS[name][2]
        parameter = Parameter("amount", "-", 0.0, (low, high), ALL_LAWS[name][1], SOURCE)
        candidates.append(
            Candidate.of(name, (parameter,), lambda psi, n=name: Law(n, psi["amount"]), ((0.1 * high,),),
                         frame="amplitude", component="mass")
        )  # fmt: skip
    return tuple(candidates)


class Mount(Case):
    """A mass on a mount under a known force: displacement over time, recorded at several levels.

    Parameters
    ----------
    records, reserved : sequence of (name, condition, force, displacement)
        Those that are fitted, and those that test the result. One condition per level: a name must hold at all.
    rate : float
        Samples per second. [Hz]
    frequency, damping, gain : (mean, sd)
        What is known beforehand.
    tolerance : float
        Error of the model that does not matter, over the rms of a record.
    noise : float
        Standard deviation of the sensor's noise. A record that has decayed to it needs this number, because the
        tolerance alone would then be below the noise, and no law would explain the record. [m]
    without : sequence of str
        Laws that are left out of the library.

    Raises
    ------
    ValueError
        If a number is out of its range, a record is incomplete, or no law has a name in ``without``.
    """

    def __init__(
        self, records, reserved, rate, frequency, damping, gain=(0.0, 0.0), tolerance=0.01, noise=0.0, without=()
    ):
        for what, number in (("rate", rate), ("mean of the frequency", frequency[0])):
            if not float(number) > 0.0:
                raise ValueError(f"the {what} is {number} Hz; it must be above 0")
        if not (tolerance >= 0.0 and noise >= 0.0):
            raise ValueError(f"tolerance {tolerance} and noise {noise} must not be negative")
        if unknown := sorted(set(without) - set(LAWS)):
            raise ValueError(f"without: no law is called {unknown[0]!r}; there are {', '.join(LAWS)}")
        self.rate, self.gain, self.noise = float(rate), gain, noise
        records, reserved = ([(n, c, *checked_record(n, f, y)) for n, c, f, y in rows] for rows in (records, reserved))
        self.recorded = {name: (force, y) for name, _, force, y in (*records, *reserved)}
        self.scale = max((float(np.max(np.abs(y))) for *_, y in records), default=0.0)
        self.observations = tuple(self.observation(*r, tolerance) for r in records)
        self.reserved = tuple(self.observation(*r, tolerance) for r in reserved)
        self.nuisances = tuple(self.parameters(frequency, damping))
        self.candidates = law_candidates([n for n in LAWS if n not in without])
        self.free_laws = law_candidates(ALL_LAWS, (-2.0, 2.0))

    def observation(self, name, condition, force, y, tolerance):
        """One record; a tenth of its samples count as independent."""
        return Observation(name, condition, y, float(np.hypot(tolerance * np.std(y), self.noise)), 0.1)

    def parameters(self, frequency, damping):
        """Uncertain numbers of the linear system, with mean and standard deviation."""
        yield Nuisance("frequency", "Hz", *frequency, bounds=(0.05 * frequency[0], np.inf))
        yield Nuisance("damping", "-", *damping, bounds=(0.0, 1.0))
        yield Nuisance("gain", "m/s² per unit of force", *self.gain)

    def start(self, values, name):
        """Displacement at the start of a record. [m]"""
        return 0.0

    def predict(self, values, terms, observations):
        """Displacement of every record with these parameters and laws."""
        linear = np.array([values["frequency"], values["damping"], values.get("gain", 0.0)])
        laws = np.array([ALL_LAWS[t.name][0] for t in terms], dtype=np.int64)
        amounts = np.array([t.amount for t in terms], dtype=float)
        return [
            simulate(self.recorded[o.name][0], 1.0 / self.rate, self.start(values, o.name), linear, laws, amounts,
                     self.scale)
            for o in observations
        ]  # fmt: skip


class Pendulum(Mount):
    """A body that is released from rest and left to decay: no force, an uncertain start for each record."""

    def parameters(self, frequency, damping):
        """Uncertain numbers: those of the system, and the start of each record, which this record alone knows."""
        yield Nuisance("frequency", "Hz", *frequency, bounds=(0.05 * frequency[0], np.inf))
        yield Nuisance("damping", "-", *damping, bounds=(0.0, 1.0))
        for name, (_, y) in self.recorded.items():
            yield Nuisance(f"start_{name}", "m", float(y[0]), 0.02 * self.scale, owner=name)

    def start(self, values, name):
        """Displacement at the release of a record. [m]"""
        return values[f"start_{name}"]


# --- 3. Recordings with a concealed law, to see that the case works


def made_records(law, amount, levels, rate=200.0, seconds=10.0, force_sd=1.0, noise=0.002, seed=1):
    """Records of a system of 4 Hz and 1.5 % damping with one law in it; ``force_sd`` 0: released from the levels."""
    rng, n = np.random.default_rng(seed), round(rate * seconds)
    numbers = np.array([LAWS[law][0]] if law else [], dtype=np.int64)
    amounts = np.array([amount] if law else [], dtype=float)
    records = []
    for k, level in enumerate(levels):
        force = level * force_sd * np.convolve(rng.normal(size=n), np.ones(10) / np.sqrt(10.0), "same")
        start = 0.0 if force_sd else level
        y = simulate(force, 1.0 / rate, start, np.array([4.0, 0.015, 100.0]), numbers, amounts, 1.0)
        records.append((f"record {k}", f"level {level:g}", force, y + noise * np.std(y) * rng.normal(size=n)))
    return records


def show(title, diagnosis):
    """Print the answer, the effect with its size, and the fit on the held-out record, or what to do without a name."""
    print(f"{title}: {diagnosis}")
    for term, estimate in zip(diagnosis.fit.terms, diagnosis.fit.estimates):
        print(f"   {term.sentence()}: {estimate}")
    fit = diagnosis.verification
    if not diagnosis.fit.terms and diagnosis.verdict.answer == "unknown":
        print("   no law is named: check the noise, the step of the simulation, the ranges of the amounts,")
        print("   and whether the records are too long for the stated frequency; then add what else may act")
        return
    if fit.n == 0:
        print("   no record was held out, so nothing tests this answer: give one in reserved")
    elif fit.after is None:
        print(f"   fit on the held-out record: {fit.before:.1f} %")
    else:
        print(f"   fit on the held-out record: {fit.before:.1f} % without it, {fit.after:.1f} % with it")


def main():
    """Diagnose a mount with quadratic drag and a pendulum with dry friction."""
    forced = made_records("quadratic_drag", 0.3, (0.3, 0.6, 1.0, 0.8))
    case = Mount(forced[:3], forced[3:], 200.0, (3.8, 0.5), (0.03, 0.03), (90.0, 30.0))
    show("forced", diagnose(case))
    free = made_records("dry_friction", 0.01, (1.0, 0.5, 0.25, 0.7), force_sd=0.0)
    case = Pendulum(free[:3], free[3:], 200.0, (3.8, 0.5), (0.03, 0.03))
    show("free decay", diagnose(case))


if __name__ == "__main__":
    main()
