"""Modes of frequency responses: exact ones, close ones, noise, and two measured beams."""

import gzip

import numpy as np
import pytest

from turnout.modal import modes_of_frf

# Response 1 of the beam, as its authors publish it from LSCF: Hz and per cent.
BEAM = ((177.0, 0.86), (477.4, 0.20), (933.1, 0.15), (1535.5, 0.20), (2286.9, 0.28), (3162.4, 0.18), (4181.2, 0.15))
PEAKS = (52.6, 144.6, 283.1, 468.3, 698.5, 973.0, 1293.0)


def response(frequency, modes):
    """Accelerance of modes (f, zeta, participation)."""
    f = frequency[:, None]
    fn, zeta, weight = np.array(modes).T
    return (-(f**2) * weight / (fn**2 - f**2 + 2j * zeta * fn * f)).sum(axis=1)


def test_modes_over_a_decade_are_found_with_their_damping():
    f = np.arange(1.0, 2001.0)
    true = [(112.0, 0.004, 1.0), (306.9, 0.002, -0.8), (596.4, 0.0015, 1.2), (974.1, 0.001, -0.5)]
    found = modes_of_frf(f, response(f, true)).modes
    # The local polynomial replaces modes far from the band, with an error of 1e-4 of a half-width.
    assert [m.frequency.mean for m in found] == pytest.approx([t[0] for t in true], rel=1e-5)
    assert [m.damping.mean for m in found] == pytest.approx([t[1] for t in true], rel=1e-2)


def test_two_close_modes_are_distinguished():
    f = np.arange(1.0, 1001.0) * 0.25
    both = [response(f, [(100.0, 0.01, 1.0), (103.0, 0.01, w)]) for w in (0.8, -0.5, 0.3)]
    found = modes_of_frf(f, np.array(both)).modes
    assert [m.frequency.mean for m in found] == pytest.approx([100.0, 103.0], abs=0.02)


def damped_modes(seed):
    """Frequencies [Hz], damping ratios, receptance and its lines: eight modes of 1 to 5 % damping, 60 to 1600 Hz."""
    rng = np.random.default_rng(seed)
    zeta = rng.uniform(0.3, 1.0, 8) * (0.01, 0.03, 0.05)[seed % 3]
    fn = np.array([60.0])
    while len(fn) < 8:
        step = 6.0 * max(zeta[len(fn) - 1 : len(fn) + 1]) * fn[-1]  # three half-power widths of the wider neighbour
        fn = np.append(fn, fn[-1] + step * rng.uniform(1.2, 2.0) + 30.0)
    f = np.arange(0.5, 1.3 * fn[-1], 0.5)
    weight = rng.uniform(0.5, 1.5, 8) * fn
    terms = weight / (fn**2 - f[:, None] ** 2 + 2j * zeta * fn * f[:, None])
    return fn, zeta, weight, f, terms.sum(axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_receptance_mobility_and_accelerance_give_the_same_modes(seed):
    """The local polynomial lacks a part of the slope of the neighbours within a half-width, about the damping ratio.

    The bias is a share of the half-width, zeta, times a factor below 0.02 in frequency, 4 in damping and 6 in residue.
    """
    fn, zeta, weight, f, receptance = damped_modes(seed)
    omega = 2j * np.pi * f
    found = [modes_of_frf(f, receptance * omega**k).modes for k in (0, 1, 2)]
    for modes in found:
        assert np.all(np.abs(np.array([m.frequency.mean for m in modes]) / fn - 1.0) < 0.02 * zeta)
        assert [m.damping.mean for m in modes] == pytest.approx(zeta, rel=4.0 * zeta.max())
        assert [m.frequency.mean for m in modes] == pytest.approx([m.frequency.mean for m in found[0]], rel=1e-7)
    # Near its pole s, w / (fn² - f² + 2j zeta fn f) is R / (i omega - s) with R = -j pi w / fd and fd damped.
    expected = -1j * np.pi * weight / (fn * np.sqrt(1.0 - zeta**2))
    for k, modes in enumerate(found):
        pole = 2 * np.pi * fn * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        residue = np.array([m.residue[0] for m in modes]) / pole**k
        assert residue == pytest.approx(expected, rel=6.0 * zeta.max())


def test_the_modes_of_a_response_that_is_zero_at_zero_hertz_are_found():
    f = np.arange(0.0, 1000.0)
    found = modes_of_frf(f, response(f, [(200.0, 0.01, 1.0)])).modes
    assert [m.frequency.mean for m in found] == pytest.approx([200.0], rel=1e-5)


def test_noise_has_no_modes():
    rng = np.random.default_rng(1)
    f = np.arange(1.0, 2001.0)
    for _ in range(5):
        noise = rng.standard_normal((3, 2000)) + 1j * rng.standard_normal((3, 2000))
        assert modes_of_frf(f, noise).modes == ()


def test_errors_come_from_the_spread_between_responses():
    f = np.arange(1.0, 401.0)
    shifted = [response(f, [(200.0 + d, 0.01, 1.0)]) for d in (-0.6, -0.1, 0.2, 0.5)]
    (mode,) = modes_of_frf(f, np.array(shifted)).modes
    assert mode.frequency.se == pytest.approx(np.std([-0.6, -0.1, 0.2, 0.5], ddof=1) / 2.0, rel=0.05)
    assert mode.frequency.n == 4


@pytest.mark.parametrize(
    ("frequency", "frf", "words"),
    [
        (np.arange(20.0), np.ones(20), "at least 40 lines"),
        (np.arange(100.0) ** 1.1, np.ones(100), "evenly spaced"),
        (np.arange(100.0), np.full(100, np.nan), "not finite"),
    ],
)
def test_an_error_states_why_a_response_cannot_be_used(frequency, frf, words):
    with pytest.raises(ValueError, match=words):
        modes_of_frf(frequency, frf)


def test_the_seven_published_modes_of_a_measured_beam(shared_data):
    frequency, frf = np.load(shared_data / "frf_beam_sdypy" / "acc_data.npy", allow_pickle=True)
    found = modes_of_frf(frequency, frf[:, 1], lowest=40.0, highest=5000.0).modes
    assert len(found) == len(BEAM)
    for mode, (f, zeta) in zip(found, BEAM, strict=True):
        # Published from one response with one decimal; four t-quantiles of our error and half a printed digit.
        assert mode.frequency.mean == pytest.approx(f, abs=3.0 * mode.frequency.se + 0.05)
        assert 100.0 * mode.damping.mean == pytest.approx(zeta, abs=300.0 * mode.damping.se + 0.01)
        assert mode.frequency.mean == pytest.approx(f, rel=6e-4)


def test_the_peaks_of_a_measured_beam_at_a_tenth_of_a_hertz(shared_data, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    packed = shared_data / "uff58_reader_samples" / "beam.uff.gz"
    plain = tmp_path / "beam.uff"
    plain.write_bytes(gzip.decompress(packed.read_bytes()))
    sets = [s for s in pyuff.UFF(str(plain)).read_sets() if s["type"] == 58]
    frequency, frf = sets[0]["x"].real, np.array([s["data"] for s in sets])
    found = modes_of_frf(frequency, frf, highest=1400.0).modes
    # A peak is read to the line, and lies within one line of the mode at these dampings.
    assert [m.frequency.mean for m in found] == pytest.approx(PEAKS, abs=0.1)
    assert all(0.0 < m.damping.mean < 0.003 for m in found)
