"""Frames of a residual: a level that exceeds the differences between intact recordings."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.residual_attribution import Attribution, attribute
from turnout.mismatch.engine.verification import Verification
from turnout.report.finding_text import facts
from turnout.stages.finding_row import finding_row

OF_A_ROW = {"place_low_m": 2.4, "place_high_m": 8.7, "wheel_within_m": None, "evidence_json": None,
            "n_hammer_tests": 6, "n_passages": 8, "n_sensors": 4}  # fmt: skip


def test_a_train_with_a_high_level_is_found_although_its_axles_are_frames_too():
    """Two nepers of log energy are 8.7 dB; 36 cells of each train err by 0.5 / 6 neper, 0.4 dB."""
    rng, trains = np.random.default_rng(0), ("ic3", "freight", "railcar", "locomotive")
    cells = [(t, a, s, p) for t in trains for _ in range(2) for a in range(4) for s in "ABC" for p in range(6)]
    labels = {
        "place": [str(p) for *_, p in cells],
        "sensor": [s for _, _, s, _ in cells],
        "train": [t for t, *_ in cells],
        "wheel": [f"{t}, axle {a + 1}" for t, a, *_ in cells],
    }
    labels = {name: np.array(levels, dtype=object) for name, levels in labels.items()}
    energy = 0.5 * rng.normal(size=len(cells)) + 2.0 * np.array([t == "freight" for t, *_ in cells])
    found = {f.frame: f for f in attribute(energy, labels)}
    assert found["train"].level == "freight" and found["train"].q < 0.01
    assert found["train"].effect == pytest.approx(8.7, abs=1.2)


TRAINS = {("railcar", 8): (70, 90, 110), ("locomotive", 4): (75, 120), ("loaded", 8): (65, 85, 100)}
USUAL = {
    "sensor": 0.4,
    "wheel": 0.2,
    "place": 0.25,
    "condition": 0.3,
    "seen by": 0.3,
}  # nepers: 2, 1, 1, 1.5 dB of level


def cells_of_passages(seed, **raised):
    """(log energy, labels) of eight passages over four sensors: cells of a sensor, a wheel, a bay, a passage, and of a
    passage at a sensor share a level of their own; ``raised`` level of a frame: by so many nepers."""
    rng, sensors = np.random.default_rng(seed), {"A1": 2, "A2": 7, "A3": 12, "A4": 17}
    cells = [
        (name, f"{train}, axle {a}", f"{0.6 * (x + b):.1f}", train, f"{speed} km/h", f"{name} {speed}")
        for (train, axles), speeds in TRAINS.items() for speed in speeds
        for name, x in sensors.items() for a in range(axles) for b in range(-4, 5)
    ]  # fmt: skip
    frames = ("sensor", "wheel", "place", "train", "condition", "seen by")
    labels = {n: np.array(v, dtype=object) for n, v in zip(frames, zip(*cells))}
    energy = rng.normal(size=len(cells))
    for name, spread in USUAL.items():
        levels, code = np.unique(labels[name].astype(str), return_inverse=True)
        energy += (spread * rng.normal(size=levels.size))[code]
    for name, (level, more) in raised.items():
        energy += more * (labels[name] == level)
    labels.pop("seen by")
    return energy, labels


def test_intact_recordings_have_a_frame_below_five_per_cent_in_five_of_a_hundred():
    """Also for correlated cells of a level: shuffles of single cells gave three to five such frames each."""
    called = sum(any(f.q < 0.05 for f in attribute(*cells_of_passages(seed))) for seed in range(200))
    low, high = binom.interval(0.95, 200, 0.05)
    assert low <= called <= high


@pytest.mark.parametrize(("frame", "level"), [("place", "6.0"), ("wheel", "railcar, axle 3")])
def test_a_bay_or_a_wheel_of_twice_the_amplitude_is_found(frame, level):
    """Twice the amplitude are 1.4 nepers of energy, 6 dB."""
    found = [attribute(*cells_of_passages(seed, **{frame: (level, 1.5)})) for seed in range(25)]
    of_frame = [next(f for f in frames if f.frame == frame) for frames in found]
    assert sum(f.q < 0.05 and f.level == level for f in of_frame) >= 18


def diagnosed(answer, candidates, frames):
    fit = SimpleNamespace(
        candidates=candidates, psi=np.array([5e-3]), psi_se=np.array([1e-4]), terms=(), part=lambda _: slice(0, 1)
    )
    verdict = SimpleNamespace(
        answer=answer, names=tuple(c.family for c in candidates), grade="", probability=0.9, reason="", is_finished=True
    )
    check = Verification(1, 1.0)
    return SimpleNamespace(
        fit=fit, verdict=verdict, verdicts=(verdict,), probability=0.9, verification=check, frames=frames, where=None
    )  # fmt: skip


def test_a_frame_of_the_residual_gives_a_row_no_position():
    """An effect of the whole track is in no sensor, and without a missing effect there is no position."""
    effect = physics.PadTemperature
    warm = Candidate.of("pad_temperature", effect.parameters, lambda p: effect(**p), (), {}, "condition")
    frames = [
        Attribution("sensor", "A2", 1.9, 0.1, 1e-3, 4e-3, 1253),
        Attribution("condition", "73 km/h", 1.0, 0.1, 0.2, 0.3, 1253),
    ]
    named = diagnosed("named", (warm,), frames)
    named.fit.terms = (warm.term(named.fit.psi),)
    row = finding_row(named, {})
    assert (row["channel"], row["locked_to"], row["p_value"]) == (None, "condition", 0.3)
    assert dict(facts(row | OF_A_ROW))["Where"] == "everywhere among these sensors"
    row = finding_row(diagnosed("none", (), frames), {})
    assert (row["channel"], row["locked_to"], row["p_value"], row["position_m"]) == (None, None, None, None)
    assert dict(facts(row | OF_A_ROW))["Where"] == "examined: 2.4 to 8.7 m"
