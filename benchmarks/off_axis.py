"""Tests with impacts beside the axis of the rail, and the errors of their modes with and without the best subset."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import fftconvolve

from benchmarks.hammer_impacts import CHANNELS, N_SAMPLE, RATE, TIME, TRIGGER, digitise
from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts
from turnout.records import Recording
from turnout.signal.filters import force_pulse
from turnout.stages.hammer import identify_accepted

TRUE = {"ballast": (150.0, 0.12), "railpad": (560.0, 0.05)}  # frequency [Hz], damping ratio
AMPLITUDES = (1.5, 6.0)  # of the ballast and the railpad resonance
MAX_DETUNING = 0.15  # a twist has resonances within this share of those of the bending
N_IMPACT, N_WANTED = 15, 10
N_OFF_AXIS = 5
MAX_ANGLE = 20.0  # degrees; the others within some tenths


@dataclass(frozen=True)
class ModeErrors:
    """Deviation of one mode from the true one: of the frequency [Hz] and of the damping ratio; nan without the mode."""

    seed: int
    band: str
    n_best: int
    frequency: float
    damping: float
    n_used: int


def _decays(modes: tuple[tuple[float, float, float], ...]) -> np.ndarray:
    return sum(
        w * np.exp(-z * 2 * np.pi * f * TIME) * np.sin(2 * np.pi * f * np.sqrt(1 - z**2) * TIME + 0.4)
        for f, z, w in modes
    )


RESPONSE = _decays(tuple((f, z, w) for (f, z), w in zip(TRUE.values(), AMPLITUDES)))


def _twist(rng: np.random.Generator) -> np.ndarray:
    """Impulse response of the twist of one section, (N_SAMPLE,)."""
    modes = [
        (f * (1 + rng.uniform(-MAX_DETUNING, MAX_DETUNING)), rng.uniform(0.03, 0.12), w * rng.uniform(0.5, 1.5))
        for (f, _), w in zip(TRUE.values(), AMPLITUDES)
    ]
    return _decays(tuple(modes))


def recordings_of(seed: int, n_off_axis: int = N_OFF_AXIS) -> list[Recording]:
    """One test: of ``N_IMPACT`` impacts some are beside the axis and excite a twist of the rail as well.

    Parameters
    ----------
    seed : int
        Of forces, angles and noise.
    n_off_axis : int
        Number of impacts beside the axis.

    Returns
    -------
    list of Recording
        One record per impact.
    """
    rng = np.random.default_rng(seed)
    angles = np.abs(rng.normal(0.0, 0.5, N_IMPACT))
    angles[rng.choice(N_IMPACT, n_off_axis, replace=False)] = rng.uniform(5.0, MAX_ANGLE, n_off_axis)
    twist = _twist(rng)
    side = rng.choice([-1.0, 1.0])  # a person stands on one side of the rail
    recordings = []
    for angle in np.radians(angles):
        start = (TRIGGER + rng.uniform()) / RATE
        force = 8_000.0 * rng.normal(1.0, 0.1) * force_pulse("half-sine", TIME - start, 8e-4 * rng.normal(1.0, 0.05))
        response = np.cos(angle) * RESPONSE + side * np.sin(angle) * twist
        acceleration = 1e-2 * fftconvolve(force, response)[:N_SAMPLE]
        samples = np.stack([digitise(force, rng, 0.6, 1e-3), digitise(acceleration, rng, 0.6, 3e-3)])
        recordings.append(Recording(samples, RATE, CHANNELS))
    return recordings


def errors(seed: int, n_best: int, n_off_axis: int = N_OFF_AXIS) -> list[ModeErrors]:
    """Errors of both modes of one test.

    Parameters
    ----------
    seed : int
        Of the test.
    n_best : int
        Setting ``best_impacts``; 0 uses all accepted impacts.
    n_off_axis : int
        Number of impacts beside the axis.

    Returns
    -------
    list of ModeErrors
        One per band.
    """
    settings = replace(ReceptanceSettings(), best_impacts=n_best)
    impacts = find_impacts(recordings_of(seed, n_off_axis), "hammer", "rail", settings)
    impacts, _, model = identify_accepted(impacts, settings, IdentifySettings())
    found = {mode.band: mode for mode in model.modes}
    n_used = sum(i.accepted for i in impacts)
    result = []
    for band, (frequency, damping) in TRUE.items():
        mode = found.get(band)
        deviation = (mode.frequency - frequency, mode.damping - damping) if mode else (np.nan, np.nan)
        result.append(ModeErrors(seed, band, n_best, *deviation, n_used))
    return result


def rms_errors(seeds: range, n_off_axis: int = N_OFF_AXIS) -> dict[tuple[str, str, int], float]:
    """Root mean square of the errors over the tests in which both ways find the mode.

    Parameters
    ----------
    seeds : range
        Of the tests.
    n_off_axis : int
        Number of impacts beside the axis.

    Returns
    -------
    dict of (str, str, int) to float
        (band, "frequency" or "damping", ``best_impacts``) -> error [Hz] or [-].
    """
    found = [e for seed in seeds for n in (0, N_WANTED) for e in errors(seed, n, n_off_axis)]
    lacking = {(e.seed, e.band) for e in found if np.isnan(e.frequency)}
    return {
        (band, name, n): float(
            np.sqrt(
                np.mean(
                    [
                        getattr(e, name) ** 2
                        for e in found
                        if e.band == band and e.n_best == n and (e.seed, band) not in lacking
                    ]
                )
            )
        )
        for band in TRUE
        for name in ("frequency", "damping")
        for n in (0, N_WANTED)
    }
