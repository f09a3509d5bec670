"""Overloads, couplings and windows of loggers and analysers in recordings of one known track.

The programs in ``shared/inputs/recordings/16_signal`` write them: 160 Hz with 0.08 and 560 Hz with 0.06.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.readers import read
from turnout.records import RawChannel, RawDescription
from turnout.stages.hammer import identify_accepted

LAYOUT = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=20000.0,
)


@pytest.fixture(scope="module")
def folder(shared_recordings, tmp_path_factory):
    path = tmp_path_factory.mktemp("signal")
    program = shared_recordings / "16_signal" / "make.py"
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, str(program)], cwd=path, env=environment, check=True, capture_output=True)
    return path


def impacts_of_file(folder, name):
    return find_track_impacts(read(name, folder, LAYOUT).recordings, "force", "rail", ReceptanceSettings())


@pytest.mark.parametrize(
    ("name", "reason", "words"),
    [
        ("clip_all_noisy.npz", "overload", "the top of the force is flat"),
        ("response_clip_filtered.npz", "overload", "whatever the force"),
        ("swapped.npz", "sign_reversed", "or it is another channel"),
    ],
)
def test_a_test_that_cannot_be_used_is_rejected_with_its_reason(folder, name, reason, words):
    impacts = impacts_of_file(folder, name)
    assert len(impacts) == 10 and all(i.rejections[0].reason == reason for i in impacts)
    assert all(words in i.rejections[0].detail for i in impacts)


@pytest.mark.parametrize(
    ("name", "n_accepted", "n_overload"),
    [
        ("clip_some_noisy.npz", 4, 6),
        ("clip_tanh.npz", 7, 3),
        ("ac_coupled_force.npz", 10, 0),
        ("upside_down.npz", 10, 0),
    ],
)
def test_the_other_impacts_give_the_true_modes(folder, name, n_accepted, n_overload):
    impacts, _, model = identify_accepted(impacts_of_file(folder, name), ReceptanceSettings(), IdentifySettings())
    assert sum(i.accepted for i in impacts) == n_accepted
    assert sum(r.reason == "overload" for i in impacts for r in i.rejections) == n_overload
    found = {m.band: (m.frequency, m.damping) for m in model.modes}
    for band, (frequency, damping) in {"ballast": (160.0, 0.08), "railpad": (560.0, 0.06)}.items():
        assert found[band] == (pytest.approx(frequency, abs=0.3), pytest.approx(damping, abs=2e-3))


def test_an_exponential_window_adds_its_decay_rate_to_each_mode_as_docs_measuring_states(folder):
    """Decay rate 50 1/s: damping rises by 50/(2π f), to 0.130 and 0.074."""
    _, _, model = identify_accepted(impacts_of_file(folder, "exp_window.npz"), ReceptanceSettings(), IdentifySettings())
    for mode, (frequency, damping) in zip(model.modes, ((160.0, 0.08), (560.0, 0.06))):
        assert mode.damping == pytest.approx(damping + 50.0 / (2 * np.pi * frequency), abs=2e-3)
