"""Hammer tests computed from the models of the paper, for tests and benchmarks with known truth."""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.published.models import PublishedModel, published_model
from turnout.modal.poles import continuous_pole
from turnout.modal.pulse_response import haversine_pulse, pulse_response


@dataclass(frozen=True)
class Nuisance:
    """A mode that the published models lack; ``share`` is its initial amplitude over that of the largest mode."""

    frequency: float
    damping: float
    share: float
    phase: float = 0.7


# A web mode above the band and a weak mode between the two bands.
UNMODELLED = (Nuisance(1050.0, 0.03, 0.50), Nuisance(330.0, 0.05, 0.12))


@dataclass(frozen=True)
class HammerTest:
    """Synthetic impacts at one location: ``force`` [N] and ``acceleration`` [m/s²] are (n_impact, n_sample).

    ``decay_start`` (n_impact,) is the first sample of the free decay. ``frequency`` [Hz] and ``damping``, both
    (n_impact, n_mode), are the true modes of each impact and ``bands`` their names; unmodelled modes come last.
    ``noise`` [m/s²] is the standard deviation of the white noise of each impact, (n_impact,).
    """

    force: np.ndarray
    acceleration: np.ndarray
    rate: float
    decay_start: np.ndarray
    bands: tuple[str, ...]
    frequency: np.ndarray
    damping: np.ndarray
    noise: np.ndarray
    peak: np.ndarray = field(repr=False)

    def decays(self, n: int = 600) -> list[np.ndarray]:
        """Free decays of ``n`` samples, one (n,) array per impact [m/s²]."""
        return [y[k : k + n] for y, k in zip(self.acceleration, self.decay_start, strict=True)]


def hammer_test(
    location: str | PublishedModel,
    n_impact: int = 10,
    seed: int | np.random.Generator = 0,
    *,
    snr_db: float = 40.0,
    spread: float = 0.0,
    shift=(1.0, 1.0),
    nuisance: tuple[Nuisance, ...] = (),
    drift: float = 0.0,
    contact: float = 1.5e-3,
    peak: float = 8000.0,
    gain: float = 3e-4,
    duration: float = 0.04,
    pre_trigger: float = 2e-3,
) -> HammerTest:
    r"""Simulate impacts of a soft-tipped hammer at one location of the paper.

    Parameters
    ----------
    location : str or PublishedModel
        A name of ``tables.LOCATIONS``.
    n_impact : int
        Number of impacts. Contact time varies by 8 %, peak force by 10 %; the start lies anywhere between two samples.
    seed : int or Generator
        The only source of randomness.
    snr_db : float
        Peak acceleration of an impact over the standard deviation of its white noise [dB].
    spread : float
        Relative standard deviation of every frequency and damping from impact to impact, independent.
    shift : (n_mode,) floats
        Factors on the true frequencies, for drift over campaigns.
    nuisance : tuple of Nuisance
        Unmodelled modes.
    drift : float
        Slow drift of the zero, its size over the peak acceleration: a decay of 0.25 s and a sine of 4 Hz.
    contact, peak, gain : float
        Mean contact time [s], mean peak force [N], and acceleration [m/s²] per unit of the paper's normalised
        output, which has none.
    duration, pre_trigger : float
        Length after and before the impact [s].

    Returns
    -------
    HammerTest

    Examples
    --------
    >>> test = hammer_test("CP A8", 3, seed=1)
    >>> len(test.decays(600)), test.bands
    (3, ('ballast',))
    """
    model = published_model(location) if isinstance(location, str) else location
    rng = np.random.default_rng(seed)
    frequency, damping, residue = _modes(model, n_impact, spread, shift, nuisance, rng)
    length = contact * (1.0 + 0.08 * rng.standard_normal(n_impact))
    height = peak * (1.0 + 0.10 * rng.standard_normal(n_impact))
    before = round(pre_trigger * model.rate)
    n = before + round(duration * model.rate)
    time = (np.arange(n) - before - rng.random(n_impact)[:, None]) / model.rate
    force = height[:, None] * haversine_pulse(time, length[:, None])
    # y_k = Re sum R z^k is the response to one unit of impulse in one sample, hence the factor of the rate.
    pole = continuous_pole(frequency, damping)
    clean = gain * model.rate * height[:, None] * pulse_response(time, pole, residue, length)
    top = np.max(np.abs(clean), axis=1)
    noise = top * 10.0 ** (-snr_db / 20.0)
    noisy = clean + noise[:, None] * rng.standard_normal(clean.shape)
    if drift:
        noisy = noisy + drift * top[:, None] * _wandering_zero(time, rng)
    touching = force > 0.02 * height[:, None]
    last = n - 1 - np.argmax(touching[:, ::-1], axis=1)
    force = force + 1e-3 * height[:, None] * rng.standard_normal(force.shape)
    start = last + 1 + round(2e-4 * model.rate)
    bands = model.bands + ("unmodelled",) * len(nuisance)
    return HammerTest(force, noisy, model.rate, start, bands, frequency, damping, noise, height)


def _modes(model, n_impact, spread, shift, nuisance, rng):
    """(frequency, damping, residue) of every impact, (n_impact, n_mode) each; unmodelled modes come last."""
    n_mode = len(model.frequency)
    scatter = 1.0 + spread * rng.standard_normal((2, n_impact, n_mode))
    frequency = model.frequency * np.asarray(shift, float)[:n_mode] * scatter[0]
    damping = np.clip(model.damping * scatter[1], 1e-4, 0.95)
    residue = np.broadcast_to(model.residue, (n_impact, n_mode))
    largest = np.max(np.abs(model.residue))
    for extra in nuisance:
        ones = np.ones((n_impact, 1))
        frequency = np.hstack([frequency, extra.frequency * ones])
        damping = np.hstack([damping, extra.damping * ones])
        residue = np.hstack([residue, extra.share * largest * np.exp(1j * extra.phase) * ones])
    return frequency, damping, residue


def _wandering_zero(time, rng):
    """(n_impact, n_sample) slow drift of either sign: a decay of 0.25 s and a sine of 4 Hz."""
    phase = 2.0 * np.pi * rng.random((len(time), 1))
    slow = np.exp(-np.clip(time, 0.0, None) / 0.25) + np.sin(2.0 * np.pi * 4.0 * time + phase)
    return slow * np.sign(rng.standard_normal((len(time), 1)))
