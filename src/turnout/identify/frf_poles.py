"""Starting poles for a narrow band of frequency responses: the band as a decay, realised at several orders."""

import numpy as np
from scipy.linalg import eigh

ORDERS = range(1, 9)
REAPPEARS = 0.5


def zoomed_poles(frequency, frf, centre: float, width: float, damping_maximum: float) -> np.ndarray:
    r"""Modes near a peak, (n_mode, 2) of ln f and zeta: those that reappear over orders, else the half-power one.

    The lines of the band, transformed back, are a complex decay sampled at the band's width B:
    :math:`h_k \propto \sum_m R_m \exp((s_m - i 2\pi f_0) k / B)`.

    ``frequency`` (n_line,) [Hz], ``frf`` (n_frf, n_line), ``centre`` and half-power ``width`` of the peak [Hz].
    """
    n = len(frequency)
    rate = n * (frequency[1] - frequency[0])
    decay = np.fft.ifft(frf, axis=1)[:, 1 : max(8, (2 * n) // 3)]
    rows = decay.shape[1] // 2
    gram = _gram(decay, rows)
    order = min(max(ORDERS), rows - 1)
    _, u = eigh(gram, subset_by_index=(len(gram) - order, len(gram) - 1))
    u = u[:, ::-1]
    found = []
    for r in ORDERS[:order]:
        z = np.linalg.eigvals(np.linalg.lstsq(u[:-1, :r], u[1:, :r], rcond=None)[0])
        s = np.log(np.maximum(np.abs(z), 1e-12)) + 1j * np.mod(np.angle(z), 2.0 * np.pi)
        s = s * rate + 2j * np.pi * frequency[0]
        zeta = -s.real / np.abs(s)
        keep = (zeta > 0.0) & (zeta < damping_maximum) & (np.abs(s.imag / (2 * np.pi) - centre) < 1.5 * width)
        found += [(r, pole) for pole in s[keep]]
    starts = _reappearing(found, order)
    if not starts:
        starts = [2.0 * np.pi * (-0.5 * width + 1j * centre)]
    s = np.array(starts)
    return np.stack([np.log(np.abs(s) / (2.0 * np.pi)), -s.real / np.abs(s)], axis=1)


def _gram(decay, rows):
    columns = decay.shape[1] - rows
    windows = np.lib.stride_tricks.sliding_window_view(decay, columns, axis=1)
    return np.einsum("iak,ibk->ab", windows, windows.conj(), optimize=True)


def _reappearing(found, n_order):
    """Medians of groups of poles closer than half their decay rate, if seen at half of the orders."""
    starts, left = [], list(found)
    while left:
        groups = [[p for p in left if abs(p[1] - q[1]) < 0.5 * min(-p[1].real, -q[1].real)] for q in left]
        largest = max(groups, key=len)
        orders = {r for r, _ in largest}
        if len(orders) < REAPPEARS * (n_order - min(orders) + 1) or len(orders) < 3:
            break
        poles = np.array([p for _, p in largest])
        starts.append(complex(np.median(poles.real), np.median(poles.imag)))
        left = [p for p in left if p not in largest]
    return starts
