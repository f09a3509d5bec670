r"""Force of a wheel that rolls over a wave, past nodes of different receptance.

A wheel near its resonance on the rail rings on for some metres, so its force has sidebands. By a wave with envelope
:math:`p(x)` and length L the force is :math:`a(x) e^{2 \pi i f_0 t}` with :math:`f_0 = v / L`. Its envelope has
components :math:`\hat a_q` at q per metre:

.. math:: \sum_q C_n(f_0 + v q) e^{2 \pi i q x_n} \hat a_q = -p(x_n), \quad C_n = A_{wheel} + A_{contact} + A_{rail, n}

Here :math:`A_{rail, n}` is the receptance of the rail at node n under a wheel at rest: the speed v is small beside that
of bending waves (docs/decisions/local-rail-properties.md).
"""

from __future__ import annotations

import numpy as np

from turnout.mismatch.turnout.priors import SIMULATION


def force_envelopes(
    compliance: np.ndarray, lines: np.ndarray, envelope: np.ndarray, step: float, speed: float, f0: np.ndarray
) -> np.ndarray:
    """Complex force at the nodes by waves one metre high; a wave and its force are twice the real part.

    The nodes are continued at both ends, so that the ringing of a wheel ends before the period of the components.

    Parameters
    ----------
    compliance : (n_line, n_node) array of complex
        Of wheel, contact and rail, nodes in the direction of the wheel. [m/N]
    lines : (n_line,) array of float
        Frequencies. [Hz]
    envelope : (n_node,) array of float
        Weight of the wave.
    step : float
        Distance between nodes. [m]
    speed : float
        [m/s]
    f0 : (n_wave,) array of float
        Frequencies of the waves. [Hz]

    Returns
    -------
    (n_node, n_wave) array of complex
        [N/m]
    """
    n, n_beyond = envelope.size, int(np.ceil(SIMULATION.ringing_length / step))
    path = step * np.arange(n + 2 * n_beyond)
    compliance = np.pad(compliance, ((0, 0), (n_beyond, n_beyond)), "edge")
    wave = np.pad(-0.5 * envelope, n_beyond, "edge").astype(complex)
    cycles = np.fft.fftfreq(path.size, step)
    components = np.exp(2j * np.pi * path[:, None] * cycles)
    frequency = f0[:, None] + speed * cycles
    nearest = np.clip(np.abs(frequency), lines[0], lines[-1])
    force = np.empty((n, f0.size), dtype=complex)
    for k in range(f0.size):
        c = interpolate(nearest[k], lines, compliance)
        c = np.where(frequency[k, :, None] < 0.0, c.conj(), c)
        force[:, k] = (components @ np.linalg.solve(c.T * components, wave))[n_beyond : n_beyond + n]
    return force


def interpolate(grid: np.ndarray, frequency: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation between lines, along the first axis.

    Parameters
    ----------
    grid : (m,) array of float
        Within ``frequency``. [Hz]
    frequency : (n,) array of float
        Rising. [Hz]
    values : (n, ...) array

    Returns
    -------
    (m, ...) array
    """
    index = np.interp(grid, frequency, np.arange(frequency.size))
    low = np.minimum(index.astype(int), frequency.size - 2)
    fraction = (index - low).reshape(-1, *(1,) * (values.ndim - 1))
    return (1.0 - fraction) * values[low] + fraction * values[low + 1]
