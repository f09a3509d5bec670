"""Every effect states its requirements of recordings, and an answer lists those that are not met."""

import dataclasses
from types import SimpleNamespace

import pytest

from turnout import physics
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.engine.decision import judge
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.physics.hypothesis import BladeSite, ChannelSite, ContactSite, SupportSite, TrackSite, TrainSite
from turnout.physics.requirement import PASSAGES
from turnout.stages.mismatch_text import requirements_in_words

SUPPORT = SupportSite(20, 12.0, 5, 10, 30, True)
CHANNEL = ChannelSite("A", 2, ("p",), True, 5.0, 4.0, 0.1)
BLADE = BladeSite(((20, 12.0),), ((24, 14.4),), 3.0, True)


def has_candidates_only_with_passages(effect):
    """Whether it has a hypothesis at some site with passages, and none without them."""
    if not effect.site_types or {ContactSite, TrainSite} & set(effect.site_types):
        return True
    track = TrackSite(SimpleNamespace(), True)
    sites = [s for s in (SUPPORT, CHANNEL, BLADE, track) if isinstance(s, effect.site_types)]
    counts = [
        sum(len(list(effect.hypotheses(dataclasses.replace(s, has_passages=has)))) for s in sites)
        for has in (True, False)
    ]
    return counts[0] > 0 and counts[1] == 0


@pytest.mark.parametrize("effect", [e for e in physics.TERMS if e.asked], ids=lambda e: e.name)
def test_an_effect_requires_passages_if_it_has_candidates_only_with_passages(effect):
    if effect.name in ("clipping", "rail_shear"):  # a saturated channel shows in impacts; the rail has to be a real one
        return
    assert (PASSAGES in effect.requirements) == has_candidates_only_with_passages(effect)


def unmet_requirements(plan, **changes):
    case = TrackCase(dataclasses.replace(measured_campaign(plan, (), 3), **changes))
    return case, {u.effect: u for u in case.unmet_requirements}


def test_passages_alone_do_not_show_effects_that_need_impacts_or_temperatures():
    case, lacking = unmet_requirements(small_plan((15.0,), hammer_positions=()))
    assert {"local_pad", "mount_resonance", "pad_temperature"} <= set(lacking)
    assert not {"surface_dip", "wheel_flat", "slide_chair_gap", "rail_corrugation"} & set(lacking)
    families = {c.family for c in case.candidates}
    assert (
        "local_pad" in families and "pad_temperature" not in families
    )  # an effect with little evidence is tested nevertheless
    words = requirements_in_words(case.unmet_requirements)
    assert words.startswith("These recordings cannot show") and "more (needs hammer tests)" in words
    assert "pads that soften when warm (needs recordings at a rail temperature 15 K away)" in words


def test_impacts_alone_do_not_show_effects_that_need_trains():
    _, lacking = unmet_requirements(small_plan((5.0, 30.0)), passages=(), reserved=())
    assert {"surface_dip", "wheel_flat", "unsprung_mass", "hum", "rail_corrugation"} <= set(lacking)
    assert "pad_temperature" not in lacking and "local_pad" not in lacking
    assert lacking["rail_corrugation"].words == "corrugation on a stretch of rail"
    assert lacking["rail_corrugation"].measurement == "passages of trains"


@pytest.mark.parametrize(("nats", "answer"), [(12.5, "unknown"), (11.5, "none")])
def test_an_effect_that_recordings_show_and_do_not_identify_is_unknown_above_the_threshold(nats, answer):
    line = Ambiguity(nats, "the level is high", "passages at another speed", "wavelength", "0.15 m", 2.0, 6.0)
    verdict = judge([], 0.5, MismatchSettings(), ambiguity=line)
    assert verdict.answer == answer and verdict.is_ambiguous == (answer == "unknown")
    assert (verdict.reason == "the level is high") == (answer == "unknown")
