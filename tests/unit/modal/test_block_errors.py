"""The errors of the entries of a mode's block are the scatter of blocks of random modes."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.modal.block_errors import blocks_with_errors
from turnout.modal.poles import discrete_pole
from turnout.modal.state_space import balanced_pair

RATE, N_DRAWS = 5000.0, 4000
MODES = ((100.0, 0.15, 0.7 - 0.4j), (600.0, 0.05, 1.3 + 0.8j))  # Hz, damping ratio, residue
ERRORS = ((0.4, 0.004, 0.02 + 0.01j), (1.5, 0.001, 0.01 + 0.03j))


def entries(frequency, damping, residue):
    a, b, c = balanced_pair(complex(discrete_pole(frequency, damping, RATE)), residue)
    return a, b, c


def test_the_stated_errors_are_the_scatter_of_blocks_of_random_modes():
    blocks = [entries(*mode) for mode in MODES]
    a = np.zeros((4, 4))
    a[:2, :2], a[2:, 2:] = blocks[0][0], blocks[1][0]
    model = SimpleNamespace(
        modes=[
            SimpleNamespace(frequency=f, damping=z, frequency_se=sf, damping_se=sz)
            for (f, z, _), (sf, sz, _) in zip(MODES, ERRORS)
        ],
        a=a, b=np.concatenate([b for _, b, _ in blocks]), c=np.concatenate([c for _, _, c in blocks]), rate=RATE,
        fitted_receptance=SimpleNamespace(residue_se=[error for _, _, error in ERRORS]),
        diagnostics={"scale": "unit impulse"},
    )  # fmt: skip
    rng = np.random.default_rng(12)
    for (f, z, r), (sf, sz, sr), (value, error) in zip(MODES, ERRORS, blocks_with_errors(model)):
        draws = []
        for df, dz, dr, di in rng.standard_normal((N_DRAWS, 4)):
            drawn_a, _, drawn_c = entries(f + sf * df, z + sz * dz, r + complex(sr.real * dr, sr.imag * di))
            draws.append(np.concatenate([drawn_a.ravel(), drawn_c]))
        mean, scatter = np.mean(draws, axis=0), np.std(draws, axis=0)
        # four standard errors of the mean, and the curvature within the scatter
        assert value == pytest.approx(mean, abs=4.0 * float(scatter.max()) / np.sqrt(N_DRAWS) + 1e-4)
        # a standard deviation of 4,000 draws is known to 1.1 %; four of that
        assert error == pytest.approx(scatter, rel=0.045)
