"""Accepted changes are effects of a single visit; their sizes are estimated."""

import pytest

from turnout.mismatch.turnout.accepted_effects import effects_on
from turnout.simulate import load_track
from turnout.stages.accepted_changes import GROUPS, AcceptedChange
from turnout.stages.changed_effects import EFFECTS, changed_effects

SUPPORTS = [6.6, 7.2, 7.8, 8.4]


def change(term, first=7.2, last=7.8):
    return AcceptedChange(term, first, last, since=2024.0, until=2024.5)


def test_every_change_that_can_be_accepted_has_effects():
    assert set(EFFECTS) == set(GROUPS)


def test_an_accepted_gap_includes_soft_ballast_and_a_gain_that_of_the_sensor_at_its_position():
    found = changed_effects([change("hanging_sleeper"), change("sensor_gain", 6.0, 6.0)], 2025.0, SUPPORTS, {"A1": 6.1})
    gaps = [f"{family}[{x} m]" for family in ("local_ballast", "hanging_sleeper") for x in (7.2, 7.8)]
    assert [e.key for e in found] == [*gaps, "sensor_gain[A1]"]


@pytest.mark.parametrize("time", [2023.0, 2024.0])
def test_a_visit_before_the_change_has_no_effect_of_it(time):
    assert changed_effects([change("local_pad")], time, SUPPORTS, {}) == ()
    assert changed_effects([change("local_pad")], 2024.1, SUPPORTS, {})


@pytest.mark.parametrize("term", sorted(EFFECTS))
def test_an_effect_starts_at_its_neutral_value_with_a_wide_prior(term, tmp_path, repository):
    import small_turnout as small

    small.write_configuration(tmp_path, repository)
    track = load_track("small", folder=tmp_path / "config" / "tracks").track
    found = changed_effects([change(term, 18.0, 18.0)], 2025.0, track.support, {"A": 18.0})
    for nuisance, (_, _, _, neutral, error) in zip(effects_on(track, found).nuisances, EFFECTS[term], strict=True):
        assert nuisance.mean == neutral and nuisance.sd >= 3.0 * error
