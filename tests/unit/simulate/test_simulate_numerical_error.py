"""Numerical error of the simulation, estimated on passages with a known error."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.physics import TERMS, LocalBallast
from turnout.simulate import Sensor, car, prepare_passage, uniform_track
from turnout.simulate import discretization_error as module
from turnout.simulate.blade import Blade
from turnout.simulate.discretization_error import PassageCase, end_error, numerical_error
from turnout.simulate.links import SUPPORT_FIELDS, shift_supports

TRACK = uniform_track(24.0)
TRUE = np.random.default_rng(3).normal(size=(1, 4096))


class Passages:
    """Stands in for ``simulate_passage``: the true signal times 1 + a / elements^2 + b / substeps^order."""

    def __init__(self, monkeypatch, mesh=0.0, step=0.0, order=3):
        self.mesh, self.step, self.order, self.options = mesh, step, order, []
        monkeypatch.setattr(module, "simulate_passage", self)

    def __call__(self, track, vehicle, speed, sensors, **options):
        self.options.append(options)
        error = self.mesh / track.elements_per_bay**2 + self.step / options.get("substeps", 1) ** self.order
        return SimpleNamespace(samples=(1.0 + error) * TRUE)


def case(**options):
    return PassageCase(TRACK, car(), 30.0, (Sensor("A", 12.0),), options)


def test_a_prepared_track_is_prepared_again_for_each_run_with_its_terms(monkeypatch):
    passages = Passages(monkeypatch)
    terms = (LocalBallast(20, 0.3),)
    numerical_error(case(rate=10e3, prepared=prepare_passage(TRACK, terms, 10e3, scheme="midpoint")))
    assert [o.get("substeps") for o in passages.options] == [1, 2, 1]
    for options in passages.options:
        assert "prepared" not in options and (options["terms"], options["scheme"]) == (terms, "midpoint")


@pytest.mark.parametrize(("scheme", "order"), [("radau", 3), ("midpoint", 2)])
def test_the_error_is_that_of_the_requested_run(monkeypatch, scheme, order):
    """The error is 2 % by the step and 1 % by the mesh; the finer run, to which it is relative, errs by up to 3 %."""
    Passages(monkeypatch, mesh=0.16, step=0.02, order=order)
    found = numerical_error(case(scheme=scheme))
    assert found.step == pytest.approx(0.02, rel=0.03)
    assert found.mesh == pytest.approx(0.01, rel=0.03)


def placed(track, term):
    """Places [m] at which a term acts on a track."""
    parts = [*term.links(track), *term.ports(track)]
    return sorted({round(float(track.support[name[1]]), 6) for part in parts for name, _ in part.ends})


COUNTING = [term for term in TERMS if {f.name for f in fields(term)} & set(SUPPORT_FIELDS)]


@pytest.mark.parametrize("term", COUNTING, ids=lambda t: t.name)
def test_terms_stay_where_they_are_on_a_longer_track(term):
    switch = TRACK.with_(blade=Blade(9.0, 12.3, 18.0, TRACK.rail, 3e8, 3e4))  # effects of a blade need one
    example, longer = term.example(), module._lengthen(switch, 6.0)
    assert placed(longer, shift_supports(example, 10)) == placed(switch, example) != []


def test_every_field_that_counts_supports_is_listed():
    """Numbers of supports are integers, as those of wheels, waves and seeds are."""
    whole = {f.name for term in TERMS for f in fields(term) if f.type in (int, "int")}
    assert whole - {"wheel", "order", "seed"} == set(SUPPORT_FIELDS)


def test_the_ends_of_the_track_do_not_affect_a_term_in_the_middle():
    """Absorbing ends reflect no waves over 12 m; a term that moved by 12 m would change half of the signal."""
    track = uniform_track(36.0, end_length=6.0, end_damping=400.0)
    options = {"lead": 0.1, "tail": 0.05, "rate": 10e3, "terms": (LocalBallast(30, 0.3),)}
    found = end_error(PassageCase(track, car(half_pivot=2.6), 40.0, (Sensor("A", 18.0),), options), 12.0)
    assert found[0, :3].max() < 0.01
