"""Which modes the coherence gate of the receptance lets pass, and their residues from it."""

import numpy as np

from turnout.identify.poles import continuous_pole


def passed_share(receptance, frequency: float, damping: float) -> tuple[float, float]:
    """Share of the lines in the half-power band of a mode that pass the gate, and their lowest gate level.

    The band is f (1 ± zeta), at least the three lines nearest to f. (0, nan) if f lies outside the lines.
    """
    lines = receptance.frequency
    if not lines[0] <= frequency <= lines[-1]:
        return 0.0, float("nan")
    inside = np.abs(lines - frequency) <= damping * frequency
    inside[np.argsort(np.abs(lines - frequency), kind="stable")[:3]] = True
    return float(np.mean(receptance.passed[inside])), float(np.min(receptance.gate_level[inside]))


def residues_of_receptance(receptance, frequency, damping) -> np.ndarray | None:
    r"""Residues R of the accelerance :math:`\sum_m \frac12\left(\frac{R_m}{p - s_m} +
    \frac{\bar R_m}{p - \bar s_m}\right) + d_0 + d_1 p^2` by least squares over the lines that passed.

    :math:`p = i\omega + a`, with the decay a of the receptance's exponential window.

    Parameters
    ----------
    receptance : Receptance
    frequency, damping : (n_mode,) arrays
        Known modes, with those that nobody names: what is left out here goes into the residues of the others.
        [Hz], [-]

    Returns
    -------
    (n_mode,) array of complex, or None
        Of the response :math:`\mathrm{Re} \sum R e^{st}` to a unit impulse [m/s² per N s]; None if fewer than
        two lines per unknown passed.
    """
    use = receptance.passed & np.isfinite(receptance.h1)
    unknowns = 2 * len(frequency) + 2
    if np.count_nonzero(use) < 2 * unknowns:
        return None
    p = 2j * np.pi * receptance.frequency[use] + receptance.decay
    accelerance = p**2 * receptance.h1[use]
    s = continuous_pole(np.asarray(frequency), np.asarray(damping))
    plus, minus = 0.5 / (p[:, None] - s), 0.5 / (p[:, None] - s.conj())
    columns = np.hstack([plus + minus, 1j * (plus - minus), np.ones((len(p), 1)), (p[:, None] / abs(p).max()) ** 2])
    design = np.vstack([columns.real, columns.imag])
    solution = np.linalg.lstsq(design, np.concatenate([accelerance.real, accelerance.imag]), rcond=None)[0]
    return solution[: len(s)] + 1j * solution[len(s) : 2 * len(s)]
