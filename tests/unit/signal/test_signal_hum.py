"""Hum of the mains is subtracted where most channels share it; vibrations of track and train stay."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from turnout.passage.channel_checks import channel_states
from turnout.records import Channel, Recording
from turnout.signal.cleaning import is_notable, without_artefacts
from turnout.signal.converter import converter_step
from turnout.signal.hum import without_hum

RATE, NAMES = 5000.0, ("A1", "A2", "A3", "A4")
AMPLITUDES = np.array([0.5, 0.3, 0.7, 0.4])  # m/s²
PHASES = np.array([0.1, 1.3, -2.0, 2.6])


def passage(duration=4.0, start=1.2, stop=2.8, rate=RATE, level=20.0):
    """Noise of 0.03 m/s² and, from start to stop, wide-band vibration of 20 m/s² as under a train."""
    rng = np.random.default_rng(5)
    t = np.arange(round(duration * rate)) / rate
    train = (t > start) & (t < stop)
    samples = 0.03 * rng.normal(size=(4, t.size)) + level * train * rng.normal(size=(4, t.size))
    return Recording(samples, rate, tuple(Channel(name, "acceleration") for name in NAMES), "passage"), t


def with_line(recording, t, frequency, rows=(0, 1, 2, 3), factor=1.0):
    samples = recording.samples.copy()
    for i in rows:
        samples[i] += factor * AMPLITUDES[i] * np.sin(2.0 * np.pi * frequency * t + PHASES[i])
    return Recording(samples, recording.rate, recording.channels, recording.kind)


@pytest.mark.parametrize("frequency", [50.0 / 3.0, 16.7, 25.0, 49.96, 50.03, 60.0])
def test_the_line_is_subtracted_also_under_the_train(frequency):
    """The error of a sine fitted to n samples of noise s has the standard deviation s sqrt(2/n) in each component. Its
    frequency is known to sqrt(6) s / (pi T a sqrt(n)), so that the phase errs by less than 0.02 within the record."""
    recording, t = passage()
    hums = with_line(recording, t, frequency)
    cleaned, (finding,) = without_hum(hums)
    assert finding.reason == "mains_hum" and f"line of {frequency:.1f} Hz" in finding.detail
    rest = cleaned.samples - recording.samples
    assert np.all(np.max(np.abs(rest), axis=1) < 0.04 * AMPLITUDES)


def test_an_impact_with_hum_is_as_without():
    """One impact in a quarter of a second, with a decaying response of 150 Hz; the hum is as large as the noise."""
    rate, rng = 20e3, np.random.default_rng(2)
    t = np.arange(5000) / rate
    since = np.clip(t - 0.025, 0.0, None)
    response = 150.0 * np.exp(-60.0 * since) * np.sin(2.0 * np.pi * 150.0 * since)
    force = 9e3 * signal.windows.hann(60).sum() * np.zeros(t.size)
    force[500:560] = 9e3 * signal.windows.hann(60)
    clean = np.stack([force, response, 0.4 * response, 0.1 * response])
    noise = rng.normal(size=clean.shape) * [[2.0], [0.05], [0.05], [0.05]]
    hum = np.outer([0.0, 0.5, 0.5, 0.5], np.sin(2.0 * np.pi * 50.0 * t + 0.7))
    channels = (Channel("hammer", "force"), *(Channel(name, "acceleration") for name in NAMES[:3]))
    cleaned, findings = without_hum(Recording(clean + noise + hum, rate, channels, "hammer"))
    assert [f.reason for f in findings] == ["mains_hum"]
    assert np.array_equal(cleaned.samples[0], (clean + noise)[0])  # the force does not hum
    assert np.max(np.abs(cleaned.samples - clean - noise)[1:]) < 0.03


@pytest.mark.parametrize("rate", [500.0, 1000.0, 5000.0, 20000.0])
@pytest.mark.parametrize("frequency", [50.0 / 3.0, 25.0, 50.0])
@pytest.mark.parametrize("factor", [1.0, 10.0, 40.0])
def test_loud_and_weak_hum_is_subtracted_at_every_sampling_rate(rate, frequency, factor):
    """The least error is that of the fit to noise, 1 % of the weakest line."""
    recording, t = passage(rate=rate)
    hums = with_line(recording, t, frequency, factor=factor)
    rest = without_hum(hums)[0].samples - recording.samples
    assert np.all(np.max(np.abs(rest), axis=1) < 0.03 * factor * AMPLITUDES)


@pytest.mark.parametrize("duration", [10.0, 180.0])
def test_the_memory_for_a_long_record_does_not_grow_with_its_square(duration):
    """180 s at 1 kHz are 5.8 MB of samples; quiet times of 1 s beside the train and 64 trials at a time need less."""
    recording, t = passage(duration, 2.0, duration - 2.0, rate=1000.0)
    hums = with_line(recording, t, 50.0)
    tracemalloc.start()
    cleaned, _ = without_hum(hums)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 12 * hums.samples.nbytes + 30e6
    assert (cleaned is hums) is (duration > 20.0)  # the mains drift during a train of 176 s


def impact(duration, pretrigger, mode=300.0, damping=0.05, amplitude=0.0, rate=20e3):
    """Three responses with a resonance of 300 Hz and another one, beside noise of 0.05 m/s²; and their times."""
    t = np.arange(round(duration * rate)) / rate - pretrigger
    since, rng = np.clip(t, 0.0, None), np.random.default_rng(3)
    response = 150.0 * np.exp(-0.05 * 600.0 * np.pi * since) * np.sin(600.0 * np.pi * since)
    decay = np.exp(-damping * 2.0 * np.pi * mode * since)
    response += amplitude * decay * np.sin(2.0 * np.pi * mode * since)
    samples = np.stack([response, 0.5 * response, 0.2 * response]) + 0.05 * rng.normal(size=(3, t.size))
    return Recording(samples, rate, tuple(Channel(name, "acceleration") for name in NAMES[:3]), "hammer"), t


@pytest.mark.parametrize(
    ("mode", "damping"),
    [(17.0, 0.03), (25.0, 0.03), (25.0, 0.08), (50.0, 0.03), (50.0, 0.05), (50.0, 0.08), (60.0, 0.03)],
)
@pytest.mark.parametrize("pretrigger", [0.0, 0.025])
def test_a_resonance_near_the_mains_is_not_subtracted(mode, damping, pretrigger):
    """It decays from one half of the quiet time to the other, and is not there before the impact."""
    duration = 0.25 if mode > 30.0 or pretrigger else 0.5
    recording, _ = impact(duration, pretrigger, mode, damping, 10.0)
    assert without_hum(recording) == (recording, ())


@pytest.mark.parametrize(
    ("duration", "pretrigger", "mode", "damping"),
    [
        (0.25, 0.0, 16.67, 0.03),  # there is only its decay to tell
        (0.25, 0.0, 25.0, 0.03),
        (0.15, 0.0, 50.0, 0.02),
        (0.5, 0.06, 25.0, 0.02),  # the time before the impact is shorter than two periods
        (1.0, 0.06, 25.0, 0.02),
    ],
)
def test_a_resonance_with_little_damping_is_not_subtracted(duration, pretrigger, mode, damping):
    recording, _ = impact(duration, pretrigger, mode, damping, 10.0)
    assert without_hum(recording) == (recording, ())


@pytest.mark.parametrize("frequency", [49.7, 49.8, 50.2, 50.3])
def test_a_machine_near_the_mains_stays_in_a_record_of_an_impact(frequency):
    """Half a second tells 0.2 Hz by its little noise: a tenth of a turn would be 0.2 Hz."""
    recording, t = impact(0.5, 0.05)
    samples = recording.samples + 0.5 * np.sin(2.0 * np.pi * frequency * t + 1.0)
    hums = replace(recording, samples=samples)
    assert without_hum(hums) == (hums, ())


def test_a_line_in_a_record_without_quiet_times_stays():
    """A record cut to the train: sleepers 0.6 m apart pass at 50 Hz at 30 m/s, and the line is as loud as the train."""
    recording, t = passage(start=-1.0, stop=9.0)
    samples = recording.samples + 20.0 * np.sin(2.0 * np.pi * 50.0 * t)
    vibrates = replace(recording, samples=samples)
    assert without_hum(vibrates) == (vibrates, ())


@pytest.mark.parametrize("duration", [4.0, 20.0, 40.0])
@pytest.mark.parametrize("drift", [0.002, 0.005, 0.05])
def test_mains_that_drift_leave_at_most_what_was_there(duration, drift):
    """A line of one frequency that does not fit is not subtracted."""
    recording, t = passage(duration, 1.2, duration - 1.2)
    line = np.sin(2.0 * np.pi * (50.0 * t + 0.5 * drift * (t - 0.5 * duration) ** 2))
    hums = Recording(recording.samples + np.outer(AMPLITUDES, line), RATE, recording.channels, "passage")
    rest = without_hum(hums)[0].samples - recording.samples
    assert np.all(np.sqrt(np.mean(rest**2, axis=1)) < 1.02 * AMPLITUDES / np.sqrt(2.0))


def test_a_line_whose_phase_jumps_stays():
    recording, t = passage()
    line = np.sin(2.0 * np.pi * 50.0 * t + np.pi * (t > 2.0))
    hums = Recording(recording.samples + np.outer(AMPLITUDES, line), RATE, recording.channels, "passage")
    assert without_hum(hums) == (hums, ())


@pytest.mark.parametrize("factor", [0.6, 1.0, 4.0])
def test_sensors_far_apart_are_all_corrected(factor):
    """The train is loud at one sensor after the other, so that most are quiet at any time."""
    recording, t = passage(8.0, 9.0, 9.0)
    rng = np.random.default_rng(8)
    samples = recording.samples + [20.0 * ((t > 1.5 + k) & (t < 2.5 + k)) * rng.normal(size=t.size) for k in range(4)]
    far = Recording(samples, RATE, recording.channels, "passage")
    rest = without_hum(with_line(far, t, 50.0, factor=factor))[0].samples - samples
    assert np.all(np.max(np.abs(rest), axis=1) < 0.05 * factor * AMPLITUDES)


@pytest.mark.parametrize(
    ("n", "hums", "is_removed"), [(1, 1, True), (2, 1, False), (2, 2, True), (4, 2, False), (4, 3, True)]
)
def test_more_than_half_of_the_accelerations_must_hum(n, hums, is_removed):
    """The hum of fewer is an effect with a name. Other quantities do not count."""
    recording, t = passage()
    line = with_line(recording, t, 50.0, tuple(range(hums)))
    samples = np.vstack([line.samples[:n], recording.samples[:1]])
    channels = (*recording.channels[:n], Channel("displacement", "displacement"))
    assert bool(without_hum(Recording(samples, RATE, channels, "passage"))[1]) is is_removed


@pytest.mark.parametrize(
    ("frequency", "rows"),
    [
        (50.0, (2,)),  # of one channel of four: an effect with a name
        (40.0, (0, 1, 2, 3)),  # a machine
        (50.4, (0, 1, 2, 3)),  # no grid is so far from its frequency
        (100.0, (0, 1, 2, 3)),  # a harmonic alone
    ],
)
def test_other_lines_stay(frequency, rows):
    recording, t = passage()
    hums = with_line(recording, t, frequency, rows)
    cleaned, findings = without_hum(hums)
    assert cleaned is hums and findings == ()


@pytest.mark.parametrize("frequency", [49.7, 49.8, 50.2, 50.3])
@pytest.mark.parametrize("duration", [1.0, 4.0])
def test_a_machine_near_the_mains_stays_also_in_a_short_record(frequency, duration):
    recording, t = passage(duration, 0.3 * duration, 0.7 * duration)
    hums = with_line(recording, t, frequency)
    assert without_hum(hums) == (hums, ())


@pytest.mark.parametrize("step", [0.0, 0.05])
def test_a_response_that_is_clipped_on_one_swing_stays(step):
    """Also with a stated range, and with a converter whose codes lie at halves of its step."""
    recording, t = passage(start=1.5, stop=1.5)
    samples = recording.samples + 150.0 * np.exp(-40.0 * np.clip(t - 1.5, 0.0, None)) * (t > 1.5) * np.sin(
        500.0 * (t - 1.5)
    )
    hums = with_line(Recording(samples, RATE, recording.channels, "hammer"), t, 50.0).samples
    hums = np.minimum(hums, 90.0)
    hums = step * (np.floor(hums / step) + 0.5) if step else hums
    for channels in (recording.channels, tuple(replace(c, limit=90.0) for c in recording.channels)):
        clipped = Recording(hums, RATE, channels, "hammer")
        assert without_hum(clipped) == (clipped, ())


def test_the_steps_of_a_converter_with_an_offset_stay():
    """Codes lie at halves of a step, and the line is rounded to whole steps: two errors of step / sqrt(12)."""
    recording, t = passage()
    step, line = 0.05, with_line(recording, t, 50.0)
    codes = step * (np.floor(line.samples / step) + 0.5)
    cleaned, _ = without_hum(Recording(codes, RATE, recording.channels, "passage"))
    offsets = (cleaned.samples / step) % 1.0
    np.testing.assert_allclose(offsets, 0.5, atol=1e-6)
    assert np.all(np.std(cleaned.samples - recording.samples, axis=1) < 0.6 * step)  # code and line: sqrt(2/12)


def test_two_samples_that_hardly_differ_do_no_harm():
    recording, t = passage()
    hums = with_line(recording, t, 50.0).samples
    hums[0, 100], hums[0, 101] = 0.0, 1e-310
    cleaned, _ = without_hum(Recording(hums, RATE, recording.channels, "passage"))
    assert np.max(np.abs(cleaned.samples - recording.samples)[:, 200:]) < 0.04


def test_vibration_of_50_hz_under_the_train_stays():
    """Sleepers 0.6 m apart pass at 50 Hz at 30 m/s."""
    recording, t = passage()
    samples = recording.samples + 5.0 * ((t > 1.2) & (t < 2.8)) * np.sin(2.0 * np.pi * 50.0 * t)
    vibrates = Recording(samples, RATE, recording.channels, "passage")
    assert without_hum(vibrates) == (vibrates, ())


def test_channels_without_signal_are_not_asked():
    recording, t = passage()
    hums = with_line(recording, t, 50.0)
    samples = np.vstack([hums.samples, np.full(t.size, np.nan), np.zeros(t.size)])
    channels = (*hums.channels, Channel("broken", "acceleration"), Channel("dead", "acceleration"))
    cleaned, (finding,) = without_hum(Recording(samples, RATE, channels, "passage"))
    assert "in 4 channels" in finding.detail and np.isnan(cleaned.samples[4]).all() and not cleaned.samples[5].any()


def test_channels_that_repeat_one_value_stay_so_that_later_checks_find_it():
    """A range of 30 m/s² that cuts off the train, a drop-out of 0.1 s, a sensor that is lost 0.3 s before the end."""
    recording, t = passage()
    hums = with_line(recording, t, 50.0).samples.round(2)  # converter steps of 0.01 m/s²
    hums[0] = np.clip(hums[0], -30.0, 30.0)
    hums[1, 7000:7500] = hums[1, 6999]
    hums[2, -1500:] = hums[2, -1501]
    cleaned, (finding,) = without_hum(Recording(hums, RATE, recording.channels, "passage"))
    assert "in 1 channel," in finding.detail
    before, after = (
        {name: {f.reason for f in state.findings} for name, state in zip(NAMES, channel_states(r))}
        for r in (Recording(hums, RATE, recording.channels, "passage"), cleaned)
    )
    assert before == after == {"A1": {"clipped"}, "A2": {"drop_out"}, "A3": {"sensor_lost"}, "A4": set()}
    assert converter_step(cleaned.samples[3]) == pytest.approx(0.01, rel=1e-6)
    assert np.std(cleaned.samples[3, :5000]) < 0.04  # noise of 0.03 m/s²


@pytest.mark.parametrize("n", [0, 1, 30, 160])
def test_a_record_that_is_too_short_stays(n):
    """Two periods of 60 Hz take 33 ms, 167 samples; below, nothing is judged, also not a clear line."""
    samples = np.random.default_rng(1).normal(size=(4, n)) + 50.0 * np.sin(2.0 * np.pi * 50.0 * np.arange(n) / RATE)
    recording = Recording(samples, RATE, tuple(Channel(name, "acceleration") for name in NAMES), "passage")
    assert without_hum(recording) == (recording, ())


@pytest.mark.parametrize(("factor", "notable"), [(1.0, False), (4.0, True)])
def test_weak_hum_is_not_worth_a_row(factor, notable):
    """The peak of the noise under the train is about 4.2 standard deviations, 84 m/s²: 2 % of it are 1.7 m/s²."""
    recording, t = passage()
    line = np.outer(factor * AMPLITUDES, np.sin(2.0 * np.pi * 50.0 * t))
    _, (finding,) = without_artefacts(
        Recording(recording.samples + line, RATE, recording.channels, "passage"), set(NAMES)
    )
    assert is_notable(finding) == notable
