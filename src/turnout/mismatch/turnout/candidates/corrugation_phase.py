r"""Phase and wavelength of corrugation that its level cannot give, from the free waves of the rail.

A line in the sound level has no phase. From 0.25 m on it reaches into the fitted band, where a wrong phase costs, and
the right one gains, tens of nats. With s and S the slope and size of sine and cosine between two positions, as
``RailScan.score`` gives them, and a direction u of phase φ, a wave of amplitude N(A, e²) has the gain

.. math:: L(\varphi, \lambda) = \tfrac12 \frac{(A/e^2 + s^T u)^2}{e^{-2} + u^T S u} - \tfrac12 \frac{A^2}{e^2}
          - \tfrac12 \ln(1 + e^2 u^T S u)

The best phase is the start of the joint fit, and its penalty is

.. math:: \max_\varphi F - \ln \overline{e^F}, \quad F(\varphi) = \ln \int p(\lambda) e^{L} d\lambda

It is 0 where the band contains nothing of the wave.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout import physics
from turnout.mismatch.turnout.defect_priors import CORRUGATION, GEOMETRY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.mismatch.turnout.candidates.rail_defects import RailScan


@dataclass(frozen=True)
class WaveInBand:
    """Where a joint fit of corrugation starts.

    ``start`` [m] is the position at which its sine begins, ``amplitude`` [m] and ``wavelength`` [m] its size there.
    ``wavelength_error`` [m] is the root mean square distance of all probable wavelengths from it: a joint fit sees only
    those beside it, and several are often as probable.
    ``gain`` [nats] is that in the fitted band, ``evidence`` [nats] the mean over all phases, wavelengths and
    amplitudes, and ``penalty`` [nats] that of the search for the phase. ``nuisances`` are the amplitudes of the free
    waves beside it.
    """

    start: float
    amplitude: float
    wavelength: float
    wavelength_error: float
    gain: float
    evidence: float
    penalty: float
    nuisances: Mapping[str, float]


def wave_in_band(
    scan: RailScan, stretch: tuple[float, float], wavelength: tuple[float, float], amplitude: tuple[float, float]
) -> WaveInBand:
    """The likeliest phase and wavelength of corrugation on a stretch, at both ends of which it fades.

    Parameters
    ----------
    scan : RailScan
        Scores of shapes of the running surface.
    stretch : (float, float)
        Its start and end. [m]
    wavelength, amplitude : (float, float)
        Mean and standard deviation of the prior. [m]

    Returns
    -------
    WaveInBand
    """
    (start, end), (length, length_sd), (size, size_sd) = stretch, wavelength, amplitude
    step = CORRUGATION.phase_step * length**2 / (2.0 * np.pi * (end - start))  # the phase at the end moves by so much
    steps = step * np.arange(-np.floor(2.0 * length_sd / step), np.floor(2.0 * length_sd / step) + 1.0)
    phases = np.linspace(-np.pi, np.pi, int(np.ceil(2.0 * np.pi / CORRUGATION.phase_step)), endpoint=False)
    log_prior = -0.5 * (steps / length_sd) ** 2
    log_prior -= scipy.special.logsumexp(log_prior)
    directions = np.column_stack([np.cos(phases), np.sin(phases)])
    unit_height = GEOMETRY.unit_waves[0][0]
    slopes, sizes = np.zeros((2, steps.size, phases.size))
    for k, step_k in enumerate(steps):
        waves = np.array([_path(scan, start, end, *unit, length + step_k) for unit in GEOMETRY.unit_waves])
        slope, square = scan.score(waves)
        slopes[k] = directions @ slope / unit_height
        sizes[k] = np.maximum(np.einsum("pi,ij,pj->p", directions, square, directions), 0.0) / unit_height**2
    precision = 1.0 / size_sd**2 + sizes
    likeliest = np.maximum((size / size_sd**2 + slopes) / precision, 0.0)
    evidence = (
        0.5 * precision * likeliest**2 - 0.5 * (size / size_sd) ** 2 - 0.5 * np.log(precision * size_sd**2)
    ) + log_prior[:, None]
    by_phase = scipy.special.logsumexp(evidence, axis=0)
    mean = float(scipy.special.logsumexp(by_phase) - np.log(phases.size))
    j = int(np.argmax(by_phase))
    k = int(np.argmax(evidence[:, j]))
    a = float(likeliest[k, j])
    by_wavelength = scipy.special.softmax(scipy.special.logsumexp(evidence, axis=1))
    sine, cosine = a * directions[j]
    nuisances = scan.waves_without(_path(scan, start, end, sine, cosine, length + steps[k]))
    return WaveInBand(
        start - float(phases[j] / (2.0 * np.pi) * (length + steps[k])),
        a,
        float(length + steps[k]),
        float(np.sqrt(by_wavelength @ (steps - steps[k]) ** 2)),
        float(a * slopes[k, j] - 0.5 * a**2 * sizes[k, j]),
        mean,
        float(by_phase[j]) - mean,
        nuisances,
    )


def _path(scan: RailScan, start: float, end: float, sine: float, cosine: float, wavelength: float) -> np.ndarray:
    waves = physics.RailCorrugation(start, end, sine, cosine, wavelength, 0.5 * (end - start)).paths(None, None)
    return sum((wave(scan.x) for wave in waves), np.zeros(scan.x.size))
