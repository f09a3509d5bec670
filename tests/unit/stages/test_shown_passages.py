"""Which passage at which sensor a page draws."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.stages.mismatch_curves import ChannelComparison, best_comparison

PLACES = {"A1": 2.0, "A2": 4.0, "A3": 6.0}


def shown(recording, sensor, left=1.0, held_out=False):
    """A recording of ones, of which a model without the effect misses all, one with it the share ``left``."""
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
def test_the_nearest_sensor_to_a_place_and_of_two_as_near_always_the_same(where, sensor):
    """Half way between two it is the first by name, in whatever order recordings hold them."""
    pool = [shown("p", name, left=0.1 * k) for k, name in enumerate(("A3", "A1", "A2"))]
    assert drawn(pool, where) == drawn(pool[::-1], where) == ("p", sensor)


def test_a_recording_never_used_at_the_sensor_found_where_most_is_gained():
    pool = [shown("fitted", "A3", 0.0), shown("kept", "A3", 0.6, True), shown("other", "A3", 0.3, True)]
    assert drawn([*pool, shown("other", "A1", 0.1, True)], {"sensor": "A3"}) == ("other", "A3")
    assert drawn(pool[:1], {"sensor": "A3"}) == ("fitted", "A3")
    assert drawn(pool, {"sensor": "A2"}) == ("other", "A3")  # nobody recorded it
    assert drawn([], {}) is None


def test_without_a_name_what_is_missed_most_is_drawn():
    whole = shown("half", "A1")
    half = replace(whole, before=0.5 * whole.measured)
    assert drawn([half, shown("all", "A2")], {}, named=False) == ("all", "A2")
