"""Simulated impacts: the hammer, the terms of the track, and the stretch of track that is simulated."""

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.physics import TERMS, LiftingSleepers, LocalBallast, PassageGain, SensorGain, SensorPosition, SurfaceDip
from turnout.simulate import Hammer, Sensor, prepare_hammer, simulate_hammer, uniform_track
from turnout.simulate.links import terms_on_stretch

TRACK, MASS, VELOCITY = uniform_track(30.0), 5.5, 1.2
HAMMER = Hammer(
    MASS, VELOCITY, velocity_spread=0.0, position_spread=0.0, force=Sensor("hammer", 15.0, "hammer", "force")
)
SHORT = {"n_impacts": 1, "duration": 0.05, "pretrigger": 0.005}


def impact(**options):
    return simulate_hammer(TRACK, 15.0, HAMMER, **SHORT, **options)[0].samples


def test_a_free_mass_gives_the_rail_at_most_twice_its_momentum_with_any_effect_of_wheels():
    """It rebounds from a track at rest with at most its initial speed; 1 % for the anti-alias filter."""
    paths = tuple(term.example() for term in TERMS if term.effect_type == "path")
    found, bare = impact(terms=(SurfaceDip(15.0, -1e-3, 0.6), *paths)), impact()
    assert len(paths) >= 5
    assert 1.0 < found[0].sum() / 20e3 / (MASS * VELOCITY) < 2.02
    assert np.array_equal(found, bare)


def test_a_given_force_acts_unchanged_with_any_hammer():
    """A half-sine of 4 ms, in channel 0 to 1 %, the ripple of the anti-alias filter, and its response is linear."""
    duration, peak = 4e-3, 8e3

    def half_sine(time):
        return peak * np.sin(np.pi * np.clip(time / duration, 0.0, 1.0))

    quiet = {"sensors": [Sensor("A", 15.0)]}
    once, twice = (impact(pulse=f, **quiet) for f in (half_sine, lambda time: 2.0 * half_sine(time)))
    assert once[0].sum() / 20e3 == pytest.approx(2.0 / np.pi * peak * duration, rel=1e-4)
    assert once[0].max() == pytest.approx(peak, rel=0.01)
    assert np.flatnonzero(once[0] > 0.01 * peak)[0] == pytest.approx(0.005 * 20e3, abs=2.0)  # after the pretrigger
    assert np.allclose(twice, 2.0 * once, rtol=1e-9, atol=1e-9 * np.max(np.abs(once)))
    assert np.std(once[1]) > 1.0


def test_the_terms_of_a_prepared_track_also_act_on_its_channels():
    """A gain of 3 is three times the signal, to rounding: these channels have no converter."""
    quiet = [Sensor("A", 15.0), Sensor("B", 15.6)]
    terms = (LocalBallast(25, 0.3), SensorPosition("B", 0.15))
    by_gain = [
        impact(sensors=quiet, prepared=prepare_hammer(TRACK, 15.0, (*terms, SensorGain("A", gain))))
        for gain in (1.0, 3.0)
    ]
    assert np.allclose(by_gain[1][1], 3.0 * by_gain[0][1], rtol=1e-9, atol=1e-9)
    assert np.array_equal(impact(sensors=quiet, terms=(*terms, SensorGain("A", 3.0))), by_gain[1])


def test_a_fault_of_the_passages_alone_changes_no_hammer_test():
    bare, of_passages, of_all = (
        impact(sensors=[Sensor("A", 15.0)], terms=terms)
        for terms in ((), (PassageGain("A", 3.0),), (SensorGain("A", 3.0),))
    )
    assert np.array_equal(of_passages, bare) and not np.array_equal(of_all, bare)


def test_a_term_counts_supports_of_the_whole_track_also_if_a_stretch_is_simulated():
    """Soft ballast 3 m from the impact changes the response above it, and more than an end of the track 27 m from
    there does."""
    track, place = uniform_track(120.0), 60.0
    near, far = (LocalBallast(track.nearest_support(x), 0.2) for x in (place + 3.0, 8.0))
    above = [Sensor("A", place + 3.0, cutoff=None)]
    options = {"sensors": above, **SHORT}
    bare, short, whole = (
        simulate_hammer(track, place, HAMMER, terms=terms, half_length=half, **options)[0].samples[1]
        for terms, half in (((), 30.0), ((near, far), 30.0), ((near, far), 200.0))
    )
    assert np.std(short - bare) > 0.02 * np.std(whole)
    assert np.std(short - whole) < 0.1 * np.std(short - bare)


def test_a_stretch_of_track_keeps_the_parts_of_terms_that_lie_in_it():
    keep = np.zeros(100, dtype=bool)
    keep[40:60] = True
    terms = (LiftingSleepers(30, 45, 1.0), LiftingSleepers(10, 39, 1.0), LocalBallast(59, 0.3),
             LocalBallast(60, 0.3), SensorGain("A", 2.0))  # fmt: skip
    kept = terms_on_stretch(terms, keep)
    assert [type(term) for term in kept] == [LiftingSleepers, LocalBallast, SensorGain]
    assert (kept[0].first, kept[0].last, kept[1].sleeper) == (0, 5, 19)


@pytest.mark.parametrize(("rate", "substeps"), [(10e3, 1), (20e3, 2), (19.2e3, 1)])
def test_a_track_prepared_for_another_step_is_rejected(rate, substeps):
    prepared = prepare_hammer(TRACK, 15.0, rate=rate, substeps=substeps)
    with pytest.raises(SimulationError, match=r"prepared for steps of \S+ s, but 20000\.0 Hz .* ask for 5e-05 s"):
        impact(prepared=prepared)
    assert impact(prepared=prepared, rate=rate, substeps=substeps).shape[1] == round(0.05 * rate)


def test_the_former_name_of_the_number_of_impacts_still_works_with_a_warning():
    with pytest.warns(DeprecationWarning, match="n_impacts"):
        recordings = simulate_hammer(TRACK, 15.0, HAMMER, n_blows=2, duration=0.05, pretrigger=0.005)
    assert len(recordings) == 2
