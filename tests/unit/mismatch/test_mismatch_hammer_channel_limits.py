"""Limits of channels under the hammer: limits of both sides, peaks that grow, and known ranges."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import fftconvolve

from turnout.mismatch.turnout import saturation
from turnout.mismatch.turnout.campaign import HammerInput
from turnout.mismatch.turnout.priors import SATURATION
from turnout.mismatch.turnout.saturation import common_limit, limit_under_impacts, saturated_channels
from turnout.records import Channel, Recording
from turnout.signal.filters import force_pulse
from turnout.simulate.sensor import Sensor

RATE = 20_000.0
FORCES = np.array([6.0, 6.7, 7.7, 8.4, 9.3, 10.4]) * 1e3
POLE = -250.0 + 2j * np.pi * 430.0


def hammer_input(place, saturated=lambda x: x, share=1.0, limit=None):
    """A test of six impacts at ``place`` on one mode; the channel A shows ``share`` of it, ``saturated``."""
    t = np.arange(4000) / RATE
    mode = np.real(np.exp(POLE * t) * (2.0 - 0.7j)) * 2e-3
    channels = (Channel("force", "force"), Channel("A", "acceleration", limit=limit))
    rng, made = np.random.default_rng(int(10.0 * place)), []
    for k, peak in enumerate(FORCES):
        force = peak * force_pulse("half-sine", t - 0.025, 1.5e-3)
        response = saturated(share * fftconvolve(force, mode)[: t.size])
        noise = rng.normal(size=(2, t.size)) * np.array([[1e-4 * peak], [0.01]])
        made.append(Recording(np.array([force, response]) + noise, RATE, channels, source="t.uff", record=k))
    return HammerInput(f"impacts at {place}", place, tuple(made), "force")


def at(place, name="A", mounting="rail web"):
    return Sensor(name, place, mounting)


def uneven(x, limit=30.0):
    """One side ends at 1.2, the other at 0.8 of ``limit``."""
    return np.clip(x, -0.8 * limit, 1.2 * limit)


def test_constant_peaks_gain_the_logarithm_of_the_missing_growth():
    x = np.log(FORCES)
    limit, gain = common_limit([(x, np.full(6, np.log(50.0)))])
    assert limit == pytest.approx(50.0)
    assert gain == pytest.approx(3.0 * np.log(1.0 + np.var(x) / SATURATION.scatter_floor**2) - 0.5 * np.log(6.0))


@pytest.mark.parametrize("slope", [1.0, 1.4])
def test_peaks_that_grow_with_the_force_or_faster_have_no_evidence_of_a_limit(slope):
    scatter = 0.01 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])
    x = np.log(FORCES)
    assert common_limit([(x, slope * x - 5.0 + scatter), (x, slope * x - 6.0 - scatter)])[1] < 0.0


def test_one_limit_applies_to_all_tests_that_reach_it():
    """A far test stays below the limit; of two that reach it each alone has half of the evidence."""
    x, top = np.log(FORCES), np.log(50.0)
    near, far = (x, np.minimum(top, x - 4.9)), (x, 1.3 * x - 9.5)
    assert far[1].max() < top
    both, one = common_limit([near, (x + 0.01, near[1]), far])[1], common_limit([near, far])[1]
    assert both > 1.6 * one > 12.0


def test_the_two_sides_of_an_amplifier_may_have_different_limits():
    """Limits of 36 and 24 m/s² count as one of 30; a twentieth of that is within the tolerated scatter."""
    limit, gain = limit_under_impacts([hammer_input(3.0, uneven), hammer_input(6.0, uneven, share=0.2)], at(3.0))
    assert gain > 12.0
    assert limit == pytest.approx(30.0, rel=0.05)


def test_a_linear_channel_has_no_limit():
    limit, gain = limit_under_impacts([hammer_input(3.0), hammer_input(6.0, share=0.2)], at(3.0))
    assert np.isnan(limit)
    assert gain == 0.0


def test_a_limit_of_one_side_is_evidence_only_at_the_impact():
    """At 6 m, away from all impacts, waves of all lengths interfere: there a channel must have limits on both sides."""

    def one_side(x):
        return np.minimum(x, 290.0)

    tests = [hammer_input(3.0, one_side), hammer_input(9.0, one_side)]
    assert limit_under_impacts(tests, at(3.0))[1] > 12.0
    assert limit_under_impacts(tests, at(6.0))[1] == 0.0
    assert limit_under_impacts([hammer_input(3.0, uneven), hammer_input(9.0, uneven)], at(6.0))[1] > 12.0


def test_a_sensor_on_the_sleeper_is_not_at_the_impact_on_the_rail():
    tests = [hammer_input(x, lambda x: np.minimum(x, 290.0)) for x in (3.0, 3.1)]
    assert limit_under_impacts(tests, at(3.0))[1] > 12.0
    assert limit_under_impacts(tests, at(3.0, mounting="sleeper end"))[1] == 0.0


@pytest.mark.parametrize(("limit", "is_possible"), [(290.0, True), (270.0, False), (24.0, False)])
def test_what_the_other_side_has_exceeded_is_no_limit_of_the_channel(limit, is_possible):
    """One side ends at a limit, as where a part of the track meets another one; the other side reaches 405 m/s².

    A filter lets 286 m/s² pass as 286 * 4 / pi = 364 m/s², and sides of an amplifier differ by a tenth: 405 m/s².
    """
    tests = [hammer_input(place, lambda x: np.minimum(x, limit)) for place in (3.0, 3.1)]
    found, gain = limit_under_impacts(tests, at(3.0))
    assert (gain > 12.0) is is_possible
    assert found == pytest.approx(limit, rel=0.02) if is_possible else np.isnan(found)


@pytest.mark.parametrize("share", [0.0, 1e-4])
def test_noise_that_no_impact_exceeds_is_no_limit(share):
    assert limit_under_impacts([hammer_input(3.0, share=share), hammer_input(9.0, share=share)], at(3.0))[1] == 0.0


def test_a_range_that_the_file_states_is_no_fault():
    """No impact below it is left."""
    assert limit_under_impacts([hammer_input(3.0, lambda x: np.clip(x, -24.0, 24.0), limit=24.0)], at(3.0))[1] == 0.0


def test_a_missing_channel_has_no_limit():
    assert limit_under_impacts([hammer_input(3.0, uneven)], at(3.0, "B"))[1] == 0.0
    assert limit_under_impacts([], at(3.0))[1] == 0.0


def two_tests():
    return [hammer_input(3.0, uneven), hammer_input(3.1, uneven)]


def campaign(names="ABC", hammer=(), peaks=()):
    """Sensors 3 m apart, the first at the impacts; of each passage the peak of A and that of all others."""
    sensors = [at(3.0 * (k + 1), name) for k, name in enumerate(names)]
    channels = tuple(Channel(name, "acceleration") for name in names)
    wave, passages = np.sin(np.linspace(0.0, 50.0, 1001)), []
    for own_peaks, theirs in peaks:
        samples = np.outer([own_peaks, *[theirs] * (len(names) - 1)], wave)
        passages.append(SimpleNamespace(recording=Recording(samples, 2000.0, channels)))
    return SimpleNamespace(sensors=sensors, hammer=hammer, passages=passages)


@pytest.mark.parametrize("names, found", [("ABC", ["A"]), ("AB", ["A"]), ("A", [])])
def test_impacts_alone_show_a_limit_unless_there_is_only_one_channel(names, found):
    known = saturated_channels(campaign(names, two_tests()), 12.0)
    assert list(known) == found
    assert all(c.limit == pytest.approx(30.0, rel=0.05) for c in known.values())


@pytest.mark.parametrize("peak, found", [(40.0, ["A"]), (45.0, [])])
def test_no_limit_is_far_below_the_peaks_of_trains(peak, found):
    """A square wave of 30 overshoots to 38 m/s² in the recorder's filter; the larger side by a tenth more."""
    assert list(saturated_channels(campaign(hammer=two_tests(), peaks=[(peak, 200.0)]), 12.0)) == found


@pytest.mark.parametrize("of_b, found", [(30.0, ["A", "B"]), (35.0, ["A", "B"]), (51.0, [])])
def test_two_limits_that_differ_are_no_fault_of_the_channels(monkeypatch, of_b, found):
    """Each limit has an error of 10 %. A rattling guard rail stops the peaks of each sensor at its own value."""
    limits = {"A": (30.0, 40.0), "B": (of_b, 40.0)}
    monkeypatch.setattr(saturation, "limit_under_impacts", lambda hammer, sensor: limits.get(sensor.name, (30.0, 0.0)))
    assert list(saturated_channels(campaign(), 12.0)) == found


@pytest.mark.parametrize("limit, share", [(30.0, 1.0), (10.0, 0.0)])
def test_the_evidence_of_impacts_and_trains_for_one_limit_is_added(limit, share):
    """Trains of 60 to 300 m/s² of which A shows no more than ``limit``, impacts of which it shows 30."""
    peaks = [(min(limit, 0.3 * peak), peak) for peak in (60.0, 90.0, 130.0, 180.0, 240.0, 300.0)]
    by_trains, by_impacts = (
        saturated_channels(campaign(hammer=hammer, peaks=rolls), 3.0)["A"]
        for hammer, rolls in (((), peaks), (two_tests(), ()))
    )
    both = saturated_channels(campaign(hammer=two_tests(), peaks=peaks), 3.0)["A"]
    plainer, lesser = sorted((by_trains, by_impacts), key=lambda c: -c.gain)
    assert both.limit == plainer.limit
    assert both.gain == pytest.approx(plainer.gain + share * (lesser.gain + np.log(3.0)))
