"""Sums over damped waves from short tables agree with sums over the samples themselves."""

import numpy as np
import pytest

from turnout.modal.least_squares import drift_columns, group_decays, linearise, power_sums, powers
from turnout.modal.wave_kernels import WIDTH, fill_powers, geometric_sums, sum_blocks

# A prime number: no pair of tables has exactly this length.
N = 599


def waves_of_tests():
    """Two sets of three z: heavily damped, lightly damped and almost undamped."""
    pole = np.array([[-0.05 + 0.02j, -2e-3 + 0.2j, -1e-8 + 0.03j], [-0.3 + 0.3j, -1e-4 + 0.6j, -1e-3 + 2.0j]])
    return np.exp(pole), np.exp(pole[..., None] * np.arange(N))


@pytest.mark.parametrize("n_block", [1, 2, 19])
def test_short_tables_give_the_powers_and_their_products_with_a_record(n_block):
    z, _ = waves_of_tests()
    n = n_block * WIDTH
    record = np.random.default_rng(1).standard_normal(n)
    for pole in np.log(z):
        fine, transposed = np.empty((6, WIDTH)), np.empty((WIDTH, 6))
        block, total = np.empty((n_block, 3), complex), np.empty(6)
        fill_powers(pole, fine, transposed, block)
        wave = np.exp(pole[:, None] * np.arange(n))
        of_tables = block.T[:, :, None] * (fine[:3] + 1j * fine[3:])[:, None]
        np.testing.assert_allclose(of_tables.reshape(3, n), wave, atol=1e-12)
        np.testing.assert_array_equal(transposed, fine.T)
        sum_blocks(record.reshape(n_block, WIDTH) @ transposed, block, total)
        np.testing.assert_allclose(total[:3] + 1j * total[3:], wave @ record, rtol=1e-11, atol=1e-12)


def test_sums_of_products_of_two_waves_are_right_for_every_damping():
    """Also if z z* is so near to 1 that the closed form has no correct digit."""
    z, wave = waves_of_tests()
    for i, j in np.ndindex(3, 3):
        for other, other_wave in ((z[:, j], wave[:, j]), (z[:, j].conj(), wave[:, j].conj())):
            for group in range(2):
                terms = np.arange(N) ** np.arange(3)[:, None] * wave[group, i] * other_wave[group]
                q = z[group, i] * other[group]
                result = geometric_sums(q, q**N, N, power_sums(N))
                assert np.all(np.abs(result - terms.sum(axis=1)) < 1e-11 * np.abs(terms).sum(axis=1))


def test_both_methods_to_sum_a_series_agree_at_their_limit():
    for distance in (0.49, 0.51):
        for q in np.exp(np.array([-1.0 + 1.0j, 1j, -1.0]) * distance / N):
            direct = [np.sum(np.arange(N) ** p * q ** np.arange(N)) for p in range(3)]
            np.testing.assert_allclose(geometric_sums(q, q**N, N, power_sums(N)), direct, rtol=1e-11)


@pytest.mark.parametrize("degree", [-1, 2])
@pytest.mark.parametrize("shared", [True, False])
def test_a_linearisation_is_that_of_explicit_matrices(degree, shared):
    rng = np.random.default_rng(2)
    theta = np.array([[[np.log(110.0), 0.3], [np.log(610.0), 0.05], [np.log(1300.0), 1e-4]]])
    theta = theta if shared else theta + 0.01 * rng.standard_normal((4, 3, 2)) ** 2
    decays, drift, rate = rng.standard_normal((4, N)), drift_columns(N, degree), 20e3
    at = linearise(theta, decays, rate, drift)
    each = np.broadcast_to(theta, (4, 3, 2))
    for i in range(4):
        omega, zeta = 2 * np.pi * np.exp(each[i, :, 0]) / rate, each[i, :, 1]
        s = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
        wave = powers(np.exp(s), N)
        basis = np.vstack([wave.real, wave.imag, drift])
        q, _ = np.linalg.qr(basis.T)
        residual = decays[i] - q @ (q.T @ decays[i])
        slope = np.stack([s, omega * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))], axis=-1) * at.amplitude[i][:, None]
        derivative = (slope[..., None] * (wave * np.arange(N))[:, None]).real.reshape(6, N)
        projected = derivative - (derivative @ q) @ q.T
        np.testing.assert_allclose(at.residual[i], residual, atol=1e-9)
        np.testing.assert_allclose(at.score[i], derivative @ residual, rtol=1e-7)
        np.testing.assert_allclose(at.information[i], projected @ projected.T, rtol=1e-7)


@pytest.mark.parametrize("damping", [1.0, -1.0, 1.2])
def test_a_wave_that_does_not_oscillate_is_rejected(damping):
    """The derivative of its pole is infinite: the sums were nan or a ZeroDivisionError."""
    theta = np.array([[[np.log(100.0), 0.1], [np.log(300.0), damping]]])
    with pytest.raises(ValueError, match="damping ratios below 1"):
        linearise(theta, np.ones((2, N)), 20e3, drift_columns(N, -1))


def test_read_only_decays_use_the_same_machine_code():
    """numba compiles for read-only arrays separately, some 10 s for all sums."""
    decays = np.random.default_rng(2).standard_normal((2, N))
    decays.flags.writeable = False
    _, group = group_decays(np.array([[[3.0, 0.01]]]), decays)
    assert group.flags.writeable and group.flags.c_contiguous
    assert np.array_equal(group[0], decays)
