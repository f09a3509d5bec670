"""Measured frequency responses and a modal model as a case for the diagnosis.

The model has too few modes, or modes tied to a beam model that is too simple.
"""

from dataclasses import dataclass, field

import numpy as np

from turnout.mismatch import Candidate, Case, Nuisance, Observation
from turnout.physics import Parameter

SOURCE = "Ewins 2000, Modal Testing, chapters 2 and 4"
STEP = 0.7  # largest step [prior sd]: a longer one jumps from one sharp resonance to the next
TOLERANCE = 0.05  # tolerated error as a share of the response, averaged over a tenth of an octave
INDEPENDENT = 0.25  # effective share of independent lines: errors of neighbouring lines are correlated
SOFT = 25.0  # approximate resonance of the rigid body on its suspension [Hz]
LAMBDA = np.array([4.73004, 7.85320, 10.99561, 14.13717, 17.27876, 20.42035, 23.56194])  # free-free beam


@dataclass(frozen=True)
class Effect:
    """An effect that the model lacks: a key of ``EFFECT_TEXTS``, ``where`` it is, and parameter ``values`` by name."""

    kind: str
    where: str
    values: dict = field(hash=False)

    def sentence(self):
        """The effect in words."""
        numbers = ", ".join(f"{k} {v:.4g}" for k, v in self.values.items() if not k.startswith("shape"))
        return f"{KINDS[self.kind]} {self.where}: {numbers}".replace(" :", ":")


KINDS = {
    "mode": "a resonance that the model lacks, near",
    "sensor_gain": "another sensitivity of sensor",
    "blow_gain": "another sensitivity of the hammer in",
    "sensor_delay": "a delay of sensor",
    "mount_resonance": "a resonance of the mounting of sensor",
    "structural_damping": "damping by a loss factor instead of a dashpot",
    "shear_and_rotation": "the beam's shear and rotatory inertia",
    "point_mass": "a mass at one place of the beam and at its mirror image",
    "tension": "an axial force",
    "suspension": "springs that hold the beam",
}


def _number(name, unit, low, high, prior, neutral=0.0, meaning=""):
    return Parameter(name, unit, neutral, (low, high), meaning or name.replace("_", " "), SOURCE, prior)


class FrfCase(Case):
    """Accelerance (n_impact, n_sensor, n_line) [m/s²/N].

    ``impact_places`` holds the index of the place of each impact; places 0 to n - 1 are those of the sensors. By
    default impact k is at sensor k. ``peaks`` [Hz] are resonances of the base model, with unit modal mass, estimated
    from the responses. ``rigid`` (2 at most) further ones are the rigid body on its soft suspension. With ``beam`` the
    peaks are tied to a free Euler-Bernoulli beam, of which only the first frequency is fitted. ``reserved`` impacts are
    used by the verification only.
    """

    expensive = True

    def __init__(self, frequency, h, band, peaks, reserved=(), rigid=0, beam=False, without=(), step=3, blown=None):
        inside = np.flatnonzero((frequency >= band[0]) & (frequency <= band[1]))[::step]
        self.frequency, self.h, self.beam = frequency[inside], h[:, :, inside], beam
        self.whole, self.n_sensor, self.n_mode, self.rigid = (frequency, h), h.shape[1], len(peaks), rigid
        self.blown = np.arange(h.shape[0]) if blown is None else np.asarray(blown)
        self.n_place = max(h.shape[1], int(self.blown.max()) + 1)
        made = [self._observation(k) for k in range(h.shape[0])]
        self.observations = tuple(o for k, o in enumerate(made) if k not in reserved)
        self.reserved = tuple(made[k] for k in reserved)
        self.nuisances = tuple(self._nuisances(peaks))
        self.candidates = tuple(c for c in self._candidates() if c.family not in without)

    def _observation(self, k):
        rows, octave = self.h[k], np.log2(self.frequency)
        near = np.exp(-0.5 * ((octave[:, None] - octave) / 0.05) ** 2)
        local = np.sqrt((np.abs(rows) ** 2) @ near / near.sum(axis=0))
        sigma = TOLERANCE * np.tile((local + 0.1 * np.median(local)).ravel(), 2)
        band = np.floor(3.0 * (octave - octave[0])).astype(int)
        n = int(band.max()) + 1
        cells = np.tile((np.arange(self.n_sensor)[:, None] * n + band).ravel(), 2)
        centre = self.frequency[0] * 2.0 ** ((np.arange(n) + 0.5) / 3.0)
        labels = {"sensor": np.repeat([f"A{s + 1}" for s in range(self.n_sensor)], n).astype(object)}
        labels |= {"frequency": np.tile([f"{c:.0f} Hz" for c in centre], self.n_sensor).astype(object)}
        labels |= {"condition": np.full(self.n_sensor * n, f"blow {k + 1}", dtype=object)}
        return Observation(f"blow {k + 1}", f"blow {k + 1}", split(rows), sigma, INDEPENDENT, "response",
                           {}, cells, labels)  # fmt: skip

    def _nuisances(self, peaks):
        for r, peak in enumerate(peaks):
            f, zeta, shape = self.read_off(peak)
            if r == 0 or not self.beam:
                yield Nuisance(f"log_frequency_{r}", "ln(Hz)", float(np.log(f)), 0.01, max_step_sd=STEP)
            yield Nuisance(f"log_damping_{r}", "ln", float(np.log(zeta)), 0.5, max_step_sd=STEP)
            widest = float(np.max(np.abs(shape)))
            for s, value in enumerate(shape):
                yield Nuisance(f"shape_{r}_{s}", "kg^-1/2", float(value), 0.3 * widest, max_step_sd=2.0, can_mask=False)
        for r in range(self.rigid):
            yield Nuisance(f"log_frequency_rigid{r}", "ln(Hz)", float(np.log(SOFT)), 0.4, max_step_sd=STEP)
            shape = self.stiff_shape(r)
            widest = float(np.max(np.abs(shape)))
            for s, value in enumerate(shape):
                yield Nuisance(f"shape_rigid{r}_{s}", "kg^-1/2", value, 0.5 * widest, max_step_sd=2.0, can_mask=False)
        for o in (*self.observations, *self.reserved):
            yield Nuisance(f"hammer@{o.name}", "-", 0.0, 0.05, o.name, (-0.2, 0.2), max_step_sd=STEP)
            yield Nuisance(f"stretch@{o.name}", "-", 0.0, 5e-4, o.name, max_step_sd=STEP)

    def read_off(self, about, share=1.0 / 6.0):
        """(frequency, damping ratio, shape (n_place,)) of the highest line within ``share`` octaves of ``about``."""
        frequency, h = self.whole
        near = np.flatnonzero(np.abs(np.log2(frequency / about)) < share)
        size = np.sum(np.abs(h[:, :, near]) ** 2, axis=(0, 1))
        top = near[int(np.argmax(size))]
        half = near[size > 0.5 * size.max()]
        zeta = float(np.clip((frequency[half[-1]] - frequency[half[0]] + 0.5) / (2.0 * frequency[top]), 5e-4, 0.03))
        return float(frequency[top]), zeta, self._shape(np.imag(h[:, :, top]), 0) * np.sqrt(2.0 * zeta)

    def _shape(self, matrix, rank):
        """(n_place,) shape whose products give the ``rank``-th term of a real (n_impact, n_sensor) matrix."""
        left, size, right = np.linalg.svd(matrix)
        blown, heard = left[:, rank] * np.sqrt(size[rank]), right[rank] * np.sqrt(size[rank])
        both = self.blown < self.n_sensor
        sign = -1.0 if blown[both] @ heard[self.blown[both]] < 0.0 else 1.0
        total, count = np.zeros(self.n_place), np.zeros(self.n_place)
        total[: self.n_sensor] += heard
        count[: self.n_sensor] += 1.0
        np.add.at(total, self.blown, sign * blown)
        np.add.at(count, self.blown, 1.0)
        return total / np.maximum(count, 1.0)

    def stiff_shape(self, rank):
        """(n_place,) shape of the rigid body, between its suspension and the first resonance."""
        frequency, h = self.whole
        near = (frequency > 2.0 * SOFT) & (frequency < 3.0 * SOFT)
        return self._shape(np.mean(h[:, :, near].real, axis=2), rank)

    def is_cheap(self, observation):
        """True for all observations: their derivatives are computed again at every step."""
        return True

    def _candidates(self):
        whole = self.whole[0]
        low, high = max(0.25 * self.frequency[0], whole[0]), min(4.0 * self.frequency[-1], whole[-1])
        places = [low * 2.0 ** (k / 2.0) for k in range(int(2.0 * np.log2(high / low)) + 1)]
        seen = {}
        for about in places:
            f, zeta, shape = self.read_off(about, 0.25)
            seen.setdefault(round(f), (f, zeta, shape))
        for f, zeta, shape in seen.values():
            yield self._mode(f, zeta, shape, len(seen))
        for s in range(self.n_sensor):
            name = f"A{s + 1}"
            yield _one("sensor_gain", name, [_number("gain", "-", -0.6, 1.0, (0.0, 0.3))], ((0.2,), (-0.2,)), self)
            yield _one("sensor_delay", name, [_number("delay", "s", -1e-3, 1e-3, (0.0, 2e-4))], ((5e-5,),), self)
            period = _number("period", "s", 0.0, 2e-3, (2e-4, 3e-4))
            yield _one("mount_resonance", name, [period], ((2e-4,), (5e-4,)), self)
        for o in self.observations:
            gain = _number("gain", "-", -0.95, 3.0, (0.0, 0.5))
            where, n = {"blow": o.name}, len(self.observations)
            yield Candidate("blow_gain", (gain,), lambda p, w=o.name: Effect("blow_gain", w, dict(p)),
                            ((-0.5,), (0.5,)), where, "condition", n)  # fmt: skip
        yield _one("structural_damping", "", [_number("share", "-", 0.0, 1.0, (0.5, 0.5))], ((0.5,),), self)
        if self.beam:
            slender = [_number("slenderness", "-", 0.0, 2e-3, (3e-4, 5e-4))]
            yield _one("shear_and_rotation", "", slender, ((2e-5,), (1e-4,), (3e-4,)), self)
            mass = [_number("share", "-", 0.0, 0.5, (0.05, 0.1)), _number("place", "-", 0.0, 0.5, (0.25, 0.2), 0.25)]
            yield _one("point_mass", "", mass, ((0.05, 0.03), (0.05, 0.22), (0.05, 0.36), (0.05, 0.5)), self)
            yield _one("tension", "", [_number("tension", "-", -5.0, 5.0, (0.0, 2.0))], ((1.0,), (-1.0,)), self)
            yield _one("suspension", "", [_number("stiffness", "-", 0.0, 0.3, (0.03, 0.05))], ((0.03,),), self)

    def _mode(self, f, zeta, shape, scanned):
        own = [_number("log_frequency", "ln(Hz)", np.log(f) - 0.3, np.log(f) + 0.3, (np.log(f), 0.1), np.log(f))]
        own.append(_number("log_damping", "ln", -8.0, -1.5, (-5.5, 1.0), np.log(zeta)))
        widest = 3.0 * float(np.max(np.abs(shape))) + 0.1
        own += [_number(f"shape_{s}", "kg^-1/2", -widest, widest, (0.0, widest / 3.0)) for s in range(self.n_place)]
        start = (float(np.log(f)), float(np.clip(np.log(zeta), -7.9, -1.6)), *map(float, shape))
        where = f"{f:.0f} Hz"
        return Candidate("mode", tuple(own), lambda p: Effect("mode", where, dict(p)), (start,), {"near": where},
                         "frequency", scanned, exact=True)  # fmt: skip

    def frequencies(self, values, terms):
        """(n_mode,) natural frequencies [Hz]."""
        if not self.beam:
            return np.exp([values[f"log_frequency_{r}"] for r in range(self.n_mode)])
        lam = LAMBDA[: self.n_mode]
        square = lam**4
        for t in terms:
            v = t.values
            if t.kind == "shear_and_rotation":
                square = square / (1.0 + v["slenderness"] * lam**2)
            elif t.kind == "point_mass":
                square = square / (1.0 + v["share"] * free_shape(lam, v["place"]) ** 2)
            elif t.kind == "tension":
                square = square * (1.0 + v["tension"] / lam**2)
            elif t.kind == "suspension":
                square = square + v["stiffness"] * LAMBDA[0] ** 4
        return np.exp(values["log_frequency_0"]) * np.sqrt(square / square[0])

    def predict(self, values, terms, observations):
        """Accelerance of each impact, real parts followed by imaginary parts."""
        modes = [
            (f, np.exp(values[f"log_damping_{r}"]), [values[f"shape_{r}_{s}"] for s in range(self.n_place)])
            for r, f in enumerate(self.frequencies(values, terms))
        ]
        for r in range(self.rigid):
            shape = [values[f"shape_rigid{r}_{s}"] for s in range(self.n_place)]
            modes.append((np.exp(values[f"log_frequency_rigid{r}"]), 0.05, shape))
        for t in terms:
            if t.kind == "mode":
                v, shape = t.values, [t.values[f"shape_{s}"] for s in range(self.n_place)]
                modes.append((np.exp(v["log_frequency"]), np.exp(v["log_damping"]), shape))
        loss = sum(t.values["share"] for t in terms if t.kind == "structural_damping")
        found = []
        for o in observations:
            k, stretch = int(o.name.split()[1]) - 1, 1.0 + values[f"stretch@{o.name}"]
            rows = np.zeros((self.n_sensor, self.frequency.size), dtype=complex)
            for f, zeta, shape in modes:
                x = self.frequency / (f * stretch)
                line = -(x**2) / (1.0 - x**2 + 2j * zeta * ((1.0 - loss) * x + loss))
                rows += np.outer(np.asarray(shape[: self.n_sensor]) * shape[self.blown[k]], line)
            gain = 1.0 + values[f"hammer@{o.name}"]
            gain += sum(t.values["gain"] for t in terms if t.kind == "blow_gain" and t.where == o.name)
            found.append(split(gain * self._heard(rows, terms)))
        return found

    def _heard(self, rows, terms):
        rows, f = rows.copy(), self.frequency
        for t in terms:
            if t.kind.startswith("sensor_") or t.kind == "mount_resonance":
                s, v = int(t.where[1:]) - 1, t.values
                if t.kind == "sensor_gain":
                    rows[s] *= 1.0 + v["gain"]
                elif t.kind == "sensor_delay":
                    rows[s] *= np.exp(-2j * np.pi * f * v["delay"])
                else:
                    x = f * v["period"]
                    rows[s] /= 1.0 - x**2 + 1j * x / 10.0
        return rows


def free_shape(lam, x):
    """Free-free beam's mode shapes at ``x`` (0 end, 0.5 middle) of its length, unit mean square, (n_mode,)."""
    sigma = (np.cosh(lam) - np.cos(lam)) / (np.sinh(lam) - np.sin(lam))
    # exponentials are combined, since cosh - sigma sinh is a difference of large numbers
    grown = 0.5 * (1.0 - sigma) * np.exp(lam * x) + 0.5 * (1.0 + sigma) * np.exp(-lam * x)
    return grown + np.cos(lam * x) - sigma * np.sin(lam * x)


def _one(kind, where, parameters, starts, case):
    scanned = case.n_sensor if where else 1
    place = {"sensor": where} if where else {}
    frame = "sensor" if where else "frequency"
    return Candidate(kind, tuple(parameters), lambda p: Effect(kind, where, dict(p)), starts, place, frame, scanned)


def split(rows):
    """Real parts followed by imaginary parts of (n_sensor, n_line), flat."""
    return np.concatenate([rows.real.ravel(), rows.imag.ravel()])
