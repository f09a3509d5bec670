"""Matrices filled into a skeleton are those assembled in full."""

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.track.blows import banded_product
from turnout.mismatch.track.skeleton import matrices_of
from turnout.simulate import uniform_track
from turnout.simulate.matrices import assemble

TERMS = [
    (),
    (physics.ZenerPad(0.5),),
    (physics.RailShear(2.0), physics.LocalPad(20, 3.0)),
    (physics.AttachedResonator(20, 30.0, 200.0),),
    (physics.SleeperMode(0.3, 200.0), physics.PadTemperature(0.01)),
]


@pytest.mark.parametrize("terms", TERMS, ids=lambda terms: "+".join(t.name for t in terms) or "none")
def test_a_filled_skeleton_is_the_assembled_track(terms):
    rng, track = np.random.default_rng(1), uniform_track(24.0)
    for _ in range(2):  # the second time the skeleton is known
        n = track.support.size
        other = track.with_(
            pad_stiffness=track.pad_stiffness * np.exp(0.1 * rng.normal(size=n)),
            ballast_damping=track.ballast_damping * np.exp(0.1 * rng.normal(size=n)),
            sleeper_mass=1.1 * track.sleeper_mass,
        )
        full, filled = assemble(other, terms), matrices_of(other, terms)
        assert filled.index == full.index
        for name in ("mass", "damping", "stiffness", "hysteresis"):
            a, b = getattr(full, name), getattr(filled, name)
            assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * np.abs(a).max())


def test_a_banded_product_is_the_product_with_the_full_matrix():
    rng = np.random.default_rng(2)
    upper = rng.normal(size=(3, 6))
    full = np.zeros((6, 6))
    for k in range(3):
        for i in range(6 - k):
            full[i, i + k] = full[i + k, i] = upper[k, i]
    x = rng.normal(size=(2, 6))
    assert banded_product(upper, x) == pytest.approx(x @ full)
