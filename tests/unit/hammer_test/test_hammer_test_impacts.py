"""Impacts are found, measured, and accepted or rejected: one or many in a record."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.hammer_test import find_impacts, receptance_of
from turnout.hammer_test.contact import measure_contact
from turnout.hammer_test.impact_window import Cut

RATE = 20_000.0


def reasons(impact):
    return [r.reason for r in impact.rejections]


def test_measurements_of_a_half_sine_are_those_of_its_formula(hammer):
    force = hammer.force(peak=5000.0, contact=2e-3, start=5e-3)
    (impact,) = hammer.impacts([hammer.recording(hammer.samples(force))])
    # The first and last 1.3 % of a half-sine lie below 2 % of its peak; a sample is 50 µs.
    assert impact.onset == 101 and impact.contact == pytest.approx(2e-3 * (1 - 2 * np.arcsin(0.02) / np.pi), abs=1e-4)
    assert impact.peak == pytest.approx(5000.0, rel=1e-3)
    assert impact.impulse == pytest.approx(2 / np.pi * 5000.0 * 2e-3, rel=3e-3)
    assert impact.decay_start == impact.contact_end + 5  # 0.2 ms at 20 kHz behind the last sample of contact
    assert impact.noise_force == pytest.approx(0.5, rel=0.3)  # 95 samples ahead: 3 sigma is 22 %
    assert impact.band_edge * 2e-3 == pytest.approx(1.2976, abs=0.02)
    assert impact.accepted and not impact.notes


@pytest.mark.parametrize("polarity", [1, -1])
def test_a_contact_of_few_samples_has_the_measures_of_its_polygon(hammer, polarity):
    """The contact is samples 20 to 24, above 2 % of the peak. Half the peak is crossed at 21 1/6 and at 23 1/2."""
    force = np.zeros(200)
    force[20:26] = [100.0, 400.0, 1000.0, 700.0, 300.0, 15.0]
    recording = hammer.recording(np.stack([force, force]), rate=1000.0)
    force_and_response = polarity * force, np.zeros(200)
    cut = Cut(*force_and_response, 1000.0, 21, 24, polarity, 0.0, recording, recording.channels)
    contact = measure_contact(cut, 0.02)
    assert (contact.onset, contact.end, contact.top) == (20, 24, 22)
    assert contact.peak == polarity * 1000.0
    assert contact.impulse == pytest.approx(polarity * 2500.0 / 1000.0)  # sum of the five samples over the rate
    assert contact.half_width == pytest.approx(23.5 - (22.0 - 5.0 / 6.0))


def test_a_continuous_record_is_cut_into_its_impacts(hammer):
    starts = (0.4, 1.3, 2.9)
    force = sum(hammer.force(peak=p, start=s, n=70_000) for s, p in zip(starts, (4000.0, 6000.0, 5000.0)))
    force += hammer.force(peak=60.0, start=2.1, n=70_000)  # the user puts the hammer down and takes it again
    impacts = hammer.impacts([hammer.recording(hammer.samples(force))])
    assert [round(i.peak, -2) for i in impacts] == [4000, 6000, 5000]
    assert [i.record for i in impacts] == [0, 1, 2] and all(i.accepted for i in impacts)
    # pre-trigger of 50 ms; the first window ends where the second begins, the others after 1 s or at the end
    assert [i.force.size for i in impacts] == pytest.approx([0.9 * RATE, 1.05 * RATE, 0.65 * RATE], abs=3)
    assert all(i.onset == pytest.approx(0.05 * RATE, abs=1) for i in impacts)


def test_impacts_are_numbered_within_their_file(hammer):
    two = hammer.force(start=0.1, n=20_000) + hammer.force(start=0.6, n=20_000)
    one = hammer.force(start=0.1, n=20_000)
    recordings = [
        hammer.recording(hammer.samples(two), 0, "many.wav"),
        hammer.recording(hammer.samples(one), 1, "many.wav"),
        hammer.recording(hammer.samples(one), 7, "single.uff"),
    ]
    assert [(i.source, i.record) for i in hammer.impacts(recordings)] == [
        ("many.wav", 0), ("many.wav", 1), ("many.wav", 2), ("single.uff", 7),
    ]  # fmt: skip


def test_a_reversed_hammer_is_reported_on_every_impact(hammer):
    recordings = [replace(r, samples=r.samples * [[-1], [1]]) for r in hammer.recordings(4)]
    for impact in hammer.impacts(recordings):
        assert reasons(impact) == ["sign_reversed"] and impact.peak < 0
        assert impact.rejections[0].detail.endswith("its sign is reversed, or it is another channel")


def test_records_without_a_usable_impact_have_a_reason(hammer):
    sound = hammer.recordings(4)
    broken = sound[0].samples.copy()
    broken[1, 700:705] = np.nan
    silent = np.stack([hammer.rng.normal(size=4000), hammer.rng.normal(size=4000)])
    dead = sound[1].samples * [[1], [0]]
    loose = np.stack([sound[2].samples[0], hammer.rng.normal(size=4000)])
    flat = sound[3].samples * [[0], [1]]
    bad = [hammer.recording(s, 10 + k) for k, s in enumerate((broken, silent, dead, loose, flat))]
    impacts = hammer.impacts([*sound, *bad])
    assert [reasons(i) for i in impacts[:4]] == [[]] * 4
    assert [i.rejections[0].reason for i in impacts[4:]] == [
        "not_finite", "no_impact", "dead_channel", "dead_channel", "dead_channel",
    ]  # fmt: skip
    assert "5 samples from 700 on" in impacts[4].rejections[0].detail
    assert [i.rejections[0].channel for i in impacts[4:]] == ["rail", None, "rail", "rail", "hammer"]
    assert impacts[4].rejections[0].time == pytest.approx(700 / RATE)


def test_a_gap_in_a_continuous_record_rejects_one_impact(hammer):
    samples = hammer.samples(hammer.force(start=0.1, n=40_000) + hammer.force(start=1.2, n=40_000))
    samples[1, 26_000:26_010] = np.nan
    assert [reasons(i) for i in hammer.impacts([hammer.recording(samples)])] == [[], ["not_finite"]]


def test_a_weak_impact_is_rejected_and_a_strong_one_whose_response_grew_with_it_is_used(hammer):
    recordings = hammer.recordings(6)
    recordings.append(hammer.recording(hammer.samples(hammer.force(peak=600.0)), 6))
    recordings.append(hammer.recording(hammer.samples(hammer.force(peak=40_000.0)), 7))
    impacts = hammer.impacts(recordings)
    assert [reasons(i) for i in impacts] == [[]] * 6 + [["weak"], []]
    assert impacts[6].rejections[0].value == pytest.approx(600.0, rel=0.01)
    assert impacts[6].rejections[0].value < impacts[6].rejections[0].limit


def test_a_force_far_above_the_median_with_a_usual_response_exceeded_its_range(hammer):
    usual = hammer.samples(hammer.force())
    recordings = [*hammer.recordings(6), hammer.recording(usual * np.array([[5.0], [1.0]]), 6)]
    impacts = hammer.impacts(recordings)
    assert [reasons(i) for i in impacts] == [[]] * 6 + [["overload"]]
    assert "the test's median is" in impacts[6].rejections[0].detail


def test_a_noisy_impact_is_rejected_and_an_evenly_noisy_test_is_not(hammer):
    quiet = hammer.recordings(5, noise=(1e-4, 1e-2))
    noisy = hammer.recording(hammer.samples(hammer.force(), noise=(1e-4, 0.08)), 5)
    assert [reasons(i) for i in hammer.impacts([*quiet, noisy])] == [[]] * 5 + [["noisy"]]
    assert all(i.accepted for i in hammer.impacts(hammer.recordings(6, noise=(1e-4, 0.1))))  # 20 dB
    drowned = hammer.impacts(hammer.recordings(6, noise=(1e-4, 0.27)))
    assert {r for i in drowned for r in reasons(i)} <= {"noisy", "dead_channel"} and not any(
        i.accepted for i in drowned
    )


def test_late_and_cut_off_records_are_rejected(hammer):
    recordings = hammer.recordings(4)
    late = hammer.samples(hammer.force(start=0.19))
    # 30 ms, of which 23 ms decay: the ballast mode keeps e^-4 of itself
    short = hammer.recordings(1)[0].samples[:, :600]
    impacts = hammer.impacts([*recordings, hammer.recording(late, 8), hammer.recording(short, 9)])
    assert [reasons(i) for i in impacts] == [[]] * 4 + [["late"], ["cut_off"]]
    # An exponential window ends the leakage that a cut-off record would bring.
    assert hammer.impacts([*recordings, hammer.recording(short, 9)], exponential_window=100.0)[-1].accepted


@pytest.mark.parametrize("begun", [2, 6, 14, 20])
def test_an_impact_that_began_before_its_record_is_rejected(hammer, begun):
    """The record lacks a part of the force but has its response. At 14 of 30 samples H1 would be wrong by 80 %."""
    sound = hammer.recordings(4, noise=(1e-5, 1e-5))
    cut_short = hammer.samples(hammer.force(start=5e-3), (1e-5, 1e-5))[:, 100 + begun :]
    impacts = hammer.impacts([*sound, hammer.recording(cut_short, 9)])
    assert [reasons(i)[:1] for i in impacts] == [[]] * 4 + [["late"]]
    first = 5000.0 * np.sin(np.pi * begun / 30)
    (late,) = [r for r in impacts[-1].rejections if r.reason == "late"]
    assert late.value == pytest.approx(first, abs=30.0)
    assert late.detail == f"the record starts with {late.value:.4g} N: the impact began before it"


def test_an_impact_at_the_very_start_of_its_record_is_whole(hammer):
    recordings = [hammer.recording(r.samples[:, 100:], k) for k, r in enumerate(hammer.recordings(5))]
    assert [i.accepted for i in hammer.impacts(recordings)] == [True] * 5


@pytest.mark.parametrize("digits", [None, "single", "text", "16 bit"])
def test_the_same_test_exported_twice_counts_once(hammer, digits):
    """In another format, under another header, cut at another place: the samples are the same to their rounding."""
    sound = hammer.recordings(5)
    again = []
    for r in sound:
        samples = r.samples[:, 40:]
        if digits == "single":
            samples = samples.astype(np.float32).astype(float)
        elif digits == "text":
            samples = np.array([[float(f"{x:.6g}") for x in row] for row in samples])
        elif digits == "16 bit":
            step = 1.2 * np.abs(samples).max(axis=1, keepdims=True) / 2**15
            samples = step * np.round(samples / step)
        again.append(hammer.recording(samples, r.record, "again.csv"))
    alone, both = hammer.impacts(sound), hammer.impacts([*sound, *again])
    assert [reasons(i) for i in both] == [[]] * 5 + [["duplicate"]] * 5
    assert both[5].rejections[0].detail == "the same samples as record 1 of test.uff"
    assert [i.rejections[0].record for i in both[5:]] == [0, 1, 2, 3, 4]
    assert [i.peak for i in both[:5]] == [i.peak for i in alone]
    assert receptance_of(both).n == 5


def test_similar_impacts_are_no_duplicates(hammer):
    """Equal forces and 80 dB between peak and noise: only their noise differs."""
    force = hammer.force()
    recordings = [hammer.recording(hammer.samples(force, (1e-4, 1e-4)), k) for k in range(6)]
    assert [i.accepted for i in hammer.impacts(recordings)] == [True] * 6


def test_one_impact_alone_is_measured_and_not_compared(hammer):
    (impact,) = hammer.impacts(hammer.recordings(1))
    assert impact.accepted and impact.peak > 3900


def test_a_significant_zero_offset_is_subtracted_and_an_insignificant_one_stays(hammer):
    sound = hammer.recordings(3)
    shifted = [replace(r, samples=r.samples + np.array([[40.0], [25.0]])) for r in sound]
    for a, b in zip(hammer.impacts(sound), hammer.impacts(shifted)):
        assert b.force == pytest.approx(a.force, abs=1e-6) and b.peak == pytest.approx(a.peak, abs=1e-6)
        assert np.mean(b.acceleration - a.acceleration) == pytest.approx(
            0.0, abs=3 * a.noise_acceleration / np.sqrt(90)
        )
    assert sum(np.array_equal(i.acceleration, r.samples[1]) for i, r in zip(hammer.impacts(sound), sound)) >= 2


def test_the_order_of_recordings_does_not_change_the_impacts(hammer):
    recordings = hammer.recordings(7)
    forward, backward = hammer.impacts(recordings), hammer.impacts(recordings[::-1])[::-1]
    for a, b in zip(forward, backward):
        assert a.force.tobytes() == b.force.tobytes() and a.rejections == b.rejections and a.band_edge == b.band_edge


def test_a_missing_channel_is_a_key_error_that_lists_the_channels(hammer):
    with pytest.raises(KeyError, match="hammer"):
        find_impacts(hammer.recordings(1), "hammr", "rail")


def test_no_recordings_give_no_impacts():
    assert find_impacts([], "hammer", "rail") == ()
