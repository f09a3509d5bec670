"""Accelerations of hammer tests that all lag behind the force, or lead it: two loggers, or a filter before one of them.

A fault of one sensor shows in its channel alone, and a track that differs from its file changes the phase more the
farther a sensor is from the impact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import CHANNELS_CHECK

if TYPE_CHECKING:
    from turnout.mismatch.turnout.campaign import CampaignInput
    from turnout.mismatch.turnout.filed_tests import FiledTests
    from turnout.records import Recording


@dataclass(frozen=True)
class CommonDelay:
    """Lags of the accelerations behind the force by channel [s], medians over ``n`` hammer tests."""

    lags: Mapping[str, float]
    n: int

    recording_type = "delay of hammer tests"

    def __bool__(self) -> bool:
        return bool(self.lags)

    @property
    def lag(self) -> float:
        """Median of the ``lags``. [s]"""
        return float(np.median(list(self.lags.values())))

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop.
        """
        low, high = sorted(1e3 * abs(lag) for lag in (min(self.lags.values()), max(self.lags.values())))
        relation = "lag behind" if self.lag > 0.0 else "lead"
        return [
            f"In the hammer tests the accelerations of all {len(self.lags)} comparable channels {relation} the force "
            f"by {1e3 * abs(self.lag):.2f} ms (by channel {low:.2f} to {high:.2f}, {self.n} tests). The diagnosis "
            "corrects that. Record force and accelerations with one clock and the same filters"
        ]

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign with accelerations of hammer tests at the time of their force.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
        return campaign.with_recordings("hammer tests", self._correct_recording)

    def _correct_recording(self, recording: Recording) -> Recording:
        samples = recording.samples.copy()
        for row in recording.of_quantity("acceleration"):
            samples[row] = earlier(samples[row], self.lag * recording.rate)
        return replace(recording, samples=samples)


def earlier(samples: np.ndarray, n: float) -> np.ndarray:
    r"""A signal n samples earlier, later if n is negative: :math:`X(\omega)\, e^{i \omega n}`.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Signal. It is continued by its first and last value.
    n : float
        Number of samples, not necessarily whole.

    Returns
    -------
    (n_sample,) array of float

    Examples
    --------
    >>> print(*np.abs(earlier(np.array([0.0, 0.0, 1.0, 4.0, 1.0, 0.0, 0.0]), 1.0)).round(6))
    0.0 1.0 4.0 1.0 0.0 0.0 0.0
    """
    margin = samples.size
    padded = np.pad(samples, margin, mode="edge")
    shift = np.exp(2j * np.pi * np.fft.rfftfreq(padded.size) * n)
    return np.fft.irfft(np.fft.rfft(padded) * shift, padded.size)[margin : 2 * margin]


def common_delay(filed: FiledTests) -> CommonDelay:
    """The lag of all accelerations behind the force, if all channels and tests share one that is far from 0.

    Parameters
    ----------
    filed : FiledTests
        Hammer tests of the campaign.

    Returns
    -------
    CommonDelay
        False if there is none, channels or tests differ, or there are fewer than two channels.
    """
    by_channel, by_test = typical_lags(filed)
    lags = [*by_channel.values(), *by_test.values()]
    if len(by_channel) < 2 or np.ptp(lags) > CHANNELS_CHECK.delay_spread:
        return CommonDelay({}, len(by_test))
    is_far = min(lags) >= CHANNELS_CHECK.min_delay or max(lags) <= -CHANNELS_CHECK.min_delay
    return CommonDelay(by_channel if is_far else {}, len(by_test))


def typical_lags(filed: FiledTests) -> tuple[dict[str, float], dict[str, float]]:
    r"""Lags behind the force [s] by channel, medians over the tests, and by test, medians over the channels.

    The lag of a channel in a test is the one at which it correlates best with the simulation on the track as filed,
    both over the magnitude of the measured receptance. It counts if that correlation is 0.5 or more.

    .. math:: \hat\tau = \arg\max_\tau \operatorname{Re} \sum_f
        \overline{H_s(f)}\, H_m(f)\, |H_m(f)|^{-2}\, e^{2 \pi i f \tau}

    Parameters
    ----------
    filed : FiledTests
        Hammer tests of the campaign.

    Returns
    -------
    by_channel : dict of str to float
    by_test : dict of str to float
    """
    n_lag = round(CHANNELS_CHECK.max_delay / CHANNELS_CHECK.delay_step)
    lags = CHANNELS_CHECK.delay_step * np.arange(-n_lag, n_lag + 1)
    by_channel: dict[str, list[float]] = {}
    by_test: dict[str, list[float]] = {}
    for _, observation in filed.tests.observations:
        pair = filed.tests.frf_pairs[observation.name]
        measured, modelled = (_as_complex(x) * pair.size for x in (observation.data, filed.simulated[pair.name]))
        sums = (np.exp(2j * np.pi * np.outer(lags, pair.frequency)) @ (modelled.conj() * measured)).real
        best = int(np.argmax(sums))
        if sums[best] >= CHANNELS_CHECK.same_sensor * np.linalg.norm(measured) * np.linalg.norm(modelled):
            by_channel.setdefault(pair.channel, []).append(float(lags[best]))
            by_test.setdefault(pair.test.name, []).append(float(lags[best]))
    return _medians(by_channel), _medians(by_test)


def _medians(values: Mapping[str, list[float]]) -> dict[str, float]:
    return {name: float(np.median(x)) for name, x in values.items()}


def _as_complex(values: np.ndarray) -> np.ndarray:
    """Receptance of real parts that are followed by imaginary parts."""
    real, imaginary = values.reshape(2, -1)
    return real + 1j * imaginary
