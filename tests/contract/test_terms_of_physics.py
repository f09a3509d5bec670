"""What every listed physics term promises, in pressed and in lifted states."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.physics import TERMS, PhysicsTerm
from turnout.physics.term import EFFECT_TYPES
from turnout.simulate import Sensor, car, simulate_hammer, simulate_passage, uniform_track
from turnout.simulate.preparation import prepare
from turnout.simulate.run import run
from turnout.simulate.sensor import record_signal
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.wheel_path import Cosine
from turnout.units import PARAMETER_UNITS

TRACK = uniform_track(24.0)
TURNOUT = TurnoutTrack(TRACK, {"main": ((Cosine(13.0, 1e-3, 1.0),),)})
SENSORS = (Sensor("A", 12.1), Sensor("B", 12.0, "sleeper"))
EXTRA_UNITS = {"-", "1/K", "s", "rad", "Hz", "N", "m/s²", "°C", "V", "N/m per N"}


def passage(*terms):
    """A light bogie over a dip: sleepers are pressed under the wheels and lifted between and ahead of them."""
    bogie = car(half_pivot=2.6, half_base=1.0)
    return simulate_passage(
        TURNOUT, bogie, 40.0, SENSORS, terms=terms, rate=10e3, lead=0.05, tail=0.02, entry=3.0
    ).samples


def hammer(*terms):
    quiet = [Sensor("A", 12.1), Sensor("B", 12.3)]
    return simulate_hammer(TRACK, 12.0, sensors=quiet, n_blows=1, duration=0.06, terms=terms)[0].samples[1:]


@pytest.fixture(scope="module")
def base():
    return passage(), hammer()


@pytest.mark.parametrize("term", TERMS, ids=lambda t: t.name)
class TestTerm:
    def test_it_is_described(self, term):
        example = term.example()
        assert issubclass(term, PhysicsTerm) and dataclasses.is_dataclass(term)
        assert term.effect_type in EFFECT_TYPES and re.fullmatch(r"[a-z0-9_]+", term.name)
        words = example.sentence()
        assert len(words.split()) >= 5 and "{" not in words
        assert term.parameters, "a term without a parameter cannot be fitted"
        fields = {f.name for f in dataclasses.fields(term)}
        for p in term.parameters:
            assert p.name in fields
            assert p.unit in PARAMETER_UNITS or p.unit in EXTRA_UNITS, p.unit
            assert p.bounds[0] <= p.neutral <= p.bounds[1] and p.bounds[0] < p.bounds[1]
            assert p.bounds[0] <= getattr(example, p.name) <= p.bounds[1]
            assert len(p.meaning.split()) >= 3
            assert re.search(r"\b(18|19|20)\d\d\b", p.source), f"no year in the source {p.source!r}"

    def test_it_vanishes_at_its_neutral_value(self, term, base):
        neutral = term.example().neutral()
        for found, expected in zip((passage(neutral), hammer(neutral)), base):
            assert np.max(np.abs(found - expected)) <= 1e-9 * np.max(np.abs(expected))

    def test_it_changes_something(self, term, base):
        example = term.example()
        changes = [
            np.max(np.abs(found - expected)) / np.max(np.abs(expected))
            for found, expected in zip((passage(example), hammer(example)), base)
        ]
        assert max(changes) > 1e-4, "the example changes neither a passage nor a hammer test"

    def test_a_resting_track_stays_at_rest(self, term):
        prepared = prepare(TRACK, 1e-4, terms=(term.example(),))
        motion = run(prepared, 0.005).motion
        assert np.all(motion.u == 0.0) and np.all(motion.v == 0.0)
        if term.effect_type == "channel":
            silent = record_signal(Sensor("A", 12.1, cutoff=None), np.zeros(512), 20e3, None, (term.example(),))
            assert np.ptp(silent) < 1e-3 or "hum" in term.name

    def test_small_values_have_small_effects(self, term, base):
        """Continuous at the neutral value: a hundredth of the way there changes less than all of the way. In the norm:
        a rail that shears has a kink under a wheel, which a sensor 3 mm further on records one sample later."""
        example, neutral = term.example(), term.example().neutral()
        near = dataclasses.replace(
            example,
            **{p.name: p.neutral + 0.01 * (getattr(example, p.name) - p.neutral) for p in term.parameters},
        )
        assert neutral is not None
        small, whole = (
            np.linalg.norm(passage(t) - base[0]) + np.linalg.norm(hammer(t) - base[1]) for t in (near, example)
        )
        assert small < 0.2 * whole

    def test_forces_on_sleepers_vanish_in_every_state(self, term):
        if term.effect_type != "port":
            pytest.skip("acts without ports")
        position = np.linspace(-4e-4, 8e-4, TRACK.support.size)  # lifted and pressed
        state = SimpleNamespace(track=TRACK, sleeper_position=position, sleeper_velocity=0.1 * np.cos(9.0 * position))
        try:
            force = term.example().neutral().force(state)
        except TypeError:
            pytest.skip("does not act on sleepers alone")
        assert np.all(force == 0.0)
