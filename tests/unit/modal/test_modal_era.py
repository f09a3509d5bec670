"""Fast Hankel products and realisations agree with the direct ones, with less memory."""

import tracemalloc

import numpy as np
import pytest
from benchmarks.published import hammer_test
from scipy.linalg import hankel

from turnout.modal import era
from turnout.modal.era import gram_matrices, hankel_operator, hankel_rows


def full_svd_era(y, order, rows):
    """Realisation as in textbooks, with explicit matrices."""
    columns = len(y) - rows
    h0 = hankel(y[:rows], y[rows - 1 : -1])
    h1 = hankel(y[1 : rows + 1], y[rows:])
    assert h0.shape == h1.shape == (rows, columns)
    u, s, vt = np.linalg.svd(h0, full_matrices=False)
    u, s, v = u[:, :order], s[:order], vt[:order].T
    return (u.T @ h1 @ v) / np.sqrt(np.outer(s, s)), s


def noisy_decay(n=600):
    return hammer_test("CP A7", 1, 3, duration=0.2).decays(n)[0]


@pytest.mark.parametrize(("rows", "shift"), [(7, 0), (7, 1), (20, 0), (20, 1), (33, 1)])
def test_the_hankel_product_is_that_of_the_explicit_matrix(rows, shift):
    rng = np.random.default_rng(1)
    y = rng.standard_normal(40)
    operator = hankel_operator(y, rows, shift)
    columns = len(y) - rows
    formed = np.array([[y[i + j + shift] for j in range(columns)] for i in range(rows)])
    x, left = rng.standard_normal(columns), rng.standard_normal(rows)
    np.testing.assert_allclose(operator @ x, formed @ x, atol=1e-12)
    np.testing.assert_allclose(operator.H @ left, formed.T @ left, atol=1e-12)


@pytest.mark.parametrize("start", [0, 5])
def test_the_gram_matrix_is_that_of_all_hankel_matrices_side_by_side(start):
    rng = np.random.default_rng(2)
    decays = rng.standard_normal((3, 50))
    rows, columns = 14, 36
    (gram,) = gram_matrices(decays, rows, (start,))
    formed = [[[y[i + j] for j in range(start, columns)] for i in range(rows + 1)] for y in decays]
    side_by_side = np.concatenate(np.array(formed), axis=1)
    np.testing.assert_allclose(gram, side_by_side @ side_by_side.T, atol=1e-12)


@pytest.mark.parametrize("rows", [200, 300], ids=["wide", "square"])
@pytest.mark.parametrize("order", [2, 4, 7])
def test_lanczos_gives_the_digits_of_a_full_svd(rows, order):
    y = noisy_decay()
    a, s = full_svd_era(y, order, rows)
    ours = era(y, order, rows)
    np.testing.assert_allclose(ours.singular_values, s, rtol=1e-10)
    expected, found = np.sort_complex(np.linalg.eigvals(a)), np.sort_complex(ours.poles)
    # At order 7 two singular values of noise are 2 % apart: eigenvectors and poles lose two digits.
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_the_realisation_reproduces_its_decay():
    y = 2.0 * 0.9 ** np.arange(60.0) * np.cos(0.7 * np.arange(60.0) + 0.4)
    model = era(y, 2, 20)
    x, out = model.b, []
    for _ in range(60):
        out.append(model.c @ x)
        x = model.a @ x
    np.testing.assert_allclose(out, y, atol=1e-12)


def test_several_decays_share_the_poles_and_keep_their_own_initial_states():
    k = np.arange(90.0)
    decays = np.array([0.95**k * np.cos(0.5 * k + phase) for phase in (0.0, 1.0, 2.5)])
    model = era(decays, 2, 30)
    np.testing.assert_allclose(np.abs(model.poles), 0.95, rtol=1e-12)
    for i, y in enumerate(decays):
        np.testing.assert_allclose([model.c @ model.b[:, i], model.c @ model.a @ model.b[:, i]], y[:2], atol=1e-10)


def test_memory_is_not_quadratic_in_the_size_of_the_hankel_matrix():
    y = noisy_decay(2400)
    peaks = []
    for n in (600, 1200):
        tracemalloc.start()
        era(y[: 2 * n], 4, n)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # Twice the size: linear memory doubles (FFT lengths round up by at most 1.2), quadratic would be fourfold.
    assert peaks[1] < 2.5 * peaks[0]
    assert peaks[1] < 1200 * 1200


def test_a_record_shorter_than_a_decay_time_needs_a_square_matrix():
    assert hankel_rows(600) == 200
    assert hankel_rows(600, decay_time=199.0) == 200
    assert hankel_rows(600, decay_time=201.0) == 300


@pytest.mark.parametrize(
    ("decay", "order", "words"),
    [
        (np.array([1.0, np.nan, 0.5, 0.2]), 1, "not finite"),
        (np.ones(9), 5, "order 5 needs at least 5 rows and columns; there are 3 x 6"),
        (np.ones((2, 9)), 5, "order 5"),
    ],
)
def test_an_error_states_why_a_decay_cannot_be_realised(decay, order, words):
    with pytest.raises(ValueError, match=words):
        era(decay, order)
