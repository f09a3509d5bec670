"""A single-degree-of-freedom oscillator with a nonlinear law in its feedback: the smallest system to diagnose."""

from dataclasses import dataclass

import numpy as np
from examples.own_system import checked_record
from numba import njit

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.physics.term import Parameter

# Laws of displacement y and velocity v, both over their scales: with a parameter of 1 a law is as strong as the linear
# spring.
(CUBIC, QUINTIC, QUADRATIC, ABSOLUTE, SOFTENING, PLAY, FRICTION, DRAG, CUBIC_DAMPING, STATE_DAMPING, NONE) = range(11)
LAWS = {
    "cubic_spring": (CUBIC, "spring force grows with the cube of the displacement", (-3.0, 3.0)),
    "quintic_spring": (QUINTIC, "spring force grows with the fifth power of the displacement", (-3.0, 3.0)),
    "quadratic_spring": (QUADRATIC, "spring is stiffer on one side", (-3.0, 3.0)),
    "absolute_quadratic_spring": (ABSOLUTE, "spring force grows with the square of the displacement", (-3.0, 3.0)),
    "saturating_spring": (SOFTENING, "a further spring saturates", (-3.0, 3.0)),
    "play": (PLAY, "spring is lost within a play of a tenth of the motion", (0.0, 3.0)),
    "dry_friction": (FRICTION, "dry friction opposes the motion", (0.0, 10.0)),
    "quadratic_drag": (DRAG, "drag grows with the square of the velocity", (0.0, 3.0)),
    "cubic_damping": (CUBIC_DAMPING, "damping force grows with the cube of the velocity", (-1.0, 3.0)),
    "state_damping": (STATE_DAMPING, "damping grows with the square of the displacement", (-1.0, 3.0)),
}
LOWEST_FREQUENCY = 1e-3  # of the prior mean
SOURCE = "Kerschen et al. 2006, Past, present and future of nonlinear system identification in structural dynamics"


@dataclass(frozen=True)
class LawTerm:
    """Feedback force of one law; ``amount`` is its share of the linear spring force at the scale of the motion."""

    name: str
    law_index: int
    amount: float

    def sentence(self):
        """The law in words."""
        return f"{LAWS[self.name][1]} (amount {self.amount:.3g})"


def law_candidates(without=()):
    """Candidates of all laws but those in ``without``."""
    result = []
    for name, (law_index, meaning, bounds) in LAWS.items():
        if name not in without:
            parameter = Parameter("amount", "-", 0.0, bounds, meaning, SOURCE)
            starts = ((0.05,), (0.5 if bounds[0] < 0.0 else 0.2,))
            result.append(
                Candidate.of(name, (parameter,), lambda psi, n=name, k=law_index: LawTerm(n, k, psi["amount"]), starts,
                             frame="amplitude", component="oscillator")
            )  # fmt: skip
    return tuple(result)


N_STORED = 64  # simulated motions of one record each
# Stiffness and damping of any form: even and odd powers, which together follow any law of the state.
FREE_LAWS = ("absolute_quadratic_spring", "cubic_spring", "quadratic_spring", "dry_friction", "quadratic_drag",
             "state_damping")  # fmt: skip


def free_law_candidates(without=()):
    """The free laws but those in ``without``, with amounts of either sign."""
    result = []
    for name in (n for n in FREE_LAWS if n not in without):
        parameter = Parameter("amount", "-", 0.0, (-3.0, 3.0), "amount of a part of the free law", SOURCE)
        result.append(
            Candidate.of(name, (parameter,), lambda psi, n=name: LawTerm(n, LAWS[n][0], psi["amount"]), ((0.05,),),
                         frame="amplitude", component="oscillator")
        )  # fmt: skip
    return tuple(result)


@njit(cache=True)
def _law_force(law_index, y, v):
    if law_index == CUBIC:
        return y * y * y
    if law_index == QUINTIC:
        return y**5
    if law_index == QUADRATIC:
        return y * y
    if law_index == ABSOLUTE:
        return abs(y) * y
    if law_index == SOFTENING:
        return np.tanh(3.0 * y)
    if law_index == PLAY:
        return -min(max(y, -0.1), 0.1)
    if law_index == FRICTION:
        return 0.1 * np.tanh(v / 0.02)
    if law_index == DRAG:
        return 0.1 * abs(v) * v
    if law_index == CUBIC_DAMPING:
        return 0.1 * v * v * v
    if law_index == STATE_DAMPING:
        return 0.1 * y * y * v
    return 0.0


@njit(cache=True)
def _simulate(force, dt, omega, zeta, gain, law_indices, amounts, scale):
    """Displacement by the classical Runge-Kutta scheme; ``force`` has three values a step (start, middle, end)."""
    out = np.zeros(force.shape[0] + 1)
    y, v = 0.0, 0.0
    ky, kv, strength = np.zeros(4), np.zeros(4), omega * omega * scale * amounts
    inverse_scale, inverse_rate = 1.0 / scale, 1.0 / (omega * scale)
    for n in range(force.shape[0]):
        for stage in range(4):
            fraction = 0.0 if stage == 0 else 0.5 if stage < 3 else 1.0
            ys = y + (fraction * dt * ky[stage - 1] if stage else 0.0)
            vs = v + (fraction * dt * kv[stage - 1] if stage else 0.0)
            f = force[n, 0 if stage == 0 else 1 if stage < 3 else 2]
            acceleration = gain * f - 2.0 * zeta * omega * vs - omega * omega * ys
            for k in range(law_indices.size):
                acceleration -= strength[k] * _law_force(law_indices[k], ys * inverse_scale, vs * inverse_rate)
            ky[stage], kv[stage] = vs, acceleration
        y += dt / 6.0 * (ky[0] + 2.0 * ky[1] + 2.0 * ky[2] + ky[3])
        v += dt / 6.0 * (kv[0] + 2.0 * kv[1] + 2.0 * kv[2] + kv[3])
        if not abs(y) < 100.0 * scale:
            y, v = 0.0, 0.0
        out[n + 1] = y
    return out


class OscillatorCase(Case):
    r"""One degree of freedom driven by a known input, its displacement recorded with an unknown offset.

    .. math:: \ddot y + 2\zeta\omega\dot y + \omega^2 y + \sum_l \omega^2 a_l Y \varphi_l(y/Y, \dot y/(\omega Y)) = g u

    Parameters
    ----------
    records : sequence of (name, condition, input, output)
        One record each, in order of time, from rest. The first ``skipped`` samples are simulated but not compared.
    reserved : sequence of the same
        Used by the verification only.
    rate : float
        Samples per second [Hz].
    frequency, damping, gain : (mean, sd)
        Priors of the linear system; gain is of input to ω² y.
    tolerance : float
        Tolerated error as a share of the rms of each record.
    offset : float
        Prior standard deviation of the offset of the sensor; 0 removes this nuisance parameter.

    Raises
    ------
    ValueError
        If a number is out of its range, a record is incomplete, or no law has a name in ``without``.
    """

    def __init__(self, records, reserved, rate, frequency, damping, gain, tolerance=0.01, offset=0.02, skipped=400,
                 without=(), effective=0.2):  # fmt: skip
        if unknown := sorted(set(without) - set(LAWS)):
            raise ValueError(f"without: no law is called {unknown[0]!r}; there are {', '.join(LAWS)}")
        self.rate, self.skipped, self.effective = rate, skipped, effective
        records, reserved = ([(n, c, *checked_record(n, u, y)) for n, c, u, y in rows] for rows in (records, reserved))
        self.scale = 3.0 * float(np.sqrt(np.mean(np.concatenate([y for *_, y in records]) ** 2)))
        self.inputs = {name: (_step_inputs(u), y) for name, _, u, y in (*records, *reserved)}
        self._motions = {}
        self.observations = tuple(self._observation(*r, tolerance) for r in records)
        self.reserved = tuple(self._observation(*r, tolerance) for r in reserved)
        if not frequency[0] > 0.0:
            raise ValueError(f"the prior mean of the frequency is {frequency[0]:g} Hz; it must be above 0")
        lowest = LOWEST_FREQUENCY * frequency[0]  # at 0 Hz there is no spring, and laws have no scale
        prior_table = [("frequency", "Hz", frequency, (lowest, np.inf)), ("damping", "-", damping, (0.0, 1.0))]
        prior_table += [("gain", "-", gain, (-np.inf, np.inf))]
        prior_table += [("offset", "V", (0.0, offset), (-np.inf, np.inf))] if offset else []
        self.nuisances = tuple(Nuisance(n, u, *prior, bounds=b) for n, u, prior, b in prior_table)
        self.candidates = law_candidates(without)
        self.free_laws = free_law_candidates()

    def _observation(self, name, condition, u, y, tolerance):
        judged = y[self.skipped :]
        if judged.size < 2:
            raise ValueError(f"{name}: {y.size} samples, of which the first {self.skipped} are not compared (skipped)")
        sigma = tolerance * float(np.sqrt(np.mean(judged**2)))
        return Observation(name, condition, judged, sigma, self.effective, covariates={"rms": float(np.std(judged))})

    def predict(self, values, terms, observations):
        """Displacement of every record."""
        omega = 2.0 * np.pi * values["frequency"]
        law_indices = np.array([t.law_index for t in terms], dtype=np.int64)
        amounts = np.array([t.amount for t in terms], dtype=float)
        system = omega, values["damping"], values["gain"] * omega**2
        predictions = []
        for o in observations:
            y = self._motion(o.name, system, law_indices, amounts)
            predictions.append(y[self.skipped : self.skipped + o.data.size] + values.get("offset", 0.0))
        return predictions

    def _motion(self, name, system, law_indices, amounts):
        """Displacement of a record without the offset, which is the same for any offset and simulated once."""
        key = name, *system, law_indices.tobytes(), amounts.tobytes()
        if key not in self._motions:
            if len(self._motions) >= N_STORED:
                self._motions.pop(next(iter(self._motions)))
            force, _ = self.inputs[name]
            self._motions[key] = _simulate(force, 1.0 / self.rate, *system, law_indices, amounts, self.scale)
        return self._motions[key]

    def latent_covariates(self, fit):
        """Missing feedback from the recorded motion: the residual of the equation of motion over ω²."""
        omega, damping = 2.0 * np.pi * fit.values["frequency"], fit.values["damping"]
        segments = []
        for o in self.observations:
            force, y = self.inputs[o.name]
            y = y - fit.values.get("offset", 0.0)
            v, a = _derivatives(y, self.rate)
            missing = fit.values["gain"] * force[:, 0] - a[:-1] / omega**2 - 2.0 * damping * v[:-1] / omega - y[:-1]
            for term in fit.terms:
                u, w = y[:-1] / self.scale, v[:-1] / (omega * self.scale)
                missing = missing - term.amount * self.scale * np.array(
                    [_law_force(term.law_index, p, q) for p, q in zip(u, w)]
                )
            inner = slice(self.skipped, -50)
            segments.append((missing[inner], y[:-1][inner], v[:-1][inner], np.arange(missing.size)[inner] / self.rate))
        force, y, v, t = (np.concatenate(p) for p in zip(*segments))
        return {"force": _band_limited(force, self.rate, 3.2 * fit.values["frequency"]), "unit": "V",
                "displacement": y, "velocity": v, "time": t}  # fmt: skip


def _step_inputs(u):
    """Input at start, middle and end of each step, band-limited between samples, (n - 1, 3)."""
    n = u.size
    spectrum = np.fft.rfft(np.concatenate([u, u[::-1]]))
    middle = np.fft.irfft(spectrum * np.exp(1j * np.pi * np.arange(spectrum.size) / (2 * n)), 2 * n)[: n - 1]
    return np.column_stack([u[:-1], middle, u[1:]])


def _derivatives(y, rate):
    """Velocity and acceleration of a record by Fourier transform of it and its mirror image."""
    n = y.size
    mirrored = np.concatenate([y, y[::-1]])
    omega = 2j * np.pi * np.fft.rfftfreq(2 * n, 1.0 / rate)
    spectrum = np.fft.rfft(mirrored)
    return np.fft.irfft(omega * spectrum, 2 * n)[:n], np.fft.irfft(omega**2 * spectrum, 2 * n)[:n]


def _band_limited(x, rate, cutoff):
    """``x`` below ``cutoff`` [Hz]: above it there is only differentiated noise."""
    spectrum = np.fft.rfft(x)
    frequency = np.fft.rfftfreq(x.size, 1.0 / rate)
    return np.fft.irfft(spectrum / (1.0 + (frequency / cutoff) ** 8), x.size)
