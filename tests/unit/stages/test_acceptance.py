"""An accepted finding is written into a track file: readable, only if it is certain, once per effect and position."""

import json
import re
import shutil
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest
import small_turnout as small

from turnout import physics
from turnout.errors import SimulationError, TurnoutError
from turnout.mismatch.engine.candidate import EffectSite
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.accepted_effects import AcceptedEffects, effects_on
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.predicted_case import PredictedCase
from turnout.simulate import load_track, simulate_hammer, uniform_track
from turnout.stages import mismatch
from turnout.stages.accept_finding import accept, entry_text, with_entry
from turnout.stages.accepted_effects import AcceptedEffect, accepted_of, describe_term, terms_on
from turnout.stages.mismatch_groups import Group
from turnout.stages.mismatch_results import Results
from turnout.stages.mismatch_text import effect_in_words
from turnout.stages.track_files import digest_of_model

GAP = {"value": 1.12e-3, "se": 0.05e-3, "unit": "m"}
HANGING_SLEEPER = {"term": "hanging_sleeper", "fixed": {"sleeper": 18.0}, "parameters": {"gap": GAP}}


def finding(term=HANGING_SLEEPER, **more):
    row = {
        "finding_id": "0123456789abcdef", "sections": "A, B", "verdict": "named", "grade": "A",
        "found_at_utc": datetime(2026, 7, 25, 10), "term_json": json.dumps([term]),
    }  # fmt: skip
    return row | more


@pytest.fixture
def config(tmp_path, repository):
    return small.write_configuration(tmp_path, repository)


def track_of_turnout(config):
    return load_track("t1", folder=config / "tracks")


def test_the_track_file_of_the_turnout_extends_that_of_the_layout(config):
    before = (config / "tracks/small.yaml").read_text()
    path, words = accept(finding(), config, "t1")
    assert (config / "tracks/small.yaml").read_text() == before
    assert path == config / "tracks/t1.yaml" and "gap 0.00112 ± 9.8e-05 m" in words
    text = path.read_text()
    for part in ("extends: small", "value: 1.12", 'unit: "mm"', "finding 0123456789ab", "up to 2026-07-25", "grade A"):
        assert part in text
    # 1.12 ± 1.96 * 0.05
    assert "95 %: 1.02 to 1.22 mm" in text
    (entry,) = accepted_of(track_of_turnout(config).terms)
    assert (entry.family, entry.place) == ("hanging_sleeper", 18.0)
    assert entry.values["gap"] == pytest.approx((1.12e-3, 0.05e-3), rel=0.01)
    base = load_track("small", folder=config / "tracks")
    assert np.array_equal(track_of_turnout(config).track.ballast_stiffness, base.track.ballast_stiffness)


def test_comments_and_all_other_lines_of_a_file_are_kept(config, repository):
    path = config / "tracks/t1.yaml"
    shutil.copy(repository / "config/tracks/tommerup.yaml", path)
    before = path.read_text()
    at = HANGING_SLEEPER | {"fixed": {"sleeper": 24.6}}
    accept(finding(at), config, "t1")
    assert path.read_text().startswith(before) and "extends" not in path.read_text()
    place = track_of_turnout(config).track.support[
        accepted_of(track_of_turnout(config).terms)[0].term(track_of_turnout(config).track).sleeper
    ]
    assert place == pytest.approx(24.6)


def test_the_same_effect_at_the_same_position_is_replaced_and_another_is_added(config):
    accept(finding(), config, "t1")
    accept(finding(HANGING_SLEEPER | {"parameters": {"gap": GAP | {"value": 1.5e-3}}}), config, "t1")
    accept(finding(HANGING_SLEEPER | {"fixed": {"sleeper": 18.6}}), config, "t1")
    gain = {
        "term": "sensor_gain",
        "fixed": {"channel_name": "A"},
        "parameters": {"gain": GAP | {"value": 1.2, "unit": "-"}},
    }
    accept(finding(gain), config, "t1")
    found = accepted_of(track_of_turnout(config).terms)
    assert [(a.key, round(next(iter(a.values.values()))[0], 6)) for a in found] == [
        ("hanging_sleeper[18.0 m]", 1.5e-3), ("hanging_sleeper[18.6 m]", 1.12e-3), ("sensor_gain[A]", 1.2),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "fixed", "other"),
    [
        ("hum", {"channel_name": "A", "frequency": 50.0, "start": 0.0, "phase": 0.0}, {"frequency": 100.0}),
        ("wheel_flat", {"wheel": 1, "train": "railcar"}, {"wheel": 5}),
        ("out_of_round", {"wheel": 1, "order": 3, "train": "railcar"}, {"order": 5}),
    ],
)
def test_effects_at_one_sensor_or_train_differ_by_frequency_wheel_and_order(config, name, fixed, other):
    def entry(value, **changes):
        values = dict.fromkeys((p.name for p in physics.effects_by_name()[name].parameters), GAP | {"value": value})
        return entry_text(
            {"term": name, "fixed": fixed | changes, "parameters": values},
            finding(),
            load_track("small", folder=config / "tracks"),
        )

    text = "name: a\n"
    for described in (entry(1e-3), entry(2e-3, **other), entry(3e-3)):
        text = with_entry(text, described)
    assert (
        text.count("- term:") == 2
        and text.count("value: 1,") == 0
        and text.index("value: 2,") < text.index("value: 3,")
    )


def test_a_fitted_frequency_tells_no_two_masses_apart(config):
    mass = {"term": "attached_resonator", "fixed": {"support": 12.0}}
    text = "name: a\n"
    for frequency in (180.0, 185.0):
        described = mass | {"parameters": {"frequency": GAP | {"value": frequency, "unit": "Hz"}}}
        text = with_entry(text, entry_text(described, finding(), load_track("small", folder=config / "tracks")))
    assert text.count("- term:") == 1 and "value: 185" in text


def test_an_effect_behind_the_crossing_is_only_on_the_track_of_its_route(config, repository):
    shutil.copy(repository / "config/tracks/tommerup.yaml", config / "tracks/t1.yaml")
    at = {"main": 0.5e-3, "diverging": 1.5e-3}
    for route, gap in (*at.items(), *at.items()):
        term = HANGING_SLEEPER | {"fixed": {"sleeper": 28.2}, "parameters": {"gap": GAP | {"value": gap}}}
        accept(finding(term, route=route), config, "t1")
    accept(finding(HANGING_SLEEPER | {"fixed": {"sleeper": 13.8}}, route="main"), config, "t1")
    track = track_of_turnout(config)
    for route, gap in at.items():
        terms = terms_on(track, track.track_of(route), route=route)
        assert [t.gap for t in terms] == pytest.approx(
            [gap, 1.12e-3]
        )  # the bearers of the closure panel carry both tracks
    (entry,) = [a for a in accepted_of(track.terms) if a.place == 13.8]
    assert entry.is_on("main") and entry.is_on("diverging")


def test_an_entry_without_a_route_is_replaced_by_the_same_effect_with_a_route(config, repository):
    path = config / "tracks/t1.yaml"
    shutil.copy(repository / "config/tracks/tommerup.yaml", path)
    term = HANGING_SLEEPER | {"fixed": {"sleeper": 28.2}}
    accept(finding(term, route="main"), config, "t1")
    path.write_text(path.read_text().replace("    route: main\n    sleeper", "    sleeper"))
    assert [a.route for a in accepted_of(track_of_turnout(config).terms)] == [""]
    accept(finding(term, route="main"), config, "t1")
    assert [a.route for a in accepted_of(track_of_turnout(config).terms)] == ["main"]


def test_a_diagnosis_does_not_use_effects_that_were_accepted_on_the_other_route(monkeypatch, tmp_path):
    given = []

    def case_of(campaign, settings, accepted, cache):
        given.extend(a.route for a in accepted)
        raise SimulationError("that is all")

    monkeypatch.setattr(mismatch, "TrackCase", case_of)
    turnout = SimpleNamespace(id="t1", raw="raw", settings={"mismatch": None})
    already_accepted = [
        AcceptedEffect("local_pad", {"sleeper": 18.0}, {}, route) for route in ("main", "", "diverging")
    ]
    description = {"visit": "2026-07-25", "identity": "one", "notes": [], "changes": (), "every_group": []}
    options = mismatch.Options(fits=tmp_path)
    rows = mismatch._diagnose_group(
        Group(("B",), "diverging", None), turnout, already_accepted, description, options, (0, 1)
    )
    assert given == ["", "diverging"] and "that is all" in rows["quarantine"][0]["found"]


@pytest.mark.parametrize("more", [{"verdict": "unknown", "grade": None}, {"verdict": "a_or_b"}, {"grade": None}])
def test_a_finding_without_a_name_is_accepted_only_with_the_option_anyway(config, more):
    with pytest.raises(SimulationError, match="--anyway"):
        accept(finding(**more), config, "t1")
    assert not (config / "tracks/t1.yaml").exists()
    accept(finding(**more), config, "t1", anyway=True)
    assert len(track_of_turnout(config).terms) == 1


def test_a_finding_without_effect_and_an_effect_of_a_wheelset_are_rejected(config):
    with pytest.raises(SimulationError, match="no effect that could be accepted"):
        accept(finding(term_json=None, verdict="none"), config, "t1", anyway=True)
    flat = {"term": "wheel_flat", "fixed": {"wheel": 1}, "parameters": {"length": GAP}}
    with pytest.raises(SimulationError, match="belongs to a wheelset"):
        accept(finding(flat), config, "t1", anyway=True)


def test_a_position_off_the_track_or_a_value_out_of_bounds_changes_no_file(config):
    for wrong in ({"fixed": {"sleeper": 99.0}}, {"parameters": {"gap": GAP | {"value": 0.2}}}):
        with pytest.raises(SimulationError):
            accept(finding(HANGING_SLEEPER | wrong), config, "t1")
        assert [p.name for p in (config / "tracks").iterdir()] == ["small.yaml"]


def test_a_wrong_entry_in_a_track_file_is_reported(config):
    accept(finding(), config, "t1")
    path = config / "tracks/t1.yaml"
    text = path.read_text()
    without = "".join(line for line in text.splitlines(keepends=True) if "gap" not in line)
    for changed, expected_message in (
        (text.replace("term: hanging_sleeper", "term: hanging"), "no effect"),
        (text.replace("    gap:", "    depth:"), "has no 'depth'"),
        (text.replace("    gap:", "    route: siding\n    gap:"), "'siding' is no route"),
        (without, "needs gap"),
    ):
        path.write_text(changed)
        with pytest.raises(TurnoutError, match=expected_message):
            accepted_of(track_of_turnout(config).terms)


def test_a_track_that_extends_itself_is_rejected(config):
    (config / "tracks/a.yaml").write_text("extends: b\n")
    (config / "tracks/b.yaml").write_text("extends: a\n")
    with pytest.raises(SimulationError, match="extends itself"):
        load_track("a", folder=config / "tracks")


OF_TRACK_AND_SENSORS = [t for t in physics.TERMS if t.name != "roughness_level" and t.frame != "wheel"]


@pytest.mark.parametrize("term", OF_TRACK_AND_SENSORS, ids=lambda t: t.name)
def test_every_effect_is_read_from_the_file_as_it_was_written(config, term):
    """The file has four digits, which bounds the difference."""
    made = term.example()
    candidate = SimpleNamespace(family=term.name, parameters=term.parameters, site=EffectSite())
    track = own_track(config)
    described = describe_term(made, candidate, [0.1 * abs(getattr(made, p.name)) for p in term.parameters], track)
    accept(finding(described), config, "t1", anyway=True)
    back = accepted_of(track_of_turnout(config).terms)[0].term(track_of_turnout(config).track)
    for name, value in vars(made).items():
        assert getattr(back, name) == (pytest.approx(value, rel=1e-3) if isinstance(value, float) else value)


def test_a_fitted_flat_is_stored_with_the_other_axles_that_may_have_it(config):
    flat, errors = physics.WheelFlat(1, 0.04, train="railcar"), [0.008]
    for rivals, stored in (((1,), {"rival_axles": [1]}), ((), {})):
        site = EffectSite(rival_axles=rivals)
        candidate = SimpleNamespace(family=flat.name, parameters=flat.parameters, site=site)
        described = describe_term(flat, candidate, errors, own_track(config))
        assert {k: v for k, v in described.items() if k not in ("term", "fixed", "parameters")} == stored


def test_the_sentence_of_a_mass_between_two_sleepers_has_its_position(config):
    """It said the position of the sleeper before it, half a bay off."""
    mass, track = physics.AttachedResonator(20, 30.0, 180.0, beyond=0.5), own_track(config)
    middle = round(float(track.support[20:22].mean()), 3)
    candidate = SimpleNamespace(family=mass.name, parameters=mass.parameters, site=EffectSite(where={"place": middle}))
    described = describe_term(mass, candidate, [3.0, 2.0, 0.01], track)
    assert described["fixed"]["support"] == pytest.approx(middle - 0.3) and described["position"] == middle
    row = {"train": None, "axle": None, "channel": None}
    assert f" at {middle:.1f} m " in effect_in_words(described, row)


def test_an_accepted_mass_between_two_sleepers_is_found_again_at_its_position():
    """It was compared by the sleeper before it, 0.45 m off at three quarters of the bay; 0.35 m is the limit."""
    accepted = AcceptedEffect("attached_resonator", {"support": 12.0, "beyond": 0.75}, {"mass": (30.0, None)})
    assert accepted.place == pytest.approx(12.45)
    assert accepted.is_of("attached_resonator", {"place": 12.45})
    assert not accepted.is_of("attached_resonator", {"place": 12.0})


def own_track(config):
    return load_track("small", folder=config / "tracks").track


def test_an_accepted_gap_is_simulated(config):
    """The effect of the file gives the same simulation as the effect itself: no ballast below the gap."""
    accept(finding(), config, "t1")
    track = track_of_turnout(config)
    short = {"n_impacts": 1, "half_length": 99.0, "duration": 0.1}
    by_file = simulate_hammer(track, 18.0, terms=terms_on(track, track.track), **short)
    index = track.track.nearest_support(18.0)
    by_hand = simulate_hammer(track, 18.0, terms=(physics.HangingSleeper(index, 1.12e-3),), **short)
    assert np.array_equal(by_file[0].samples, by_hand[0].samples)


def test_accepted_effects_are_simulated_and_estimated_again_in_a_case(config):
    """The prediction with the accepted effect is that with the given effect; its column is the derivative."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(21.6, 24.0))
    campaign = measured_campaign(plan, seed=2)
    case = TrackCase(campaign, families=("local_ballast",))
    entry = {
        "term": "local_ballast",
        "fixed": {"sleeper": 24.0},
        "parameters": {"factor": GAP | {"value": 0.5, "unit": "-"}},
    }
    accept(finding(entry), config, "t1", anyway=True)
    accepted = accepted_of(track_of_turnout(config).terms)
    rail_without_effect = case.predictor.rail
    with_accepted = TrackCase(campaign, families=("local_ballast",), accepted=accepted)
    # passages are simulated on the rail that the impacts give with the effect, not on that without it
    assert (
        with_accepted.predictor.rail
        == {name: with_accepted.start_values[name] for name in rail_without_effect}
        != rail_without_effect
    )
    (own_nuisance,) = with_accepted.accepted.nuisances
    assert own_nuisance.mean == 0.5 and own_nuisance.sd == pytest.approx(0.25)
    assert len(with_accepted.candidates) == len(case.candidates) - 1
    values = {n.name: n.mean for n in with_accepted.nuisances}
    term = physics.LocalBallast(case.predictor.track().nearest_support(24.0), 0.5)
    with_it = with_accepted.predict(values, (), with_accepted.observations)
    assert all(np.array_equal(a, b) for a, b in zip(with_it, case.predict(values, (term,), case.observations)))
    jacobian = with_accepted.nuisance_jacobian(values, (), with_accepted.observations, with_it)
    shifted = with_accepted.predict({**values, own_nuisance.name: 0.501}, (), with_accepted.observations)
    for j, a, b in zip(jacobian, shifted, with_it):
        assert j.shape[1] == len(with_accepted.nuisances)
        # a difference quotient with step 0.005 against one with step 0.001
        assert j[:, -1] == pytest.approx((a - b) / 1e-3, abs=0.02 * np.abs((a - b) / 1e-3).max())


def test_an_effect_without_a_measurable_size_is_rejected(config):
    nothing = HANGING_SLEEPER | {"parameters": {"gap": GAP | {"value": 1e-6}}}
    with pytest.raises(SimulationError, match="no parameter differs"):
        accept(finding(nothing), config, "t1")
    assert accept(finding(nothing), config, "t1", anyway=True)[0].exists()


def test_a_diagnosis_with_another_track_file_is_computed_again(config):
    """Stored results of an interrupted run belong to the track file with which it was started."""
    turnout = SimpleNamespace(id="t1", folder=config, layout="small")
    for name in ("other", "ground"):
        shutil.copy(config / "tracks/small.yaml", config / f"tracks/{name}.yaml")
    own_file, found = digest_of_model(turnout), [digest_of_model(turnout, "other")]
    for name in ("other", "ground"):  # the first may extend the second
        with open(config / f"tracks/{name}.yaml", "a", encoding="utf-8") as file:
            file.write("# measured again\n")
        found.append(digest_of_model(turnout, "other"))
    assert len({own_file, *found}) == 4
    assert digest_of_model(turnout) == own_file


def accepted_as(effect, value, error):
    """An accepted effect with one parameter; the simulation below uses the parameter directly."""
    return SimpleNamespace(
        key=effect.name, parameters=effect.parameters[:1], values={effect.parameters[0].name: (value, error)},
        term=lambda track, values=None: values or {}, is_of=lambda *_: False,
    )  # fmt: skip


def test_the_prior_sd_of_an_accepted_limit_is_half_of_its_value():
    """80 m/s²: half of the neutral value of 100,000, which stands for no limit, would make it free."""
    (limit,) = effects_on(None, (accepted_as(physics.Clipping, 80.0, 1.0),)).nuisances
    assert limit.sd == pytest.approx(40.0)
    (gap,) = effects_on(None, (accepted_as(physics.HangingSleeper, 1e-3, 1e-5),)).nuisances
    assert gap.sd == pytest.approx(5e-4)


def test_the_derivative_by_an_accepted_gap_uses_the_side_where_the_simulation_converges():
    """The response is the squared gap in mm; nothing converges above 1 mm: the derivative is 2 less the step."""

    class Squared:
        def predict(self, values, terms, observations):
            if terms[0]["gap"] > 1e-3:
                raise SimulationError("Newton's iteration did not converge")
            return [np.array([(1e3 * terms[0]["gap"]) ** 2])]

        def nuisance_jacobian(self, nuisances, *others):
            return [np.zeros((1, len(nuisances)))]

    accepted = effects_on("track", (accepted_as(physics.HangingSleeper, 1e-3, 1e-5),))
    case = PredictedCase(Squared(), (), (), accepted=accepted)
    (gap,) = case.nuisances
    values, observations = {gap.name: 1e-3}, [SimpleNamespace(name="o")]
    predicted = case.predict(values, (), observations)
    (column,) = case.nuisance_jacobian(values, (), observations, predicted)
    assert column[0, 0] == pytest.approx(1e3 * (2.0 - 0.02 * 0.5), rel=1e-6)


def test_searches_include_accepted_effects_in_the_base_model():
    """Fixed at their fitted values: no nuisance parameter, no column of the Jacobian; all candidates are tested."""

    class Doubled:
        def predict(self, values, terms, observations):
            return [2.0 * terms[0]["gap"]]

    accepted = effects_on("track", (accepted_as(physics.HangingSleeper, 1e-3, 1e-5),))
    site, candidate = Nuisance("pad", "-", 0.0, 0.1), SimpleNamespace(family="local_pad", where={})
    case = PredictedCase(Doubled(), (), (site,), (candidate,), accepted)
    (_, gap), values = case.nuisances, {"pad": 0.0, "hanging_sleeper.gap": 2e-3}
    fit = fit_of(values, jacobian=[np.arange(6.0).reshape(2, 3)])
    fixed, trimmed = case.with_fixed_effects(fit)
    assert gap.name == "hanging_sleeper.gap" and fixed.nuisances == (site,) and fixed.candidates == (candidate,)
    assert fixed.predict({"pad": 0.5}, (), ()) == [4e-3]
    assert trimmed.jacobian[0].tolist() == [[0.0, 2.0], [3.0, 5.0]] and fit.jacobian[0].shape == (2, 3)
    again, same = fixed.with_fixed_effects(trimmed)
    assert again.predict({"pad": 0.5}, (), ()) == [4e-3] and same is trimmed


def fit_of(values, jacobian):
    return Fit(values, (), np.zeros(0), [], [], jacobian, {}, {}, 0.0, np.zeros((0, 0)), 0, [])


@pytest.mark.parametrize(
    ("effects", "finding_id", "message"),
    [
        ((None,), None, "t1: no finding names an effect. There is nothing to accept. The findings are: f0 A: named."),
        ((None,), "x", "t1: there is no finding x. Write one of them after --finding. The findings are: f0 A: named."),
        (("gap", "pad"), None, "several findings name an effect. Write one of them after --finding."),
        (("gap", "pad"), "f", "several findings begin with f. Write one of them after --finding."),
    ],
)
def test_a_missing_or_ambiguous_finding_is_an_error(tmp_path, monkeypatch, effects, finding_id, message):
    rows = [
        {"finding_id": f"f{k}", "sections": "A", "verdict": "named", "term": effect, "term_json": effect}
        for k, effect in enumerate(effects)
    ]
    results = Results(tmp_path, "t1")
    monkeypatch.setattr(results, "_rows", lambda: rows)
    monkeypatch.setattr(results, "_registry_rows", lambda table: [])
    with pytest.raises(SimulationError, match=re.escape(message)):
        results.finding(finding_id)


def test_every_possible_value_of_an_accepted_effect_has_a_prior():
    """A gain of 0 or a dip without sharpness has no share of itself as its standard deviation."""
    for effect in physics.TERMS:
        for p in effect.parameters:
            for value in (*p.bounds, p.neutral, 0.0):
                if p.bounds[0] <= value <= p.bounds[1]:
                    accepted = AcceptedEffects((AcceptedEffect(effect.name, {}, {p.name: (value, None)}),))
                    (nuisance,) = accepted.nuisances
                    assert nuisance.mean == value and nuisance.sd > 0.0


def test_accepted_effects_of_one_kind_at_one_position_have_nuisances_of_their_own():
    """As a pad that was accepted as a finding, and again as a change; dips 3 cm apart have one name as well."""
    dips = tuple(
        AcceptedEffect("surface_dip", {"place": x}, {"depth": (d, None)}) for x, d in ((12.01, 1e-3), (12.04, 2e-3))
    )
    accepted = effects_on(uniform_track(24.0), dips)
    first, second = (n.name for n in accepted.nuisances)
    assert first == "surface_dip[12.0 m].depth" != second
    assert [t.depth for t in accepted.terms({first: 3e-3, second: 4e-3})] == [3e-3, 4e-3]
    nuisances = accepted.nuisances
    fit = SimpleNamespace(values={first: 3e-3, second: 4e-3}, covariance=np.diag([1e-8, 4e-8]))
    assert [(e["value"], e["se"]) for e in accepted.estimates(nuisances, fit)] == [(3e-3, 1e-4), (4e-3, 2e-4)]
