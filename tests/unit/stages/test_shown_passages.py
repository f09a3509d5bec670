"""The choice of the passage and the sensor that a page draws."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.stages.mismatch_curves import ChannelComparison, best_comparison

PLACES = {"A1": 2.0, "A2": 4.0, "A3": 6.0}


def comparison(recording, sensor, left=1.0, held_out=False):
    """A recording of ones: the residual is all of it without the effect, and the share ``left`` with the effect."""
    ones, none = np.ones(8), np.zeros(8)
    return ChannelComparison(recording, sensor, np.arange(8.0), ones, none, ones * (1.0 - left), none, ones, held_out)


def drawn(pool, where, named=True):
    case = SimpleNamespace(
        campaign=SimpleNamespace(sensors=[SimpleNamespace(name=n, place=x) for n, x in PLACES.items()])
    )
    base = SimpleNamespace(candidates=())
    fit = SimpleNamespace(candidates=(SimpleNamespace(where=where),)) if named else base
    found = best_comparison(pool, case, SimpleNamespace(base=base, fit=fit))
    return found and (found.recording, found.sensor)


@pytest.mark.parametrize(
    ("where", "sensor"),
    [({"place": 4.9}, "A2"), ({"place": 5.1}, "A3"), ({"place": 3.0}, "A1"), ({"place": 5.0}, "A2")],
)
def test_the_sensor_nearest_to_the_position_is_drawn(where, sensor):
    """Of two equally near sensors, the first by name is drawn, in any order of the recordings."""
    pool = [comparison("p", name, left=0.1 * k) for k, name in enumerate(("A3", "A1", "A2"))]
    assert drawn(pool, where) == drawn(pool[::-1], where) == ("p", sensor)


def test_the_held_out_recording_with_the_largest_gain_at_the_sensor_is_drawn():
    pool = [comparison("fitted", "A3", 0.0), comparison("kept", "A3", 0.6, True), comparison("other", "A3", 0.3, True)]
    assert drawn([*pool, comparison("other", "A1", 0.1, True)], {"sensor": "A3"}) == ("other", "A3")
    assert drawn(pool[:1], {"sensor": "A3"}) == ("fitted", "A3")
    assert drawn(pool, {"sensor": "A2"}) == ("other", "A3")  # this sensor recorded nothing
    assert drawn([], {}) is None


def test_the_recording_with_the_largest_residual_is_drawn_without_a_name():
    whole = comparison("half", "A1")
    half = replace(whole, before=0.5 * whole.measured)
    assert drawn([half, comparison("all", "A2")], {}, named=False) == ("all", "A2")
