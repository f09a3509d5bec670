"""State-space models of the eight locations of the paper, corrected where a sign or a row cannot be right."""

from dataclasses import dataclass

import numpy as np

from benchmarks.published.misprints import REPAIRED_OUTPUT
from benchmarks.published.tables import RATE, TABLE_1, TABLE_2
from turnout.modal.poles import modal_parameters

PAIRS = {pair.key: pair for pair in TABLE_1 + TABLE_2}
BANDS = {"low": "ballast", "high": "railpad"}


@dataclass(frozen=True)
class PublishedModel:
    """x[k+1] = A x[k], y[k] = c x[k], x[0] = b: ballast pair first, then railpad pair where there is one.

    ``bands`` names each pair; ``frequency`` [Hz] and ``damping`` are (n_mode,), ``residue`` (n_mode,) complex
    is that of the impulse response :math:`y_k = \\mathrm{Re} \\sum R z^k`.
    """

    location: str
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    bands: tuple[str, ...]
    frequency: np.ndarray
    damping: np.ndarray
    residue: np.ndarray
    rate: float = RATE


def state_matrix(pair) -> np.ndarray:
    """(2, 2) matrix of a printed row."""
    return np.array([[pair.a11, pair.a12], [pair.a21, pair.a22]])


def output_row(pair, repaired=True) -> np.ndarray:
    """(2,) output vector of a printed row, corrected where its sign or values cannot be right."""
    printed = (pair.c1, pair.c2)
    return np.array(REPAIRED_OUTPUT.get(pair.key, printed) if repaired else printed)


def published_model(location: str) -> PublishedModel:
    """Model of a location of the paper: order 4, or 2 at CP A8 where the gate left one band.

    The paper prints no input vector. Its pairs are balanced, hence b = diag(1, -1) c^T. KeyError lists the existing
    locations.

    >>> model = published_model("CP A7")
    >>> print(model.bands, [f"{f:.1f} Hz" for f in model.frequency])
    ('ballast', 'railpad') ['99.4 Hz', '616.5 Hz']
    """
    keys = [key for key in ((location, "low"), (location, "high")) if key in PAIRS]
    if not keys:
        raise KeyError(f"no location {location!r}; there are {sorted({k for k, _ in PAIRS})}")
    n = 2 * len(keys)
    a, b, c, pole, residue = np.zeros((n, n)), np.zeros(n), np.zeros(n), [], []
    for i, key in enumerate(keys):
        block = slice(2 * i, 2 * i + 2)
        a[block, block], c[block] = state_matrix(PAIRS[key]), output_row(PAIRS[key])
        b[block] = c[block] * (1.0, -1.0)
        values, vectors = np.linalg.eig(a[block, block])
        upper = int(np.argmax(values.imag))
        pole.append(values[upper])
        residue.append(2.0 * (c[block] @ vectors[:, upper]) * (np.linalg.inv(vectors)[upper] @ b[block]))
    frequency, damping = modal_parameters(np.array(pole), RATE)
    bands = tuple(BANDS[band] for _, band in keys)
    return PublishedModel(location, a, b, c, bands, frequency, damping, np.array(residue))
