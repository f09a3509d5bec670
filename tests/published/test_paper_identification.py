"""Identification of noise-free decays of the paper's models gives these models."""

import numpy as np
import pytest
from benchmarks.published import LOCATIONS, TABLE_1, TABLE_2, misprints, published_model
from benchmarks.published.models import output_row, state_matrix

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import balanced_pair, era, identify


def free_decay(model, n=600):
    x, y = model.b, []
    for _ in range(n):
        y.append(model.c @ x)
        x = model.a @ x
    return np.array(y)


@pytest.mark.parametrize("location", LOCATIONS)
@pytest.mark.parametrize("rows", [200, 300], ids=["a third", "square"])
def test_era_of_the_exact_decay_finds_the_poles_to_rounding(location, rows):
    model = published_model(location)
    frequency, damping = era(free_decay(model), len(model.b), rows, model.rate).modes()
    # 1e-9 leaves room for the condition of the weakest mode; 4e-13 is seen.
    assert frequency == pytest.approx(model.frequency, rel=1e-9)
    assert damping == pytest.approx(model.damping, rel=1e-9)


def test_era_of_several_exact_decays_finds_the_common_poles():
    model = published_model("CP A7")
    decays = np.array([free_decay(model, 620)[k : k + 600] for k in (0, 7, 20)])
    frequency, damping = era(decays, 4, 200, model.rate).modes()
    assert frequency == pytest.approx(model.frequency, rel=1e-9)
    assert damping == pytest.approx(model.damping, rel=1e-9)


@pytest.mark.parametrize("location", LOCATIONS)
def test_identification_of_exact_decays_is_exact_and_reproduces_them(location):
    model = published_model(location)
    decay = free_decay(model, 600)
    found = identify([decay, 0.7 * decay, 1.3 * decay], model.rate, IdentifySettings())
    assert tuple(m.band for m in found.modes) == model.bands
    assert [m.frequency for m in found.modes] == pytest.approx(model.frequency, rel=1e-7)
    assert [m.damping for m in found.modes] == pytest.approx(model.damping, rel=1e-7)
    x, modelled = found.b, []
    for _ in range(600):
        modelled.append(found.c @ x)
        x = found.a @ x
    np.testing.assert_allclose(modelled, decay, atol=1e-5 * np.abs(decay).max())


BALANCED = [row for row in TABLE_1 + TABLE_2 if row.key not in misprints.BALANCE]


@pytest.mark.parametrize("row", BALANCED, ids=lambda row: f"{row.location} {row.band}")
def test_the_balanced_pair_of_a_printed_response_is_the_printed_pair(row):
    """Twelve of the fifteen printed pairs are balanced. The signs of states are free: magnitudes, then the response."""
    a, c = state_matrix(row), output_row(row, repaired=False)
    b = c * (1.0, -1.0)
    values, vectors = np.linalg.eig(a)
    upper = int(np.argmax(values.imag))
    residue = 2.0 * (c @ vectors[:, upper]) * (np.linalg.inv(vectors)[upper] @ b)
    ours_a, ours_b, ours_c = balanced_pair(values[upper], residue)
    # A Gramian correlation of 0.004 asks for a hyperbolic turn of 0.002, which moves a11 by 2 x 0.002 a12 and
    # c by 0.002 of its norm; rounding adds a digit to each.
    np.testing.assert_allclose(np.abs(ours_a), np.abs(a), atol=0.004 * abs(a[0, 1]) + 1e-4)
    np.testing.assert_allclose(np.abs(ours_c), np.abs(c), atol=0.002 * np.linalg.norm(c) + 1e-4)
    assert ours_c @ np.linalg.matrix_power(ours_a, 9) @ ours_b == pytest.approx(c @ np.linalg.matrix_power(a, 9) @ b)
