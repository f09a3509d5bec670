"""One synthetic hammer test with a closed-form truth, and possible faults of it."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.signal import fftconvolve

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts
from turnout.records import Channel, Recording
from turnout.signal.filters import force_pulse

RATE = 20_000.0
N = 4000
CHANNELS = (Channel("hammer", "force"), Channel("rail", "acceleration"))
# Two modes with complex residues: a real spectrum would hide a wrong conjugate.
POLES = np.array([-180.0 + 2j * np.pi * 95.0, -250.0 + 2j * np.pi * 616.0])
RESIDUES = np.array([0.8 + 0.5j, 2.0 - 1.2j])


@dataclass
class HammerTest:
    """Builds recordings; ``accelerance`` is the exact ratio of the spectra of one complete record. [m/s²/N]"""

    rng: np.random.Generator

    def impulse_response(self, n=N):
        return np.real(np.exp(np.outer(np.arange(n) / RATE, POLES)) @ RESIDUES)

    def accelerance(self, frequency):
        z, q = np.exp(POLES / RATE), np.exp(-2j * np.pi * np.asarray(frequency)[:, None] / RATE)
        return 0.5 * np.sum(RESIDUES / (1 - z * q) + RESIDUES.conj() / (1 - z.conj() * q), axis=1)

    def force(self, peak=5000.0, contact=1.5e-3, start=5e-3, family="half-sine", n=N):
        return peak * force_pulse(family, np.arange(n) / RATE - start, contact)

    def samples(self, force, noise=(1e-4, 1e-3)):
        """(2, n): force and its response, each with white noise relative to its peak."""
        both = np.stack([force, fftconvolve(force, self.impulse_response(force.size))[: force.size]])
        return both + self.rng.standard_normal(both.shape) * np.array(noise)[:, None] * np.abs(both).max(1)[:, None]

    def recording(self, samples, record=0, source="test.uff", channels=CHANNELS, rate=RATE):
        return Recording(samples, rate, channels, source=source, record=record)

    def impacts(self, recordings, **settings):
        """Its impacts, found with the default settings except for those given."""
        return find_impacts(recordings, "hammer", "rail", ReceptanceSettings(**settings))

    def recordings(self, n=6, noise=(1e-4, 1e-3), **force):
        """One intact impact each, with a peak between 4 and 6 kN and a start at any time between two samples."""
        return [
            self.recording(self.samples(self.force(
                peak=self.rng.uniform(4000, 6000), start=5e-3 + self.rng.uniform() / RATE, **force), noise), k)
            for k in range(n)
        ]  # fmt: skip


@pytest.fixture
def hammer():
    return HammerTest(np.random.default_rng(20171017))
