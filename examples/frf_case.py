"""Measured frequency responses and a modal model as a case for the diagnosis.

The model has too few modes, or modes tied to a beam model that is too simple.
"""

from dataclasses import dataclass, field

import numpy as np

from turnout.mismatch import Candidate, Case, Nuisance, Observation
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.physics import Parameter

SOURCE = "Ewins 2000, Modal Testing, chapters 2 and 4"
MAX_STEP = 0.7  # largest step [prior sd]: a longer one jumps from one sharp resonance to the next
TOLERANCE = 0.05  # tolerated error as a share of the response, averaged over a tenth of an octave
INDEPENDENT_SHARE = 0.25  # effective share of independent lines: errors of neighbouring lines are correlated
SUSPENSION_FREQUENCY = 25.0  # approximate resonance of the rigid body on its suspension [Hz]
N_STORED = 64  # lines of unit resonances kept for predictions that only differ in shapes and gains
LAMBDA = np.array([4.73004, 7.85320, 10.99561, 14.13717, 17.27876, 20.42035, 23.56194])  # free-free beam


@dataclass(frozen=True)
class Effect:
    """An effect that the model lacks: a key of ``EFFECT_TEXTS``, ``where`` it is, and parameter ``values`` by name."""

    effect_type: str
    where: str
    values: dict = field(hash=False)

    def sentence(self):
        """The effect in words."""
        numbers = ", ".join(f"{k} {v:.4g}" for k, v in self.values.items() if not k.startswith("shape"))
        return f"{EFFECT_TEXTS[self.effect_type]} {self.where}: {numbers}".replace(" :", ":")


EFFECT_TEXTS = {
    "mode": "a resonance that the model lacks, near",
    "sensor_gain": "another sensitivity of sensor",
    "impact_gain": "another sensitivity of the hammer in",
    "sensor_delay": "a delay of sensor",
    "mount_resonance": "a resonance of the mounting of sensor",
    "structural_damping": "damping by a loss factor instead of a dashpot",
    "shear_and_rotation": "the beam's shear and rotatory inertia",
    "point_mass": "a mass at one place of the beam and at its mirror image",
    "tension": "an axial force",
    "suspension": "springs that hold the beam",
}


def _parameter(name, unit, low, high, prior, neutral=0.0, meaning=""):
    return Parameter(name, unit, neutral, (low, high), meaning or name.replace("_", " "), SOURCE, prior)


class FrfCase(Case):
    """Accelerance (n_impact, n_sensor, n_line) [m/s²/N].

    ``impact_places`` holds the index of the place of each impact; places 0 to n - 1 are those of the sensors. By
    default impact k is at sensor k. ``peaks`` [Hz] are resonances of the base model, with unit modal mass, estimated
    from the responses. ``rigid`` (2 at most) further ones are the rigid body on its soft suspension. With ``beam`` the
    peaks are tied to a free Euler-Bernoulli beam, of which only the first frequency is fitted. ``reserved`` impacts are
    used by the verification only.
    """

    is_large = True

    def __init__(
        self, frequency, h, band, peaks, reserved=(), rigid=0, beam=False, without=(), step=3, impact_places=None
    ):
        inside = np.flatnonzero((frequency >= band[0]) & (frequency <= band[1]))[::step]
        self.frequency, self.h, self.beam = frequency[inside], h[:, :, inside], beam
        self.all_lines, self.n_sensor, self.n_mode, self.rigid = (frequency, h), h.shape[1], len(peaks), rigid
        self.impact_places = np.arange(h.shape[0]) if impact_places is None else np.asarray(impact_places)
        self.n_place = max(h.shape[1], int(self.impact_places.max()) + 1)
        observations = [self._observation(k) for k in range(h.shape[0])]
        self.observations = tuple(o for k, o in enumerate(observations) if k not in reserved)
        self.reserved = tuple(observations[k] for k in reserved)
        self.nuisances = tuple(self._nuisances(peaks))
        self.candidates = tuple(c for c in self._candidates() if c.family not in without)
        self._stored_lines = {}

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
        labels |= {"condition": np.full(self.n_sensor * n, f"impact {k + 1}", dtype=object)}
        name = f"impact {k + 1}"
        return Observation(name, name, split_complex(rows), sigma, INDEPENDENT_SHARE, "response",
                           {}, cells, labels)  # fmt: skip

    def _nuisances(self, peaks):
        for r, peak in enumerate(peaks):
            f, zeta, shape = self.read_off(peak)
            if r == 0 or not self.beam:
                yield Nuisance(f"log_frequency_{r}", "ln(Hz)", float(np.log(f)), 0.01, max_step_sd=MAX_STEP)
            yield Nuisance(f"log_damping_{r}", "ln", float(np.log(zeta)), 0.5, max_step_sd=MAX_STEP)
            widest = float(np.max(np.abs(shape)))
            for s, value in enumerate(shape):
                yield Nuisance(f"shape_{r}_{s}", "kg^-1/2", float(value), 0.3 * widest, max_step_sd=2.0, can_mask=False)
        for r in range(self.rigid):
            yield Nuisance(
                f"log_frequency_rigid{r}", "ln(Hz)", float(np.log(SUSPENSION_FREQUENCY)), 0.4, max_step_sd=MAX_STEP
            )
            shape = self.stiff_shape(r)
            widest = float(np.max(np.abs(shape)))
            for s, value in enumerate(shape):
                yield Nuisance(f"shape_rigid{r}_{s}", "kg^-1/2", value, 0.5 * widest, max_step_sd=2.0, can_mask=False)
        for o in (*self.observations, *self.reserved):
            yield Nuisance(f"hammer@{o.name}", "-", 0.0, 0.05, o.name, (-0.2, 0.2), max_step_sd=MAX_STEP)
            yield Nuisance(f"stretch@{o.name}", "-", 0.0, 5e-4, o.name, max_step_sd=MAX_STEP)

    def read_off(self, about, share=1.0 / 6.0):
        """(frequency, damping ratio, shape (n_place,)) of the highest line within ``share`` octaves of ``about``."""
        frequency, h = self.all_lines
        near = np.flatnonzero(np.abs(np.log2(frequency / about)) < share)
        size = np.sum(np.abs(h[:, :, near]) ** 2, axis=(0, 1))
        top = near[int(np.argmax(size))]
        half = near[size > 0.5 * size.max()]
        zeta = float(np.clip((frequency[half[-1]] - frequency[half[0]] + 0.5) / (2.0 * frequency[top]), 5e-4, 0.03))
        return float(frequency[top]), zeta, self._shape(np.imag(h[:, :, top]), 0) * np.sqrt(2.0 * zeta)

    def _shape(self, matrix, rank):
        """(n_place,) shape whose products give the ``rank``-th term of a real (n_impact, n_sensor) matrix."""
        left_vectors, size, right_vectors = np.linalg.svd(matrix)
        impact_shape, sensor_shape = (
            left_vectors[:, rank] * np.sqrt(size[rank]),
            right_vectors[rank] * np.sqrt(size[rank]),
        )
        is_shared = self.impact_places < self.n_sensor
        sign = -1.0 if impact_shape[is_shared] @ sensor_shape[self.impact_places[is_shared]] < 0.0 else 1.0
        total, count = np.zeros(self.n_place), np.zeros(self.n_place)
        total[: self.n_sensor] += sensor_shape
        count[: self.n_sensor] += 1.0
        np.add.at(total, self.impact_places, sign * impact_shape)
        np.add.at(count, self.impact_places, 1.0)
        return total / np.maximum(count, 1.0)

    def stiff_shape(self, rank):
        """(n_place,) shape of the rigid body, between its suspension and the first resonance."""
        frequency, h = self.all_lines
        near = (frequency > 2.0 * SUSPENSION_FREQUENCY) & (frequency < 3.0 * SUSPENSION_FREQUENCY)
        return self._shape(np.mean(h[:, :, near].real, axis=2), rank)

    def is_hammer_test(self, observation):
        """True for all observations: their derivatives are computed again at every step."""
        return True

    def _candidates(self):
        all_frequencies = self.all_lines[0]
        low, high = (
            max(0.25 * self.frequency[0], all_frequencies[0]),
            min(4.0 * self.frequency[-1], all_frequencies[-1]),
        )
        frequencies = [low * 2.0 ** (k / 2.0) for k in range(int(2.0 * np.log2(high / low)) + 1)]
        peaks = {}
        for about in frequencies:
            f, zeta, shape = self.read_off(about, 0.25)
            peaks.setdefault(round(f), (f, zeta, shape))
        for f, zeta, shape in peaks.values():
            yield self._mode(f, zeta, shape, len(peaks))
        for s in range(self.n_sensor):
            name = f"A{s + 1}"
            yield _single_candidate(
                "sensor_gain", name, [_parameter("gain", "-", -0.6, 1.0, (0.0, 0.3))], ((0.2,), (-0.2,)), self
            )
            yield _single_candidate(
                "sensor_delay", name, [_parameter("delay", "s", -1e-3, 1e-3, (0.0, 2e-4))], ((5e-5,),), self
            )
            period = _parameter("period", "s", 0.0, 2e-3, (2e-4, 3e-4))
            yield _single_candidate("mount_resonance", name, [period], ((2e-4,), (5e-4,)), self)
        for o in self.observations:
            gain = _parameter("gain", "-", -0.95, 3.0, (0.0, 0.5))
            where, n = {"blow": o.name}, len(self.observations)
            yield Candidate.of("impact_gain", (gain,), lambda p, w=o.name: Effect("impact_gain", w, dict(p)),
                               ((-0.5,), (0.5,)), where, "condition", n)  # fmt: skip
        yield _single_candidate(
            "structural_damping", "", [_parameter("share", "-", 0.0, 1.0, (0.5, 0.5))], ((0.5,),), self
        )
        if self.beam:
            slender = [_parameter("slenderness", "-", 0.0, 2e-3, (3e-4, 5e-4))]
            yield _single_candidate("shear_and_rotation", "", slender, ((2e-5,), (1e-4,), (3e-4,)), self)
            mass = [
                _parameter("share", "-", 0.0, 0.5, (0.05, 0.1)),
                _parameter("place", "-", 0.0, 0.5, (0.25, 0.2), 0.25),
            ]
            yield _single_candidate(
                "point_mass", "", mass, ((0.05, 0.03), (0.05, 0.22), (0.05, 0.36), (0.05, 0.5)), self
            )
            yield _single_candidate(
                "tension", "", [_parameter("tension", "-", -5.0, 5.0, (0.0, 2.0))], ((1.0,), (-1.0,)), self
            )
            yield _single_candidate(
                "suspension", "", [_parameter("stiffness", "-", 0.0, 0.3, (0.03, 0.05))], ((0.03,),), self
            )

    def _mode(self, f, zeta, shape, scanned):
        parameters = [
            _parameter("log_frequency", "ln(Hz)", np.log(f) - 0.3, np.log(f) + 0.3, (np.log(f), 0.1), np.log(f))
        ]
        parameters.append(_parameter("log_damping", "ln", -8.0, -1.5, (-5.5, 1.0), np.log(zeta)))
        widest = 3.0 * float(np.max(np.abs(shape))) + 0.1
        parameters += [
            _parameter(f"shape_{s}", "kg^-1/2", -widest, widest, (0.0, widest / 3.0)) for s in range(self.n_place)
        ]
        start = (float(np.log(f)), float(np.clip(np.log(zeta), -7.9, -1.6)), *map(float, shape))
        where = f"{f:.0f} Hz"
        return Candidate.of(
            "mode", parameters, lambda p: Effect("mode", where, dict(p)), (start,), {"near": where}, "frequency",
            scanned, exact=True,
        )  # fmt: skip

    def frequencies(self, values, terms):
        """(n_mode,) natural frequencies [Hz]."""
        if not self.beam:
            return np.exp([values[f"log_frequency_{r}"] for r in range(self.n_mode)])
        lam = LAMBDA[: self.n_mode]
        square = lam**4
        for t in terms:
            v = t.values
            if t.effect_type == "shear_and_rotation":
                square = square / (1.0 + v["slenderness"] * lam**2)
            elif t.effect_type == "point_mass":
                square = square / (1.0 + v["share"] * free_shape(lam, v["place"]) ** 2)
            elif t.effect_type == "tension":
                square = square * (1.0 + v["tension"] / lam**2)
            elif t.effect_type == "suspension":
                square = square + v["stiffness"] * LAMBDA[0] ** 4
        return np.exp(values["log_frequency_0"]) * np.sqrt(square / square[0])

    def predict(self, values, terms, observations):
        """Accelerance of each impact, real parts followed by imaginary parts."""
        frequencies, damping, shapes, loss = self._modes(values, terms)
        predictions = []
        for o in observations:
            place, stretch, gain = self._impact(values, terms, o)
            lines = self._resonance_lines(frequencies * stretch, damping, loss)
            rows = (shapes[:, : self.n_sensor] * shapes[:, place, None]).T @ lines
            predictions.append(split_complex(gain * self._through_sensors(rows, terms)))
        return predictions

    def nuisance_jacobian(self, values, terms, observations, base):
        """The difference quotients of ``Case``, but only what depends on a nuisance is computed for it."""
        frequencies, damping, shapes, loss = self._modes(values, terms)
        measured, numbers = shapes[:, : self.n_sensor], {n.name: k for k, n in enumerate(self.nuisances)}
        steps = {n.name: THRESHOLDS.nuisance_step * n.sd for n in self.nuisances}
        modes = [(r, str(r)) for r in range(self.n_mode)]
        modes += [(self.n_mode + r, f"rigid{r}") for r in range(self.rigid)]
        jacobians = []
        for o in observations:
            place, stretch, gain = self._impact(values, terms, o)
            all_lines = self._resonance_lines(frequencies * stretch, damping, loss)
            through = gain * self._through_sensors(np.ones((self.n_sensor, self.frequency.size), complex), terms)
            jacobian = np.zeros((o.data.size, len(self.nuisances)), order="F")

            def put(name, rows, s=slice(None), jacobian=jacobian, through=through):
                change, column = through[s] * rows, jacobian[:, numbers[name]].reshape(2, *through.shape)
                column[0, s] += change.real / steps[name]
                column[1, s] += change.imag / steps[name]

            for k, label in modes:
                f, zeta, lines, both = frequencies[k], damping[k], all_lines[k], measured[k, :, None] * shapes[k, place]
                name = "log_frequency_0" if self.beam and k < self.n_mode else f"log_frequency_{label}"
                put(name, both * (self._lines(f * stretch * np.exp(steps[name]), zeta, loss) - lines))
                if k < self.n_mode:  # that of the rigid body is given
                    name = f"log_damping_{label}"
                    put(name, both * (self._lines(f * stretch, zeta * np.exp(steps[name]), loss) - lines))
                for s in {*range(self.n_sensor), place}:
                    moved = shapes[k].copy()
                    moved[s] += steps[f"shape_{label}_{s}"]
                    change = moved[: self.n_sensor] * moved[place] - measured[k] * shapes[k, place]
                    changed = slice(None) if s == place else s
                    put(f"shape_{label}_{s}", change[changed, None] * lines, changed)
            product = (measured * shapes[:, place, None]).T
            put(f"hammer@{o.name}", product @ all_lines * (steps[f"hammer@{o.name}"] / gain))
            stretched = self._lines(frequencies * (stretch + steps[f"stretch@{o.name}"]), damping, loss)
            put(f"stretch@{o.name}", product @ (stretched - all_lines))
            jacobians.append(jacobian)
        return jacobians

    def _modes(self, values, terms):
        """(frequencies [Hz], damping ratios, (n_mode, n_place) shapes, share of structural damping) of all modes."""
        modes = [
            (f, np.exp(values[f"log_damping_{r}"]), [values[f"shape_{r}_{s}"] for s in range(self.n_place)])
            for r, f in enumerate(self.frequencies(values, terms))
        ]
        for r in range(self.rigid):
            shape = [values[f"shape_rigid{r}_{s}"] for s in range(self.n_place)]
            modes.append((np.exp(values[f"log_frequency_rigid{r}"]), 0.05, shape))
        for t in terms:
            if t.effect_type == "mode":
                v, shape = t.values, [t.values[f"shape_{s}"] for s in range(self.n_place)]
                modes.append((np.exp(v["log_frequency"]), np.exp(v["log_damping"]), shape))
        loss = sum(t.values["share"] for t in terms if t.effect_type == "structural_damping")
        frequencies, damping = (np.array([mode[i] for mode in modes])[:, None] for i in (0, 1))
        return frequencies, damping, np.array([shape for _, _, shape in modes]), loss

    def _impact(self, values, terms, observation):
        """(place, factor on all frequencies, gain) of an impact."""
        name = observation.name
        gain = 1.0 + values[f"hammer@{name}"]
        gain += sum(t.values["gain"] for t in terms if t.effect_type == "impact_gain" and t.where == name)
        return self.impact_places[int(name.split()[1]) - 1], 1.0 + values[f"stretch@{name}"], gain

    def _resonance_lines(self, frequencies, damping, loss):
        """(n_mode, n_line) accelerance of each mode with unit shape; ``loss`` is the share of structural damping."""
        key = frequencies.tobytes(), damping.tobytes(), loss
        if key not in self._stored_lines:
            if len(self._stored_lines) >= N_STORED:
                self._stored_lines.clear()
            self._stored_lines[key] = self._lines(frequencies, damping, loss)
        return self._stored_lines[key]

    def _lines(self, frequencies, damping, loss):
        x = self.frequency / frequencies
        square = x**2
        return square / (square - 1.0 - 2j * damping * (1.0 - loss) * x - 2j * damping * loss)

    def _through_sensors(self, rows, terms):
        rows, f = rows.copy(), self.frequency
        for t in terms:
            if t.effect_type.startswith("sensor_") or t.effect_type == "mount_resonance":
                s, v = int(t.where[1:]) - 1, t.values
                if t.effect_type == "sensor_gain":
                    rows[s] *= 1.0 + v["gain"]
                elif t.effect_type == "sensor_delay":
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


def _single_candidate(effect_type, where, parameters, starts, case):
    scanned = case.n_sensor if where else 1
    labels = {"sensor": where} if where else {}
    frame = "sensor" if where else "frequency"
    return Candidate.of(
        effect_type, tuple(parameters), lambda p: Effect(effect_type, where, dict(p)), starts, labels, frame, scanned
    )


def split_complex(rows):
    """Real parts followed by imaginary parts of (n_sensor, n_line), flat."""
    return np.concatenate([rows.real.ravel(), rows.imag.ravel()])
