"""Our own numerical error, on passages whose error is known because they are made with it."""

from types import SimpleNamespace

import numpy as np

from turnout.physics import LocalBallast
from turnout.simulate import Sensor, car, prepare_passage, uniform_track
from turnout.simulate import numerical_error as module
from turnout.simulate.numerical_error import PassageCase, numerical_error

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


def test_what_was_prepared_is_prepared_anew_for_each_run_with_its_terms(monkeypatch):
    passages = Passages(monkeypatch)
    terms = (LocalBallast(20, 0.3),)
    numerical_error(case(rate=10e3, prepared=prepare_passage(TRACK, terms, 10e3, scheme="midpoint")))
    assert [o.get("substeps") for o in passages.options] == [1, 2, 1]
    for options in passages.options:
        assert "prepared" not in options and (options["terms"], options["scheme"]) == (terms, "midpoint")
