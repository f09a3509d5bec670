"""Properties of every listed physical effect, with pressed and with lifted sleepers."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.turnout.candidates.rail_defects import SCANS
from turnout.physics import TERMS, PhysicsTerm, effects_by_name
from turnout.physics.hypothesis import (
    BaySite,
    BladeSite,
    ChannelSite,
    ContactSite,
    SaturatedChannelSite,
    SupportMotion,
    SupportSite,
    TrackSite,
    TrainSite,
)
from turnout.physics.term import COLUMN_TYPES, FORCE_TARGETS, FRAMES
from turnout.simulate import Sensor, car, simulate_hammer, simulate_passage, uniform_track
from turnout.simulate.blade import Blade
from turnout.simulate.effect import EFFECT_TYPES
from turnout.simulate.preparation import prepare
from turnout.simulate.run import run
from turnout.simulate.sensor import record_signal
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.wheel_path import BladeTop, Cosine, StockFall
from turnout.units import PARAMETER_UNITS

TRACK = uniform_track(24.0)
TURNOUT = TurnoutTrack(TRACK, {"main": ((Cosine(13.0, 1e-3, 1.0),),)})
SWITCH = TurnoutTrack(
    TRACK.with_(name="switch", blade=Blade(9.0, 12.3, 18.0, TRACK.rail, 3e8, 3e4)),
    {"main": ((StockFall(9.6, 3.0, 0.02),), (BladeTop(9.0, 3.0, 0.015),))},
)
SENSORS = (Sensor("A", 12.1), Sensor("B", 12.0, "sleeper"))
SITES = (
    SupportSite(20, 12.0, 30, 5, 35, True),
    BaySite(20, 12.3, 30),
    TrackSite(TRACK.rail, True),
    ChannelSite("A", 4, ("impacts 1:A",), True, 8.0, 6.0, 0.4),
    SaturatedChannelSite("A", 50.0, 1.0, 20.0),
    ContactSite((10.0, 12.1, 14.0)),
    TrainSite("heavy", 2),
    BladeSite(((18, 10.8), (20, 12.0)), ((21, 12.6), (22, 13.2)), 11.4, True),
)
EXTRA_UNITS = {"-", "1/K", "s", "rad", "Hz", "N", "m/s²", "°C", "V", "N/m per N"}


def passage(*terms, turnout=TURNOUT):
    """A light bogie over a dip: sleepers are pressed under the wheels, and lifted between and before them."""
    bogie = car(half_pivot=2.6, half_base=1.0)
    return simulate_passage(
        turnout, bogie, 40.0, SENSORS, terms=terms, rate=10e3, lead=0.05, tail=0.02, entry=3.0
    ).samples


def hammer(*terms, turnout=TURNOUT):
    quiet = [Sensor("A", 12.1), Sensor("B", 12.3)]
    return simulate_hammer(turnout.track, 12.0, sensors=quiet, n_impacts=1, duration=0.06, terms=terms)[0].samples[1:]


def recordings(term):
    turnout = turnout_of(type(term))
    return passage(term, turnout=turnout), hammer(term, turnout=turnout)


def turnout_of(term):
    """The turnout with a blade if the effect needs one."""
    return SWITCH if BladeSite in term.site_types else TURNOUT


@pytest.fixture(scope="module")
def bases():
    return {t.name: (passage(turnout=t), hammer(turnout=t)) for t in (TURNOUT, SWITCH)}


@pytest.fixture
def base(term, bases):
    return bases[turnout_of(term).name]


@pytest.mark.parametrize("term", TERMS, ids=lambda t: t.name)
class TestTerm:
    def test_the_effect_is_described(self, term):
        example = term.example()
        assert issubclass(term, PhysicsTerm) and dataclasses.is_dataclass(term)
        assert term.effect_type in EFFECT_TYPES and re.fullmatch(r"[a-z0-9_]+", term.name)
        words = example.sentence()
        assert len(words.split()) >= 5 and "{" not in words
        assert term.parameters, "an effect without a parameter cannot be fitted"
        fields = {f.name for f in dataclasses.fields(term)}
        for p in term.parameters:
            assert p.name in fields
            assert p.unit in PARAMETER_UNITS or p.unit in EXTRA_UNITS, p.unit
            assert p.bounds[0] <= p.neutral <= p.bounds[1] and p.bounds[0] < p.bounds[1]
            assert p.bounds[0] <= getattr(example, p.name) <= p.bounds[1]
            assert len(p.meaning.split()) >= 3
            assert re.search(r"\b(18|19|20)\d\d\b", p.source), f"no year in the source {p.source!r}"

    def test_the_message_of_the_effect_is_complete(self, term):
        example, size = term.example(), term.parameters[0]
        words = {f.name: "?" for f in dataclasses.fields(term)}
        words |= {name: "?" for name in ("place", "channel", "train", "wheel")}
        words |= {p.name: f"{getattr(example, p.name):.3g} {p.unit}" for p in term.parameters}
        words |= {f"{p.name}_size": words[p.name] for p in term.parameters}
        for text in filter(None, (term.message, term.message_negative, term.message_unbounded)):
            sentence = text.format(**words)
            assert len(sentence.split()) >= 3 and sentence[0].isupper() and not sentence.endswith(".")
        assert term.message
        assert not term.message_negative or size.bounds[0] < 0.0, "the size cannot be negative"
        assert not term.left_out_negative or size.bounds[0] < 0.0, "the size cannot be negative"

    def test_the_message_depends_on_the_sign_of_the_size(self, term):
        """A sentence with a direction, such as "gives more", has another version for a negative size."""
        size = term.parameters[0]
        if size.bounds[0] >= 0.0:
            return
        direction = re.compile(r"\b(more|stiffens?|soften|softens|lags?|late|dips?|yields|lose|rise|above|below)\b")
        assert bool(direction.search(term.message)) <= bool(term.message_negative)
        assert bool(direction.search(term.left_out)) <= bool(term.left_out_negative)
        if term.left_out_negative:
            amount = 0.5 * max(size.bounds[0], -size.bounds[1])
            negative = dataclasses.replace(term.example(), **{size.name: amount}).sentence()
            positive = dataclasses.replace(term.example(), **{size.name: -amount}).sentence()
            assert "-" not in negative.replace("wheel-rail", "")
            assert re.sub(r"[\d.]+", "", negative) != re.sub(r"[\d.]+", "", positive)
        assert len(term.site_check.split()) >= 4 and not term.site_check.endswith(".")
        assert not term.separating_test or term.separating_test.split()[0].islower()

    def test_the_effect_states_how_a_diagnosis_tests_it(self, term):
        assert term.frame in FRAMES and term.column_type in COLUMN_TYPES
        assert 0.0 <= term.model_error_share < 1.0 and term.smallest_reportable >= 0.0
        assert 1 <= term.n_size_parameters <= len(term.parameters)
        names = {term.limit_form, term.unbounded_form, *term.simpler_form[:1]} - {""}
        assert names <= set(effects_by_name()) - {term.name}
        found_by_a_scan = term in {effect for effect, _ in SCANS}
        assert term.asked == bool(term.site_types or found_by_a_scan)
        if term.column_type == "support":
            assert len(term.example().supports) >= 1

    def test_the_hypotheses_at_a_site_can_be_simulated(self, term):
        """Their starting values are within the bounds and not neutral, and they have all fields."""
        hypotheses = [h for site in SITES if isinstance(site, term.site_types) for h in term.hypotheses(site)]
        assert len(hypotheses) >= len(term.site_types)
        for hypothesis in hypotheses:
            parameters = hypothesis.parameters or term.parameters
            assert hypothesis.starts and hypothesis.n_scanned >= 1
            assert set(parameters) == set(term.parameters) or hypothesis.parameters
            for start in hypothesis.starts:
                assert len(start) == len(parameters)
                made = term(**hypothesis.fixed, **{p.name: value for p, value in zip(parameters, start)})
                made.check()
                assert all(p.bounds[0] <= value <= p.bounds[1] for p, value in zip(parameters, start))
                assert start[0] != parameters[0].neutral
                assert "{" not in made.sentence()

    def test_the_effect_vanishes_at_its_neutral_value(self, term, base):
        neutral = term.example().neutral()
        for found, expected in zip(recordings(neutral), base):
            assert np.max(np.abs(found - expected)) <= 1e-9 * np.max(np.abs(expected))

    def test_the_effect_changes_a_recording(self, term, base):
        example = term.example()
        changes = [
            np.max(np.abs(found - expected)) / np.max(np.abs(expected))
            for found, expected in zip(recordings(example), base)
        ]
        assert max(changes) > 1e-4, "the example changes neither a passage nor a hammer test"

    def test_a_resting_track_stays_at_rest(self, term):
        prepared = prepare(turnout_of(term).track, 1e-4, terms=(term.example(),))
        motion = run(prepared, 0.005).motion
        assert np.all(motion.u == 0.0) and np.all(motion.v == 0.0)
        if term.effect_type == "channel":
            silent = record_signal(Sensor("A", 12.1, cutoff=None), np.zeros(512), 20e3, None, (term.example(),))
            assert np.ptp(silent) < 1e-3 or "hum" in term.name

    def test_small_values_have_small_effects(self, term, base):
        """Continuity at the neutral value: a hundredth of the way changes less than the whole way.

        The comparison uses the norm: a rail that shears has a kink under a wheel, which a sensor 3 mm farther on gets
        one sample later."""
        example, neutral = term.example(), term.example().neutral()
        near = dataclasses.replace(
            example,
            **{p.name: p.neutral + 0.01 * (getattr(example, p.name) - p.neutral) for p in term.parameters},
        )
        assert neutral is not None
        small, whole = (
            sum(np.linalg.norm(found - expected) for found, expected in zip(recordings(t), base))
            for t in (near, example)
        )
        assert small < 0.2 * whole

    def test_forces_on_sleepers_vanish_in_every_state(self, term):
        if term.effect_type != "port":
            pytest.skip("the effect has no ports")
        position = np.linspace(-4e-4, 8e-4, TRACK.support.size)  # lifted and pressed
        state = SimpleNamespace(track=TRACK, sleeper_position=position, sleeper_velocity=0.1 * np.cos(9.0 * position))
        try:
            force = term.example().neutral().force(state)
        except TypeError:
            pytest.skip("the effect does not act only on sleepers")
        assert np.all(force == 0.0)


@pytest.mark.parametrize("term", TERMS, ids=lambda t: t.name)
def test_a_fault_of_one_type_of_recordings_is_a_form_of_the_same_fault_in_all(term):
    """It is named only where the recordings tell; any other effect has no general form."""
    if set(term.recording_types) == {"hammer", "passage"}:
        assert not term.general_form
        return
    general = effects_by_name()[term.general_form]
    assert set(term.recording_types) < set(general.recording_types)
    assert issubclass(term, general) and term.parameters == general.parameters
    assert term.smallest_reportable == general.smallest_reportable


@pytest.mark.parametrize("term", [t for t in TERMS if t.column_type == "support"], ids=lambda t: t.name)
def test_the_pseudo_force_is_the_static_force_of_its_links_and_ports(term):
    """Rail and sleeper are pressed down and at rest: the force of the springs, with the signs of the track."""
    example = term.example()
    (j, *_), motion = example.supports, {"rail": 2e-4, "sleeper": 1e-4}
    target, force = example.pseudo_force(
        SupportMotion(
            *(np.full(9, motion[name]) for name in ("rail", "sleeper")),
            10e3,
            TRACK.pad_stiffness[j],
            TRACK.ballast_stiffness[j],
        )
    )
    expected = 0.0
    for link in example.links(TRACK):
        if all(node[0] in motion for node, _ in link.ends):  # an additional node follows the track at rest
            expected -= link.stiffness * sum(weight * motion[node[0]] for node, weight in link.ends)
    for port in example.ports(TRACK):
        if port.ends[0][0][1] == j:
            d = sum(weight * motion[node[0]] for node, weight in port.ends)
            expected -= float(port.law.force(d - port.gap, 0.0))
    assert target in FORCE_TARGETS
    assert force == pytest.approx(np.full(9, expected), rel=1e-9, abs=1e-9)
