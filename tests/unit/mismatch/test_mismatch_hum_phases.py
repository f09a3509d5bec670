"""Mains hum has a phase of its own in each recording, which the channel shows where no wheel is near."""

from dataclasses import replace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.passage_observation import line_phases
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

AMPLITUDE = 2.0  # [m/s²]
SILENCE = 3.0  # behind each train [s]
PHASES = (0.4, -2.9, 1.7, 3.0, -1.1, 2.2, -0.3, 0.9)  # [rad]


@pytest.mark.parametrize("phase", PHASES)
def test_the_phase_is_that_of_the_line_across_a_gap_and_beside_an_offset(phase):
    time = np.concatenate([np.arange(0.02, 0.31, 1e-3), np.arange(2.113, 2.4, 1e-3)])
    lines = [np.sin(100.0 * np.pi * time + phase), 0.3 * np.sin(100.0 * np.pi * time - phase) + 5.0]
    assert line_phases(np.array(lines), time, 50.0) == pytest.approx([phase, -phase], abs=1e-9)


def test_a_channel_without_a_known_phase_hums_from_the_start_of_the_record():
    hum = physics.Hum("A3", 0.8, 0.6)
    assert hum.under_conditions({"start": 0.25}) == replace(hum, start=0.25)
    assert hum.under_conditions({"hum_phases": {"A1": 1.2}}).phase == 0.0
    assert hum.under_conditions({"hum_phases": {"A1": 1.2, "A3": 0.7}}).phase == 0.7


@pytest.mark.parametrize("frequency, most", [(50.0, 0.1), (50.1, 0.2)])
def test_one_amplitude_describes_the_hum_of_all_recordings(frequency, most):
    """Recordings start at any phase. What the effect adds to each prediction is the line that was added to each.

    Mains that are 0.1 Hz off turn by 36 degrees in a second. The phase is right in the middle of the train, as it is
    that before and behind it.
    """
    campaign = measured_campaign(small_plan((15.0,), hammer_positions=(24.0,)), (), 7)
    passages = []
    for passage, phase in zip(campaign.passages, PHASES):
        recording = passage.recording
        samples = np.pad(recording.samples, ((0, 0), (0, int(SILENCE * recording.rate))))
        time = np.arange(samples.shape[1]) / recording.rate
        samples[recording.index("S3")] += AMPLITUDE * np.sin(2.0 * np.pi * frequency * time + phase)
        passages.append(replace(passage, recording=replace(recording, samples=samples)))
    case = TrackCase(replace(campaign, passages=tuple(passages)))
    phases = dict(zip((p.name for p in passages), PHASES))
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    compared = 0
    for name, aligned in case.aligned_passages.items():
        if frequency == 50.0:
            assert np.angle(np.exp(1j * (aligned.hum_phases["S3"] - phases[name]))) == pytest.approx(0.0, abs=0.05)
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
