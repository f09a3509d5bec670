"""Double impacts, overloads and outlying impacts are found, without false ones. Benchmarks have the statistics."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.hammer_test.agreement import following_gain, pairwise_coherence, response_gain
from turnout.hammer_test.force_tops import top_share
from turnout.hammer_test.impact_quality import rail_code
from turnout.signal.filters import FAMILIES, force_pulse

RATE = 20_000.0


def findings(impact):
    return [r.reason for r in (*impact.rejections, *impact.notes)]


def with_limits(recording, *limits):
    return replace(recording, channels=tuple(replace(c, limit=x) for c, x in zip(recording.channels, limits)))


@pytest.mark.parametrize(
    "contact, delay", [(1e-4, 4e-3), (1e-4, 50e-3), (5e-4, 4e-3), (1.5e-3, 4e-3), (3e-3, 6e-3), (3e-3, 50e-3)]
)
def test_a_second_impact_of_five_percent_is_found_and_measured(hammer, contact, delay):
    recordings = hammer.recordings(3, contact=contact)
    both = hammer.force(contact=contact) + hammer.force(peak=250.0, contact=contact, start=5e-3 + delay)
    impacts = hammer.impacts([*recordings, hammer.recording(hammer.samples(both), 3)])
    assert [findings(i) for i in impacts] == [[]] * 3 + [["double_hit"]]
    found = (*impacts[3].rejections, *impacts[3].notes)[0]
    assert found.value == pytest.approx(0.05, rel=0.1) and f"{1e3 * delay:+.1f} ms" in found.detail
    after = impacts[3].contact_end >= (5e-3 + delay) * RATE
    assert after or impacts[3].force.size < (5e-3 + delay) * RATE  # no decay contains the second impact
    assert impacts[3].contact < 1.2 * contact + 1e-4


def test_a_weak_contact_before_the_impact_is_a_double_impact(hammer):
    both = hammer.force(start=15e-3) + hammer.force(peak=800.0, start=5e-3)
    (impact,) = hammer.impacts([hammer.recording(hammer.samples(both))])
    assert findings(impact) == ["double_hit"] and "-10.0 ms" in (*impact.rejections, *impact.notes)[0].detail


def test_the_settings_decide_whether_double_impacts_are_used(hammer):
    strong = hammer.force() + hammer.force(peak=4500.0, start=15e-3)
    recording = [hammer.recording(hammer.samples(strong))]
    (moved,), (rejected,) = hammer.impacts(recording), hammer.impacts(recording, double_hit="reject")
    assert moved.accepted and moved.notes[0].reason == "double_hit" and "starts after" in moved.notes[0].detail
    assert moved.decay_start / RATE > 16.5e-3
    assert not rejected.accepted and rejected.rejections[0].reason == "double_hit"
    # After a second contact in the middle of a damped decay no usable part remains.
    (too_late,) = hammer.impacts(
        [hammer.recording(hammer.samples(hammer.force() + hammer.force(peak=300.0, start=25e-3)))]
    )
    assert not too_late.accepted and "of the decay is left" in too_late.rejections[0].detail


def test_a_note_states_that_fast_impacts_of_a_machine_can_be_separated(hammer):
    """Six equal impacts 150 ms apart count as one with further contacts, unless the settings allow this separation."""
    many = sum(hammer.force(start=5e-3 + 0.15 * k, n=round(0.9 * RATE)) for k in range(6))
    recording = [hammer.recording(hammer.samples(many))]
    (one,) = hammer.impacts(recording)
    (note,) = one.notes
    assert "further contacts: 5" in note.detail and "set receptance.separation below" in note.detail
    assert [i.accepted for i in hammer.impacts(recording, separation=0.1)] == [True] * 6


def test_a_second_impact_after_the_decay_only_ends_the_record(hammer):
    late = hammer.samples(hammer.force() + hammer.force(peak=300.0, start=90e-3))
    (cut,) = hammer.impacts([hammer.recording(late)])
    assert cut.accepted and findings(cut) == ["double_hit"] and "cut before it" in cut.notes[0].detail
    assert cut.acceleration.size == cut.force.size and cut.force.size == pytest.approx(90e-3 * RATE, abs=8)
    assert cut.decay_start == cut.contact_end + 5 and cut.force[cut.decay_start :].max() < 10.0
    (strict,) = hammer.impacts([hammer.recording(late)], double_hit="reject")
    assert not strict.accepted


def test_hum_and_a_drifting_zero_are_no_second_impacts(hammer):
    t = np.arange(4000) / RATE
    recordings = hammer.recordings(4)
    hum = [replace(r, samples=r.samples + np.stack([100 * np.sin(314.16 * t + 1), 0 * t])) for r in recordings]
    undershoot = [
        replace(r, samples=r.samples - np.stack([150 * np.exp(-t / 0.1) * (t > 6e-3), 0 * t])) for r in recordings
    ]
    for changed in (hum, undershoot):
        assert not any(findings(i) for i in hammer.impacts(changed))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("contact", [6e-4, 3e-3])
@pytest.mark.parametrize("steps", [100, 2000])
def test_intact_pulses_are_no_overload_on_a_quiet_converter(hammer, family, contact, steps):
    recordings = []
    for r in hammer.recordings(6, noise=(0.0, 1e-3), family=family, contact=contact):
        step = r.samples[0].max() / steps
        recordings.append(replace(r, samples=np.stack([np.round(r.samples[0] / step) * step, r.samples[1]])))
    assert not any(findings(i) for i in hammer.impacts(recordings))


@pytest.mark.parametrize("family", FAMILIES)
def test_hard_analog_and_soft_clipping_are_found(hammer, family):
    def test_with(distort, noise):
        force = distort(hammer.force(peak=8000.0, family=family))
        return hammer.impacts([*hammer.recordings(6, family=family), hammer.recording(hammer.samples(force, noise), 6)])

    hard = test_with(lambda f: np.minimum(f, 6500.0), (0.0, 1e-3))
    analog = test_with(lambda f: np.minimum(f, 6500.0), (5e-3, 1e-3))
    soft = test_with(lambda f: 6500.0 * np.tanh(f / 6500.0), (1e-4, 1e-3))
    for impacts, words in ((hard, "repeats its highest code"), (analog, "flat"), (soft, "flat")):
        assert [findings(i) for i in impacts] == [[]] * 6 + [["overload"]]
        assert words in impacts[6].rejections[0].detail


@pytest.mark.parametrize(("level", "is_flat"), [(0.9, True), (1.0, False)])
def test_equal_clipping_of_all_impacts_is_not_mistaken_for_the_shape_of_the_tip(hammer, level, is_flat):
    """A half-sine cut at 0.9 of its peak is flat over acos(0.855) / acos(0.45) = 0.49 of its half width, all alike."""
    force = np.minimum(hammer.force(peak=8000.0, family="half-sine"), 8000.0 * level)
    impacts = hammer.impacts([hammer.recording(hammer.samples(force, (5e-3, 1e-3)), k) for k in range(6)])
    assert [findings(i) for i in impacts] == [["overload"] if is_flat else []] * 6


def test_a_clipped_response_and_a_known_range_are_overloads(hammer):
    recordings = hammer.recordings(5)
    samples = recordings[0].samples.copy()
    samples[1] = np.clip(samples[1], -0.6 * np.abs(samples[1]).max(), 0.6 * np.abs(samples[1]).max())
    impacts = hammer.impacts([*recordings[1:], hammer.recording(samples, 9)])
    assert [findings(i) for i in impacts] == [[]] * 4 + [["overload"]]
    assert "rail repeats" in impacts[-1].rejections[0].detail
    (known,) = hammer.impacts([with_limits(recordings[0], 3000.0, None)])
    assert known.rejections[0].reason == "overload" and known.rejections[0].limit == 3000.0


@pytest.mark.parametrize("zero", [-60.0, -30.0, 0.0, 30.0, 60.0])
def test_the_recorded_signal_reaches_a_range_and_not_the_signal_less_its_zero_offset(hammer, zero):
    """Impacts of 4.5 to 6.5 kN in 0.3 ms have 3 samples at the limit of 3 kN: too few to be detected by their shape."""

    def recordings(peaks):
        for k, peak in enumerate(peaks):
            samples = hammer.samples(hammer.force(peak=peak, contact=3e-4), noise=(0.0, 1e-3))
            samples[0] = np.clip(samples[0] + zero, -3000.0, 3000.0) + hammer.rng.normal(size=samples.shape[1])
            yield with_limits(hammer.recording(samples, k), 3000.0, None)

    clipped = hammer.impacts(list(recordings(hammer.rng.uniform(4500.0, 6500.0, 8))))
    assert [findings(i) for i in clipped] == [["overload"]] * 8
    # The noise of 1 N is a third of the 3 N by which "reached" is less than the limit itself.
    assert clipped[3].rejections[0].value == pytest.approx(3000.0, abs=5.0)
    within = hammer.impacts(list(recordings([2980.0 - zero] * 2)))
    assert [i.accepted for i in within] == [True, True]


@pytest.mark.parametrize("share", [-0.3, 0.3])
def test_the_range_of_a_response_is_that_of_its_recording(hammer, share):
    samples = hammer.recordings(1)[0].samples
    samples = samples + np.array([[0.0], [share * np.abs(samples[1]).max()]])
    reached = np.abs(samples[1]).max()
    for limit, found in ((0.99 * reached, ["overload"]), (1.01 * reached, [])):
        assert [findings(i) for i in hammer.impacts([with_limits(hammer.recording(samples), None, limit)])] == [found]


def test_three_equal_samples_by_chance_are_no_limit_of_the_converter():
    rng = np.random.default_rng(8)
    t = np.arange(4000)
    alarms = [rail_code(np.round(40 * np.sin(t / 9.0 + p) * np.exp(-t / 500) + rng.normal(size=4000)), 1.0, 1.0)
              for p in rng.uniform(0, 6.3, 200)]  # fmt: skip
    assert alarms == [None] * 200


@pytest.mark.parametrize("family, share", [("half-sine", 0.3033), ("haversine", 0.2871), ("Hertzian", 0.2923)])
def test_top_share_has_its_closed_form(family, share):
    class About:
        onset, end, half_width = 1, 199, 100.0

    pulse = force_pulse(family, np.arange(201) / 200.0, 1.0)
    # acos(0.95)/acos(0.5); the same of the square root; of the power 2/3
    assert top_share(pulse, About) == pytest.approx(share, abs=2e-3)


def test_an_outlying_impact_is_reported_with_both_coherences(hammer):
    recordings = hammer.recordings(6)
    other = hammer.samples(hammer.force())
    other[1] = np.convolve(other[1], [0.2, -0.5, 0.9, 0.4, -0.8], mode="same")[::1] + 0.3 * np.roll(other[1], 55)
    impacts = hammer.impacts([*recordings[:3], hammer.recording(other, 9), *recordings[3:]])
    assert [findings(i) for i in impacts] == [[], [], [], ["odd_one_out"], [], [], []]
    assert "with it" in impacts[3].rejections[0].detail and "without" in impacts[3].rejections[0].detail


def test_a_response_of_opposite_sign_is_reported_even_if_a_third_of_the_test_has_it(hammer):
    recordings = hammer.recordings(9)
    turned = [replace(r, samples=r.samples * [[1], [-1]]) if r.record % 3 == 0 else r for r in recordings]
    impacts = hammer.impacts(turned)
    assert [i.accepted for i in impacts] == [k % 3 != 0 for k in range(9)]
    assert all("opposite sign" in impacts[k].rejections[0].detail for k in (0, 3, 6))


@pytest.mark.parametrize("n, is_found", [(2, False), (3, False), (4, True)])
def test_an_outlying_impact_is_found_only_if_three_others_agree(hammer, n, is_found):
    recordings = hammer.recordings(n)
    recordings[1] = replace(recordings[1], samples=recordings[1].samples * [[1], [-1]])
    assert [findings(i) for i in hammer.impacts(recordings)] == [
        ["odd_one_out"] if k == 1 and is_found else [] for k in range(n)
    ]


def test_coherences_of_pairs_are_symmetric_and_between_0_and_1():
    rng = np.random.default_rng(3)
    force, acceleration = rng.standard_normal((2, 7, 40, 2)) @ [1.0, 1j]
    pairs = pairwise_coherence(force, acceleration)
    assert np.array_equal(pairs, pairs.T) and (np.diag(pairs) == 1.0).all()
    # Two unrelated records: z = 1 - (1 - p) at the median, 0.5, here the median of 40 lines.
    assert 0.2 < np.median(pairs[pairs < 1.0]) < 0.8


def test_a_shifted_resonance_is_no_change_of_amplitude():
    f = np.arange(20.0, 1200.0, 5.0)
    force = np.outer([5.0, 4.0, 6.0, 5.0, 5.5], np.ones(f.size))
    own = 616.0 * np.array([[1.0], [1.0], [1.0], [1.03], [0.97]])
    acceleration = force * (1j * f) ** 2 / (own**2 - f**2 + 2j * 0.066 * own * f)
    # The area under a resonance of acceleration is proportional to the frequency: a shift of 3 % changes it by as much.
    assert response_gain(force, acceleration) == pytest.approx(1.0, abs=0.05)


def test_a_part_of_a_response_that_follows_no_force_is_no_change_of_its_gain():
    """A line of 50 Hz with a quarter of the power of the response raises that by 25 %, and nothing that follows."""
    f = np.arange(20.0, 800.0, 5.0)
    force = np.outer([5.0, 4.0, 6.0, 5.0, 5.5], np.ones(f.size)).astype(complex)
    acceleration = force * (1j * f) ** 2 / (160.0**2 - f**2 + 0.2j * 160.0 * f)
    quadrature = 1j * acceleration[2, f == 50.0] / np.abs(acceleration[2, f == 50.0])
    hum, clipped = acceleration.copy(), force.copy()
    hum[2, f == 50.0] += quadrature * 0.5 * np.linalg.norm(acceleration[2])
    clipped[2] *= 0.8
    assert response_gain(force, hum)[2] == pytest.approx(np.sqrt(1.25), abs=0.05)
    usual = np.arange(5) != 2
    assert following_gain(force, hum, usual) == pytest.approx(1.0, abs=1e-9)
    assert following_gain(clipped, acceleration, usual)[2] == pytest.approx(1.25)


def test_hum_in_the_hardest_impacts_is_no_overload_of_the_hammer(hammer):
    """Hum of 2 % of the peak in two of eight impacts, the hardest; a force of 0.8 of its size is still found there."""
    peaks, time = np.linspace(4000.0, 6000.0, 8), np.arange(4000) / RATE
    samples = [hammer.samples(hammer.force(peak=p, contact=4e-4, start=25e-3), noise=(1e-4, 1e-3)) for p in peaks]
    for k in (6, 7):
        samples[k][1] += 0.02 * np.abs(samples[k][1]).max() * np.sin(2 * np.pi * 50.0 * time + k)
    impacts = hammer.impacts([hammer.recording(x, k) for k, x in enumerate(samples)])
    assert [findings(i) for i in impacts] == [[]] * 6 + [["odd_one_out"]] * 2 and all(i.accepted for i in impacts)
    samples[7][0] *= 0.8
    impacts = hammer.impacts([hammer.recording(x, k) for k, x in enumerate(samples)])
    assert [i.accepted for i in impacts] == [True] * 7 + [False] and findings(impacts[7]) == ["overload"]
