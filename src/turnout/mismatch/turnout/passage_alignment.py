"""Align passages with their simulation: time and speed of the train, and uncertain numbers of the running surface.

The surface needs a search, since linear steps do not converge from afar. A nose that lies 0.3 m further is reached 7 ms
later at 44 m/s: three quarters of a period at 112 Hz, but a fifth at 30 Hz. So the numbers are changed one by one, to
where a few passages correlate best with the simulation below 30 Hz.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.fft import next_fast_len

from turnout.errors import SimulationError
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.campaign import CampaignInput, PassageInput
from turnout.mismatch.turnout.channel_identity import Comparison
from turnout.mismatch.turnout.passage_band import band_signals, limit_band, read_at
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Values
from turnout.mismatch.turnout.priors import ALIGNMENT, SIMULATION
from turnout.mismatch.turnout.running_surface import POSITION_FIELDS, SurfaceParameter
from turnout.records import Recording
from turnout.simulate.blade import is_on_blade
from turnout.simulate.sensor import Sensor


def low_pass(recording: Recording, sensors: Sequence[Sensor]) -> np.ndarray:
    """Signals of the sensors below ``ALIGNMENT.band_end``, every ``ALIGNMENT.sample_step``.

    Parameters
    ----------
    recording : Recording
        The recording.
    sensors : sequence of Sensor
        The sensors.

    Returns
    -------
    (n_sensor, n) array of float
        Signals below the end of the alignment band. [m/s²]
    """
    grid = np.arange(0.0, recording.duration, ALIGNMENT.sample_step)
    return read_at(band_signals(recording, sensors, ALIGNMENT.band_end), recording.rate, grid)


def align(passage: PassageInput, data: np.ndarray, simulated: np.ndarray, rate: float) -> tuple[float, float, float]:
    """Best alignment of a recording with its simulation.

    ``data`` are signals of ``low_pass``. All lags are searched, and speeds within 1.5 % of the recorded one; the
    simulation is stretched in time about the arrival of the first wheel. Roughness and dips have no influence in this
    band.

    If no alignment reaches the least correlation with all sensors, the one that correlates least is left out, where
    three or more are there: its fault is left to the fit. Failing that, samples are clipped at the largest value of the
    simulation. The impacts of a long flat are many times larger than any axle's response.

    Parameters
    ----------
    passage : PassageInput
        The passage.
    data : (n_sensor, n) array of float
        Signals of ``low_pass``.
    simulated : (n_sensor, n_simulated) array of float
        Simulated signals.
    rate : float
        Of the simulated signals. [Hz]

    Returns
    -------
    reference : float
        Time of the first wheel at the first sensor. [s]
    speed : float
        [m/s]
    correlation : float
        Mean over the sensors. [-]
    """
    low = limit_band(simulated, rate, high=ALIGNMENT.band_end)
    best_fit = _best_alignment(data, low, rate)
    if best_fit[0] < ALIGNMENT.min_correlation:
        top = np.max(np.abs(low), axis=1, keepdims=True)
        best_fit = max(best_fit, _best_alignment(np.clip(data, -top, top), low, rate))
    correlation, lag, stretch = best_fit
    return lag * ALIGNMENT.sample_step + SIMULATION.lead_time, passage.speed * (1.0 + stretch), correlation


def _best_alignment(data: np.ndarray, low: np.ndarray, rate: float) -> tuple[float, int, float]:
    """(correlation, lag in steps, stretch) of the best alignment of the simulation ``low`` with ``data``."""
    n_sensor, model_time = len(data), np.arange(0.0, low.shape[-1] / rate, ALIGNMENT.sample_step)
    size = next_fast_len(data.shape[1] + model_time.size, real=True)
    spectrum = np.fft.rfft(data / np.maximum(np.linalg.norm(data, axis=1, keepdims=True), 1e-12), size)

    def products() -> Iterator[tuple[float, np.ndarray]]:
        """(stretch, spectra of the correlation of each sensor)."""
        for stretch in np.linspace(-ALIGNMENT.max_stretch, ALIGNMENT.max_stretch, ALIGNMENT.n_stretches):
            model = read_at(low, rate, SIMULATION.lead_time + (model_time - SIMULATION.lead_time) * (1.0 + stretch))
            model /= np.maximum(np.linalg.norm(model, axis=1, keepdims=True), 1e-12)
            yield float(stretch), spectrum * np.fft.rfft(model, size).conj()

    best_fit = max(_peak(np.fft.irfft(s.sum(axis=0), size) / n_sensor, stretch) for stretch, s in products())
    if best_fit[0] < ALIGNMENT.min_correlation and n_sensor >= 3:
        by_sensor = ((stretch, np.fft.irfft(s, size)) for stretch, s in products())
        best_fit = max(_peak((c.sum(axis=0) - c.min(axis=0)) / (n_sensor - 1), stretch) for stretch, c in by_sensor)
    correlation, k, stretch = best_fit
    return correlation, k if k < size - model_time.size else k - size, stretch


def _peak(score: np.ndarray, stretch: float) -> tuple[float, int, float]:
    """(correlation, lag in steps, stretch) at the largest score."""
    k = int(np.argmax(score))
    return float(score[k]), k, stretch


class PassageAligner:
    """Aligns the passages of a campaign with their simulation by ``predictor``; filtered recordings are cached."""

    def __init__(self, campaign: CampaignInput, predictor: Predictor):
        self.campaign, self.predictor = campaign, predictor
        self._low_passed: dict[str, np.ndarray] = {}
        self._simulated: dict[str, np.ndarray] = {}

    def align(self, values: Values, passage: PassageInput) -> tuple[float, float, float]:
        """``align`` of a passage with its simulation at ``values``; SimulationError if it cannot be simulated.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        passage : PassageInput
            A train passage.

        Returns
        -------
        tuple[float, float, float]
        """
        sensors = self.campaign.sensors_of(passage)
        surfaces = self.predictor.surface.surfaces(passage.route, values)
        simulator = self.predictor.passage_simulator(values, (), passage)
        signals = simulator(passage, passage.vehicle, passage.speed, sensors, surfaces=surfaces)
        if passage.name not in self._low_passed:
            self._low_passed[passage.name] = low_pass(passage.recording, sensors)
        rate = self.predictor.solver.rate
        self._simulated[passage.name] = limit_band(signals, rate, high=ALIGNMENT.band_end)
        return align(passage, self._low_passed[passage.name], signals, rate)

    def comparison(self, passage: PassageInput) -> Comparison | None:
        """Correlation of each channel of a passage with the simulation at each of its sensors, as aligned last.

        Parameters
        ----------
        passage : PassageInput
            A train passage.

        Returns
        -------
        Comparison or None
            None for a passage that could not be simulated.
        """
        if passage.name not in self._simulated:
            return None
        names = tuple(s.name for s in self.campaign.sensors_of(passage))
        data, low = self._low_passed[passage.name], self._simulated[passage.name]
        model_time = np.arange(0.0, low.shape[-1] / self.predictor.solver.rate, ALIGNMENT.sample_step)
        model = read_at(low, self.predictor.solver.rate, model_time)
        size = next_fast_len(data.shape[1] + model_time.size, real=True)
        norms = [np.maximum(np.linalg.norm(x, axis=1), 1e-12) for x in (data, model)]
        data, model = (x / norm[:, None] for x, norm in zip((data, model), norms))
        spectra = np.fft.rfft(data, size)[:, None] * np.fft.rfft(model, size).conj()
        return Comparison(names, names, np.fft.irfft(spectra, size), norms[0] / norms[1])

    def correlation(self, values: Values, passage: PassageInput) -> float:
        """Correlation of a passage with its simulation, 0 if it cannot be simulated.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        passage : PassageInput
            A train passage.

        Returns
        -------
        float
        """
        try:
            return self.align(values, passage)[2]
        except SimulationError:
            return 0.0


def fit_surface(aligner: PassageAligner, values: Values) -> dict[str, float]:
    """Nuisances of the running surface as a few passages have it.

    Parameters
    ----------
    aligner : PassageAligner
        Its campaign and simulation.
    values : mapping
        All other nuisances.

    Returns
    -------
    dict
        Name -> value; {} where no number is uncertain.
    """
    campaign, surface = aligner.campaign, aligner.predictor.surface
    recorded = [p for p in campaign.passages if campaign.sensors_of(p)]
    recorded = [p for p in recorded if p.name not in campaign.reserved] or recorded
    passages = sorted(recorded, key=lambda p: len(p.vehicle.wheels))[: ALIGNMENT.max_trial_passages]
    priors = {n.name: n for n in surface.nuisances()}
    in_switch = is_on_blade([u.component for u in surface.parameters])
    surface_values = dict.fromkeys(priors, 0.0)
    best_score = _log_posterior(aligner, {**values, **surface_values}, passages) if priors else 0.0
    for refine in (False, True):
        for u in sorted(surface.parameters, key=lambda u: u.field not in POSITION_FIELDS):
            if in_switch and u.field not in POSITION_FIELDS:  # the fit finds depths and lengths of tops as well
                continue
            centre = surface_values
            for step in _trial_steps(u, priors, refine, with_depth=not in_switch):
                moved = {name: float(np.clip(centre[name] + by, *priors[name].bounds)) for name, by in step.items()}
                trial = {**centre, **moved}
                score = _log_posterior(aligner, {**values, **trial}, passages)
                if score > best_score:
                    best_score, surface_values = score, trial
    return surface_values


def _trial_steps(
    u: SurfaceParameter, priors: Mapping[str, Nuisance], refine: bool, with_depth: bool
) -> list[dict[str, float]]:
    """Changes of a number of the surface to be tried, by name.

    A position is first tried with the depth of its nose and with that of a worn one: with the depth of the file, a nose
    that is worn may correlate best far from its position.
    """
    sd = priors[u.name].sd
    if u.field not in POSITION_FIELDS:
        return [{u.name: f * sd * (0.5 if refine else 1.0)} for f in ALIGNMENT.trial_factors]
    if refine:
        fine_steps = range(-ALIGNMENT.n_fine_steps, ALIGNMENT.n_fine_steps + 1)
        return [{u.name: ALIGNMENT.position_step * k / ALIGNMENT.refinement} for k in fine_steps if k]
    step = min(ALIGNMENT.position_step, sd)
    n = int(ALIGNMENT.max_deviation * sd / step)
    depth = f"{u.name.removesuffix(u.field)}depth"
    depths = [{depth: f * priors[depth].sd} for f in (0.0, 1.0)] if with_depth and depth in priors else [{}]
    return [{u.name: step * k, **change} for change in depths for k in range(-n, n + 1) if k or any(change.values())]


def _log_posterior(aligner: PassageAligner, values: Values, passages: Sequence[PassageInput]) -> float:
    """Twice the logarithm of likelihood and prior of numbers of the surface.

    The simulation explains the square of the correlation of each of the ``passages``. The prior is that of the track
    file.
    """
    penalty = sum((values[u.name] / u.nuisance.sd) ** 2 for u in aligner.predictor.surface.parameters)
    return -penalty - ALIGNMENT.effective_samples * sum(
        np.log(1.0 - min(aligner.correlation(values, p), ALIGNMENT.max_correlation) ** 2) for p in passages
    )
