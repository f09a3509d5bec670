"""A nose that differs slightly from the track file is no mismatch: its numbers have priors."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ruamel.yaml import YAML

from turnout.config.parameter_files import read_parameters
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase, passage_alignment
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.surface_priors import SURFACE
from turnout.simulate.track_file import turnout_track
from turnout.simulate.wheel_path import Dip, Kink, Sections
from turnout.stages.accepted_effects import AcceptedEffect
from turnout.stages.mismatch_rows import surface_estimates
from turnout.stages.mismatch_text import surface_sentence

TOMMERUP = Path(__file__).parents[3] / "config" / "tracks" / "tommerup.yaml"
PLAN = small_plan((15.0,), hammer_positions=(24.0,))
NOSE, JOINT, FAR = Kink(25.2, 0.8e-3, 1.0, 0.55), Dip(14.5, 3e-4, 0.15), Dip(45.0, 3e-4, 0.15)
SPREADS = {NOSE: {"place": 0.02, "depth": 0.5, "length": 0.3, "share": 0.2}, JOINT: {"depth": 0.5}, FAR: {"depth": 0.5}}
FILED = replace(PLAN.turnout, routes={"main": ((NOSE, JOINT, FAR),)}, spreads=SPREADS)
TRUE = replace(NOSE, place=25.6, depth=1.3e-3, length=0.9)
WAVES = Waves([s.place for s in PLAN.sensors], 0.0)


@pytest.fixture(scope="module")
def campaign():
    """Two trains at two speeds over the ``TRUE`` nose; the track file has another one."""
    true = replace(PLAN.turnout, routes={"main": ((TRUE, JOINT, FAR),)})
    return replace(measured_campaign(replace(PLAN, turnout=true), (), 7), turnout=FILED)


def test_values_of_a_surface_with_a_prior_are_nuisances_where_recordings_show_them():
    surface = RunningSurface(FILED, WAVES, ("main",))
    assert surface.names == (*(f"surface_0_{f}" for f in (*SPREADS[NOSE], "power")), "surface_1_depth")
    known = {n.name: n for n in surface.nuisances()}
    assert known["surface_0_place"].sd == pytest.approx(0.02 * 25.2) and known["surface_0_place"].unit == "m"
    assert known["surface_0_depth"].sd == 0.5 and known["surface_0_depth"].unit == "-"
    assert known["surface_0_place"].max_step_sd * known["surface_0_place"].sd < 0.5 * NOSE.length
    assert 0.55 * np.exp(known["surface_0_share"].bounds[1]) < 1.0
    assert 1.0 < 2.0 * np.exp(known["surface_0_power"].bounds[0]) < 1.02  # the limit is a V, without an overhang


def test_the_shape_of_a_nose_is_uncertain_if_its_depth_is():
    for spread, more in (
        ({"depth": 0.5}, {"power": SURFACE.shape_sd}),
        ({"place": 0.02}, {}),
        ({"depth": 0.5, "power": 0.1}, {}),
    ):
        surface = RunningSurface(replace(FILED, spreads={NOSE: spread}), WAVES, ("main",))
        assert {u.field: u.spread for u in surface.parameters} == spread | more


@pytest.mark.parametrize("nose", [replace(NOSE, power=1.0), replace(NOSE, power=1.005), replace(NOSE, share=0.97)])
def test_a_nose_at_the_limit_of_its_shape_has_nuisances(nose):
    """A V, or a nose whose flank is nearly all before the kink: both limits of the prior include the file's number."""
    surface = RunningSurface(
        replace(FILED, spreads={nose: SPREADS[NOSE]}, routes={"main": ((nose,),)}), WAVES, ("main",)
    )
    priors = {n.name: n for n in surface.nuisances()}
    for end in (0, 1):
        values = {name: n.bounds[end] for name, n in priors.items() if "place" not in name}
        ((changed,),) = surface.surfaces("main", {**dict.fromkeys(priors, 0.0), **values})
        assert changed.power >= 1.0 and 0.0 < changed.share < 1.0


def test_a_surface_has_its_given_numbers():
    surface = RunningSurface(FILED, WAVES, ("main",))
    values = dict.fromkeys(surface.names, 0.0)
    assert surface.surfaces("main", values) == FILED.surfaces("main")
    values |= {"surface_0_place": 0.15, "surface_0_depth": np.log(1.3 / 0.8), "surface_0_length": np.log(0.9)}
    ((nose, joint, far),) = surface.surfaces("main", values)
    assert (joint, far) == (JOINT, FAR)
    assert [nose.place, nose.depth, nose.length, nose.share] == pytest.approx([25.35, 1.3e-3, 0.9, 0.55])


def test_a_measured_profile_has_an_uncertain_factor_and_a_position_at_the_origin_is_certain():
    profile, blade = Sections((23.0, 24.0, 25.0), (0.0, 1e-3, 0.0)), Kink(0.0, 1e-3, 1.0)
    spreads = {profile: {"places": 0.1, "dips": 0.2}, blade: {"place": 0.2}}
    surface = RunningSurface(
        replace(FILED, routes={"main": ((profile, blade),)}, spreads=spreads), Waves([3.0, 24.0], 0.0), ("main",)
    )
    assert surface.names == ("surface_0_dips",)
    ((changed, _),) = surface.surfaces("main", {"surface_0_dips": np.log(1.5)})
    assert changed.dips == pytest.approx((0.0, 1.5e-3, 0.0)) and changed.places == profile.places


def test_numbers_of_a_route_without_trains_are_no_nuisances():
    forked = replace(FILED, routes={"main": ((NOSE,),), "diverging": ((JOINT, FAR),)})
    assert RunningSurface(forked, WAVES, ("diverging",)).names == ("surface_0_depth",)
    assert len(RunningSurface(forked, WAVES, ("main",)).names) == len(SPREADS[NOSE]) + 1


@pytest.mark.parametrize(("prior", "by", "is_reported"), [(0.5, 0.2, True), (0.15, 0.7, True), (0.15, 0.2, False)])
def test_a_value_is_reported_if_it_is_more_certain_than_in_the_file_or_differs_from_it(prior, by, is_reported):
    """An error of 10 % and 3 % of the fit: a prior of 15 % is nearly as good, but a logarithm of 0.7 is another
    nose."""
    surface = RunningSurface(replace(FILED, spreads={NOSE: {"share": prior}}), WAVES, ("main",))
    case = SimpleNamespace(nuisances=surface.nuisances())
    fit = SimpleNamespace(values={surface.names[0]: by}, covariance=np.array([[0.03**2]]), jacobian=[])
    assert bool(list(surface.estimate(case, fit))) is is_reported


def test_a_reported_value_is_the_measured_one_without_the_prior():
    """Recordings of 0.3 ± 0.2 with a prior of 0.5 have their posterior at 0.26 ± 0.19."""
    surface = RunningSurface(replace(FILED, spreads={NOSE: {"length": 0.5}}), WAVES, ("main",))
    weights = np.array([0.2, 0.5]) ** -2.0
    values = {surface.names[0]: 0.3 * weights[0] / weights.sum()}
    fit = SimpleNamespace(values=values, covariance=np.array([[1.0 / weights.sum()]]), jacobian=[])
    (estimate,) = surface.estimate(SimpleNamespace(nuisances=surface.nuisances()), fit)
    assert estimate["value"] == pytest.approx(NOSE.length * np.exp(0.3))
    assert estimate["se"] == pytest.approx(estimate["value"] * np.hypot(0.2, SURFACE.model_error))


def test_the_search_for_the_nose_uses_no_held_out_recording(monkeypatch):
    calls = []
    monkeypatch.setattr(
        passage_alignment.PassageAligner, "correlation", lambda self, values, passage: calls.append(passage.name) or 0.5
    )
    passages = [SimpleNamespace(name=name, vehicle=SimpleNamespace(wheels=range(4))) for name in "abc"]
    campaign = SimpleNamespace(passages=passages, reserved=("a",), sensors_of=lambda p: ("A1",))
    surface = RunningSurface(FILED, WAVES, ("main",))
    aligner = passage_alignment.PassageAligner(campaign, SimpleNamespace(surface=surface))
    passage_alignment.fit_surface(aligner, {})
    assert set(calls) == {"b", "c"}


def test_the_search_for_a_worn_nose_does_not_end_at_a_wrong_position_with_the_depth_of_the_file(monkeypatch):
    """With the depth of the file a position 10 cm off correlates best, and from there no other depth is better."""

    def correlation(self, values, passage):
        place, depth = values["surface_0_place"], values["surface_0_depth"]
        wrong = 0.75 * np.exp(-(((place + 0.1) / 0.05) ** 2) - (depth / 0.3) ** 2)
        return max(wrong, 0.98 * np.exp(-((place / 0.1) ** 2) - ((depth - 0.6) / 0.25) ** 2))

    monkeypatch.setattr(passage_alignment.PassageAligner, "correlation", correlation)
    passage = SimpleNamespace(name="a", vehicle=SimpleNamespace(wheels=range(4)))
    campaign = SimpleNamespace(passages=[passage], reserved=(), sensors_of=lambda p: ("A1",))
    surface = RunningSurface(replace(FILED, spreads={NOSE: {"place": 0.002, "depth": 0.5}}), WAVES, ("main",))
    aligner = passage_alignment.PassageAligner(campaign, SimpleNamespace(surface=surface))
    values = passage_alignment.fit_surface(aligner, {})
    # trials are 5 cm and a quarter of 0.5 apart
    assert abs(values["surface_0_place"]) < 0.03 and values["surface_0_depth"] == pytest.approx(0.6, abs=0.13)


def number(value, unit, prior=None):
    return {"value": value, "unit": unit, "source": "a drawing"} | ({"prior": prior} if prior else {})


def test_priors_are_those_of_the_track_file(tmp_path):
    """For listed parts, common to several surfaces or on one of them; a number without a prior is certain."""
    content = YAML(typ="safe").load(TOMMERUP.read_text(encoding="utf-8"))
    content.pop("locations")
    dips = [number(0.0, "mm", 0.1), number(1.0, "mm", 0.2)]
    profile = {"kind": "sections", "places": [number(25.0, "m"), number(26.0, "m")], "dips": dips}
    nose = {
        "kind": "kink",
        "place": number(25.2, "m"),
        "depth": number(0.8, "mm", 0.5),
        "length": number(1.0, "m", 0.3),
    }
    certain = {"kind": "dip", "place": number(14.5, "m"), "depth": number(0.3, "mm"), "length": number(0.15, "m")}
    content["routes"] = {"main": [nose], "diverging": {"common": [certain], "surfaces": [[profile], [nose]]}}
    path = tmp_path / "t.yaml"
    YAML().dump(content, path)
    found = turnout_track(read_parameters(path)).spreads
    expected = {"Kink": {"depth": 0.5, "length": 0.3}, "Sections": {"dips": 0.2}}
    assert {type(part).__name__: spread for part, spread in found.items()} == expected


@pytest.fixture(scope="module")
def case(campaign):
    return TrackCase(campaign)


@pytest.fixture(scope="module")
def certain(campaign):
    """The same recordings with certain numbers in the file."""
    return TrackCase(replace(campaign, turnout=replace(FILED, spreads={})))


@pytest.mark.slow
def test_a_coarse_search_finds_a_nose_that_linear_steps_do_not_reach(campaign, case, certain):
    """0.4 m further, 10 ms at 40 m/s: more than a period at 112 Hz. The search has to come within a tenth of the
    shortest wave of 30 Hz of the truth, and all trains then resemble their simulation."""
    found = {u.name: u.value_at(case.start_values[u.name]) for u in case.predictor.surface.parameters}
    assert abs(found["surface_0_place"] - TRUE.place) < 0.1
    assert found["surface_0_depth"] == pytest.approx(TRUE.depth, rel=0.3)
    assert len(case.aligned_passages) == len(PLAN.trains) and not case.data.unmatched
    assert not set(found) & set(certain.start_values)
    standing = AcceptedEffect(
        "local_pad", {"sleeper": 24.0}, {"factor": (0.7, 0.05)}
    )  # impacts contain no information on the nose
    beside = TrackCase(campaign, accepted=(standing,)).start_values
    assert {n: beside[n] for n in found} == {n: case.start_values[n] for n in found} and beside != case.start_values


@pytest.mark.slow
def test_a_nose_within_its_prior_is_estimated_and_leaves_the_residual_of_an_intact_track(case, certain):
    """Position, depth and length of the true nose are within two standard errors. With certain numbers of the file the
    residual of the same recordings is five times as large, and the answer is a dip."""
    fit = fit_jointly(case, iterations=15)
    estimates = {(t["term"], t["name"]): t for t in surface_estimates(case, fit)}
    for field in ("place", "depth", "length"):
        t = estimates["running_surface_kink", field]
        assert abs(t["value"] - getattr(TRUE, field)) < 2.0 * t["se"]
    depth = estimates["running_surface_kink", "depth"]
    half = 0.5 * SPREADS[NOSE]["depth"] * NOSE.depth  # of the uncertainty in the file
    assert depth["filed"] == NOSE.depth and depth["se"] < half
    assert (
        "running_surface_dip",
        "depth",
    ) not in estimates  # 3.5 m before the free waves: no recording depends on its depth
    fit_of_the_file = fit_jointly(certain, iterations=15)
    assert fit_of_the_file.level["passage"] > 5.0 * fit.level["passage"]
    assert fit.level["passage"] < case.control_level["passage"]


def test_a_value_far_from_the_file_is_reported():
    surface = RunningSurface(FILED, WAVES, ("main",))
    depth = next(u for u in surface.parameters if u.field == "depth")
    assert surface_sentence(depth.estimate(0.9, 0.05)) == ""
    assert surface_sentence(depth.estimate(np.log(4.0), 0.02)).startswith("The depth of the kink at 25.2 m is 3.2 mm")
