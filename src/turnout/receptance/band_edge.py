"""How far up a hammer's tip excites: where its force spectrum has fallen by 20 dB."""

import numpy as np
from scipy.fft import next_fast_len, rfft


def band_edges(pulses: list[np.ndarray], rate: float, fall: float = 20.0, resolution: float = 5.0) -> np.ndarray:
    r"""Lowest frequency at which each pulse's spectrum lies ``fall`` decibel below its value at 0 Hz.

    Parameters
    ----------
    pulses : list of (n,) arrays
        Force of one contact each. [N]
    rate : float
        [Hz]
    fall : float
        [dB]
    resolution : float
        Spacing of the lines between which the edge is interpolated; n is padded with zeros. [Hz]

    Returns
    -------
    (n_pulse,) array of float
        Half the rate where the spectrum never falls that far. [Hz]

    Examples
    --------
    A half-sine of length T has :math:`|\cos(\pi fT)| / |1 - (2fT)^2|`, which is 0.1 at fT = 1.2976 (the first time,
    on the way to its zero at 1.5).

    >>> T, rate = 2e-3, 50_000.0
    >>> edge = band_edges([np.sin(np.pi * np.arange(101) / 100)], rate)[0]
    >>> print(f"{edge * T:.2f}")
    1.30
    """
    if not pulses:
        return np.empty(0)
    n_fft = next_fast_len(max(int(rate / resolution), *(p.size for p in pulses)), real=True)
    stacked = np.zeros((len(pulses), n_fft))
    for row, pulse in zip(stacked, pulses):
        row[: pulse.size] = pulse
    magnitude = np.abs(rfft(stacked))
    with np.errstate(divide="ignore", invalid="ignore"):
        decibel = 20.0 * np.log10(magnitude / magnitude[:, :1]) + fall
    below = decibel < 0.0
    k = np.where(below.any(axis=1), below.argmax(axis=1), decibel.shape[1])
    edges = np.full(len(pulses), rate / 2)
    for i in np.flatnonzero((k > 0) & (k < decibel.shape[1])):
        here, after = decibel[i, k[i] - 1], decibel[i, k[i]]
        edges[i] = (k[i] - 1 + (here / (here - after) if np.isfinite(after) else 1.0)) * rate / n_fft
    return edges
