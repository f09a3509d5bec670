"""Limits of channels: peaks that follow the trains, constant peaks, and peaks with constant maxima."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.turnout.priors import SATURATION
from turnout.mismatch.turnout.saturation import saturated_channels, saturation_gain
from turnout.records import Channel, Recording

PEAKS = np.log([40.0, 55.0, 70.0, 100.0, 140.0, 200.0])
SCATTER = 0.1 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])


def test_constant_peaks_gain_the_logarithm_of_the_missing_scatter():
    gain = saturation_gain(np.full(6, np.log(8.0)), PEAKS)
    assert np.isclose(
        gain, 3.0 * np.log(1.0 + np.var(PEAKS) / SATURATION.scatter_floor**2) - 0.5 * np.log(6.0), atol=0.0, rtol=1e-12
    )


def test_peaks_that_follow_the_trains_have_no_evidence_of_a_limit():
    assert saturation_gain(PEAKS - 0.7 + SCATTER, PEAKS) < 2.0


def test_only_the_strong_passages_may_reach_the_limit():
    peaks = np.minimum(np.log(90.0), PEAKS + 0.01 * SCATTER)
    assert saturation_gain(peaks, PEAKS) > 12.0
    # the quiet passages alone are at no limit; constant peaks always gain a little over following ones
    assert saturation_gain(peaks[::-1], PEAKS) < 0.5 * saturation_gain(peaks, PEAKS)


@pytest.mark.parametrize("limit, found", [(None, ["A1"]), (1000.0, ["A1"]), (90.0, [])])
def test_a_channel_at_the_range_in_its_file_has_no_fault(limit, found):
    """Two of six passages stay below 90 m/s², where A1 ends: a fault, unless that is the range stated."""

    def passage(peak):
        peaks = np.array([min(peak, 90.0), 1.3 * peak, 0.8 * peak])
        samples = peaks[:, None] * np.sin(np.linspace(0.0, 50.0, 1001))
        named = ("A1", "A2", "A3")
        channels = tuple(Channel(n, "acceleration", "m/s²", limit=limit if n == "A1" else None) for n in named)
        return SimpleNamespace(recording=Recording(samples, 2000.0, channels))

    sensors = [SimpleNamespace(name=n, place=x) for n, x in (("A1", 1.0), ("A2", 3.0), ("A3", 5.0))]
    campaign = SimpleNamespace(sensors=sensors, hammer=(), passages=[passage(np.exp(peak)) for peak in PEAKS])
    assert list(saturated_channels(campaign, 12.0)) == found


def test_impacts_of_a_flat_that_one_channel_shows_less_are_no_limit():
    """Three passages have one impact each, alike for A1: five times what it shows for the rest of the time."""
    quiet, others = np.array([66.0, 64.0, 70.0, 68.0, 73.0]), np.array([46.0, 45.0, 49.0, 48.0, 51.0])
    limited, larger = np.array([302.0, 312.0, 320.0]), np.array([400.0, 460.0, 480.0])
    assert saturation_gain(np.log([*quiet, *limited]), np.log([*others, *larger])) > 12.0 + np.log(3.0)

    def passage(peak, theirs, rolled):
        samples = np.outer([rolled[0], rolled[1], rolled[1]], np.sin(np.linspace(0.0, 50.0, 1001)))
        samples[:, 300] = [peak, theirs, theirs]
        channels = tuple(Channel(n, "acceleration", "m/s²") for n in ("A1", "A2", "A3"))
        return SimpleNamespace(recording=Recording(samples, 2000.0, channels))

    sensors = [SimpleNamespace(name=n, place=x) for n, x in (("A1", 1.0), ("A2", 3.0), ("A3", 5.0))]
    rolling = [passage(a, b, (a, b)) for a, b in zip(quiet, others, strict=True)]
    with_impact = [passage(a, b, (66.0, 46.0)) for a, b in zip(limited, larger, strict=True)]
    campaign = SimpleNamespace(sensors=sensors, hammer=(), passages=[*rolling, *with_impact])
    assert saturated_channels(campaign, 12.0) == {}


@pytest.mark.parametrize("is_noise", [True, False])
def test_constant_peaks_of_noise_are_no_limit_and_those_of_a_train_are(is_noise):
    """A train is in the middle third of each recording. A1 stays within 90 m/s² always, or only under the train."""
    time, rng = np.linspace(0.0, 3.0, 3001), np.random.default_rng(2)
    under_train = np.where((time > 1.0) & (time < 2.0), 1.0, 0.02)

    def passage(peak):
        wave = under_train * np.sin(300.0 * time)
        noise = np.clip(40.0 * rng.standard_normal(time.size), -90.0, 90.0)
        first = noise if is_noise else np.clip(peak * wave, -90.0, 90.0)
        samples = np.array([first, 1.3 * peak * wave, 0.8 * peak * wave])
        channels = tuple(Channel(n, "acceleration", "m/s²") for n in ("A1", "A2", "A3"))
        return SimpleNamespace(recording=Recording(samples, 1000.0, channels))

    sensors = [SimpleNamespace(name=n, place=x) for n, x in (("A1", 1.0), ("A2", 3.0), ("A3", 5.0))]
    campaign = SimpleNamespace(sensors=sensors, hammer=(), passages=[passage(np.exp(peak)) for peak in PEAKS])
    assert list(saturated_channels(campaign, 3.0)) == ([] if is_noise else ["A1"])
