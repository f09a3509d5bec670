"""Mains hum has its own phase in each recording, which the channel shows while no wheel is near."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.channel_lines import SteadyLine, line_without_wheel, mains_lines, strongest_lines

AMPLITUDE = 2.0  # [m/s²]
SILENCE = 3.0  # behind each train [s]
PHASES = (0.4, -2.9, 1.7, 3.0, -1.1, 2.2, -0.3, 0.9)  # [rad]


@pytest.mark.parametrize("frequency", [50.0, 49.97, 50.05])
@pytest.mark.parametrize("phase", PHASES)
def test_frequency_and_phase_are_those_of_the_line_across_a_gap_and_beside_an_offset(phase, frequency):
    """The trial frequencies are a twentieth of a turn over the gap of 2 s apart."""
    time = np.concatenate([np.arange(0.02, 0.31, 1e-3), np.arange(2.113, 2.4, 1e-3)])
    turns = 2.0 * np.pi * frequency * time
    lines = mains_lines(np.array([np.sin(turns + phase), 0.3 * np.sin(turns - phase) + 5.0]), time, 50.0)
    for found, expected in zip(lines, (phase, -phase)):
        assert found[0] == pytest.approx(frequency, abs=0.011)
        middle = 2.0 * np.pi * (found[0] - frequency) * np.mean(time) + found[1] - expected
        assert np.angle(np.exp(1j * middle)) == pytest.approx(0.0, abs=0.01)


def test_with_noise_alone_the_frequency_follows_its_prior():
    """Without a line the prior decides: the mean of the squares is near its variance, not that of the trial range."""
    rng, time = np.random.default_rng(3), np.concatenate([np.arange(0.0, 0.5, 4e-3), np.arange(6.0, 6.5, 4e-3)])
    deviations = [f - 50.0 for f, _ in mains_lines(rng.normal(size=(200, time.size)), time, 50.0)]
    assert np.sqrt(np.mean(np.square(deviations))) < 0.05  # a uniform choice among the trials: 0.07


def test_the_phase_of_hum_without_a_known_line_refers_to_the_start_of_the_record():
    hum = physics.Hum("A3", 0.8, 0.6)
    assert hum.under_conditions({"start": 0.25}) == replace(hum, start=0.25)
    assert hum.under_conditions({"hum_lines": {"A1": (49.9, 1.2)}}) == hum
    seen = hum.under_conditions({"hum_lines": {"A1": (49.9, 1.2), "A3": (50.1, 0.7)}})
    assert (seen.frequency, seen.phase) == (50.1, 0.7)


@pytest.mark.parametrize("frequency", [16.5, 50.0, 83.0])
def test_the_strongest_line_of_two_stretches_has_its_frequency_size_and_evidence(frequency):
    """White noise of 0.5 m/s² beside a line of 2 m/s², which has 96 % of the power within 10 Hz."""
    rng, step, n = np.random.default_rng(8), 4e-3, 125
    times = [np.arange(n) * step, 7.3 + np.arange(n) * step]
    loud = [2.0 * np.sin(2.0 * np.pi * frequency * t) + 0.5 * rng.normal(size=n) + 3.0 for t in times]
    quiet = [0.5 * rng.normal(size=n) for _ in times]
    line, noise = strongest_lines([np.array(rows) for rows in zip(loud, quiet)], step, 112.0)
    assert line.frequency == pytest.approx(frequency, abs=0.5)
    assert line.rms == pytest.approx(np.sqrt(2.0), rel=0.1)
    assert line.evidence > 40.0
    assert noise.evidence < 6.0 and noise.rms < 0.25


@pytest.mark.parametrize("low, high", [(4.0, 110.0), (20.0, 40.0), (4.0, 12.0)])
def test_noise_of_any_colour_is_no_line(low, high):
    """A choice among all trial frequencies costs its logarithm, and the line is compared with its neighbours."""
    rng, step, n = np.random.default_rng(5), 4e-3, 4000
    spectrum = np.fft.rfft(rng.normal(size=(40, n)), axis=1)
    grid = np.fft.rfftfreq(n, step)
    noise = np.fft.irfft(spectrum * ((grid > low) & (grid < high)), n, axis=1)
    lines = strongest_lines([noise[:, 500:625], noise[:, 3000:3125]], step, 112.0)
    assert np.median([line.evidence for line in lines]) < 8.0


def test_a_stretch_of_two_periods_is_needed():
    assert strongest_lines([np.ones((2, 10))], 4e-3, 40.0) == []


def hum_campaign(frequency, amplitude=AMPLITUDE):
    """Passages with hum in S3 that starts at another phase in each."""
    campaign = intact_campaign((24.0,), 7)
    passages = []
    for passage, phase in zip(campaign.passages, PHASES):
        recording = passage.recording
        samples = np.pad(recording.samples, ((0, 0), (0, int(SILENCE * recording.rate))))
        time = np.arange(samples.shape[1]) / recording.rate
        samples[recording.index("S3")] += amplitude * np.sin(2.0 * np.pi * frequency * time + phase)
        passages.append(replace(passage, recording=replace(recording, samples=samples)))
    return replace(campaign, passages=tuple(passages))


@pytest.mark.parametrize("frequency, most", [(50.0, 0.1), (50.1, 0.1)])
def test_one_amplitude_describes_the_hum_of_all_recordings(frequency, most):
    """Recordings start at any phase. The effect adds to each prediction the line that was added to the recording.

    Mains that are 0.1 Hz off turn by 36 degrees in a second.
    """
    campaign = hum_campaign(frequency)
    case, phases = TrackCase(campaign), dict(zip((p.name for p in campaign.passages), PHASES))
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    compared = 0
    for name, aligned in case.aligned_passages.items():
        if frequency == 50.0:
            turn = 2.0 * np.pi * (aligned.hum_lines["S3"][0] - frequency) * float(np.mean(aligned.time))
            error = turn + aligned.hum_lines["S3"][1] - phases[name]
            assert np.angle(np.exp(1j * error)) == pytest.approx(0.0, abs=0.05)
        if aligned.high < 60.0:  # the band of a slow train ends below the line
            continue
        (o,) = (o for o in (*case.observations, *case.reserved) if o.name == name)
        (before,), (after,) = (case.predict(values, terms, [o]) for terms in ((), (physics.Hum("S3", AMPLITUDE),)))
        change = (after - before).reshape(o.rows, -1)
        k = [s.name for s in aligned.sensors].index("S3")
        line = AMPLITUDE * np.sin(2.0 * np.pi * frequency * aligned.time + phases[name]) * (1.0 + values["gain_S3"])
        inside = slice(line.size // 10, -line.size // 10)  # the band rings at the ends of the simulation
        compared += 1
        error = np.linalg.norm((change[k] - line)[inside]) / np.linalg.norm(line[inside])
        assert error < most and not np.any(np.delete(change, k, axis=0))
    assert compared >= 2
    answer = line_without_wheel(case)
    assert (answer.frame, answer.level) == ("sensor", "S3") and answer.nats > 100.0
    assert "channel S3 shows a line at 50 Hz" in answer.words


def test_weak_hum_is_not_reported():
    assert line_without_wheel(TrackCase(hum_campaign(50.0, 0.1))) is None


def case_with_lines(*lines):
    """One channel with a response of 1 m/s² rms in each passage, and (end of the band, frequency, rms) of a line."""
    response = np.tile([1.0, -1.0], 20)
    passages = {
        f"passage {k}": SimpleNamespace(
            sensors=(SimpleNamespace(name="A1"),), high=high, steady_lines={"A1": SteadyLine(frequency, rms, 30.0)}
        )
        for k, (high, frequency, rms) in enumerate(lines)
    }
    observations = [SimpleNamespace(name=name, data=response, rows=1) for name in passages]
    site = SimpleNamespace(sensors=(SimpleNamespace(name="A1"),))
    return SimpleNamespace(aligned_passages=passages, observations=observations, predictor=SimpleNamespace(site=site))


@pytest.mark.parametrize(
    "lines, evidence",
    [
        ([(112.0, 50.0, 0.3), (112.0, 50.5, 0.3), (112.0, 49.5, 0.25)], 90.0),
        ([(112.0, 50.0, 0.3), (112.0, 37.0, 0.3), (112.0, 22.0, 0.25)], None),  # rumble has another frequency each time
        ([(112.0, 50.0, 0.3), (112.0, 50.0, 0.3), (112.0, 22.0, 0.25)], 60.0),  # most passages show it
        ([(112.0, 50.0, 0.3), (40.0, 22.0, 0.01), (40.0, 22.0, 0.01)], 30.0),  # the band of slow trains ends below it
        ([(112.0, 50.0, 0.16), (112.0, 50.0, 0.16), (112.0, 50.0, 0.3)], None),  # too small in most passages
    ],
)
def test_a_steady_line_has_one_frequency_in_most_passages_whose_band_contains_it(lines, evidence):
    answer = line_without_wheel(case_with_lines(*lines))
    assert (answer.nats if answer else None) == evidence
