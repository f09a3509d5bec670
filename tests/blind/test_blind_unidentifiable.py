"""Effects of the stratum "unidentifiable" are not identifiable: a site without the effect gives equal recordings."""

from dataclasses import replace

import numpy as np
import pytest

from turnout_blind.effect import load_effects
from turnout_blind.record import passage_motion
from turnout_blind.site import draw_site
from turnout_blind.vehicle import Train
from turnout_blind.visibility import (
    HAMMER_BAND,
    PASSAGE_BAND,
    PASSAGE_DECIMATION,
    _impact_signals,
    _relative_difference,
    _sensor_signals,
)

EFFECTS = load_effects()
HIDDEN = 5.0  # % of the response, below the 6 % that two owners' models differ by


def site_with_effect(kind, rung=-1, seed=3):
    """Site, world with the effect at the top of its ladder, and what was drawn."""
    effect = EFFECTS[kind]
    rng = np.random.default_rng([seed, 9])
    site = draw_site(rng, **effect.site)
    world = site.world.copy()
    drawn = effect.draw_concealed(rng, site, rung % len(effect.ladder))
    effect.act(world, site, drawn.where, drawn.parameters)
    return site, world, drawn


def passage_difference(site, world, other_site, other_world, k=0):
    """Share [%] of a passage's response by which two worlds differ."""
    responses = [
        _sensor_signals(s, w, passage_motion(s, w, k, np.random.default_rng(k)), "passage", [1])
        for s, w in ((other_site, other_world), (site, world))
    ]
    return _relative_difference(*responses, PASSAGE_BAND, PASSAGE_DECIMATION)


def impact_difference(site, world, other):
    """The same of an impact at each position."""
    return _relative_difference(_impact_signals(site, other, [1]), _impact_signals(site, world, [1]), HAMMER_BAND, 3)


def test_every_unidentifiable_kind_has_a_test_here():
    kinds = {k for k, e in EFFECTS.items() if e.stratum == "unidentifiable"}
    assert kinds == {"one_temperature", "bottomless_void", "common_gain", "beyond_reach"}


def test_at_constant_temperature_warm_pads_give_the_recordings_of_soft_pads():
    site, world, drawn = site_with_effect("one_temperature")
    rival = site.world.copy()
    warm = np.mean(site.temperatures) - rival.reference
    rival.pad = rival.pad * np.exp(-drawn.parameters["coefficient"] * warm)
    assert impact_difference(site, world, rival) < HIDDEN
    assert passage_difference(site, world, site, rival) < HIDDEN
    assert impact_difference(site, world, site.world) > HIDDEN  # recordings show it, but do not identify it


def test_a_gap_that_never_closes_gives_the_recordings_of_missing_ballast():
    site, world, drawn = site_with_effect("bottomless_void", rung=0)
    rival = site.world.copy()
    rival.ballast[drawn.where["sleeper"]] = rival.ballast_damping[drawn.where["sleeper"]] = 0.0
    loaded = next(k for k, p in enumerate(site.passages) if p.train == "loaded")
    assert passage_difference(site, world, site, rival, loaded) == pytest.approx(0.0, abs=1e-6)
    assert impact_difference(site, world, rival) == pytest.approx(0.0, abs=1e-6)


def test_a_common_gain_of_all_channels_gives_the_recordings_of_heavier_trains_on_rougher_rails():
    site, world, drawn = site_with_effect("common_gain")
    gain = drawn.parameters["gain"]

    def heavier(car):  # the wheels keep their mass, the body takes the rest
        more = (gain - 1.0) * (car.body + 2.0 * car.bogie + 4.0 * car.wheelset)
        return replace(car, body=car.body + more)

    trains = {n: Train(t.name, tuple(map(heavier, t.cars)), t.radius, t.contact) for n, t in site.true_trains.items()}
    rough = {k: (lambda *a, f=f: gain * f(*a)) for k, f in site.roughness.items()}
    other = replace(site, true_trains=trains, roughness=rough)
    assert passage_difference(site, world, other, site.world) < HIDDEN
    assert passage_difference(site, world, site, site.world) > 2.0 * HIDDEN


def test_a_pad_beyond_the_reach_of_all_sensors_is_not_observable():
    site, world, _ = site_with_effect("beyond_reach")
    assert impact_difference(site, world, site.world) < HIDDEN
    assert passage_difference(site, world, site, site.world) < HIDDEN
