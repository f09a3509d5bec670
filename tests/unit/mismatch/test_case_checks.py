"""Cases that cannot be fitted: a message that names the part, instead of an answer or an error of linear algebra."""

import numpy as np
import pytest
from examples.oscillator_case import OscillatorCase
from examples.own_system import Mount, Pendulum, made_records, show

from turnout.errors import SimulationError
from turnout.mismatch import Candidate, Case, Nuisance, Observation, diagnose
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.physics import Parameter

T = np.arange(200) / 100.0
LEVELS = {"a": 0.5, "b": 1.0, "c": 1.5, "held out": 1.2}


class Spring(Case):
    """Loads on a hardening spring; ``change`` is applied to what its simulation returns."""

    def __init__(
        self, change=lambda p: p, names=("a", "b", "c"), owner=None, starts=((0.1,),), bounds=(-2.0, 2.0), shape=1.0
    ):
        rng = np.random.default_rng(0)
        self.change = change

        def recording(name):
            x = LEVELS[name] * np.sin(5.0 * T) * shape
            return Observation(name, name, x + 0.2 * x**3 + 0.002 * shape * rng.normal(size=T.size), 0.01, 0.2)

        self.observations = tuple(recording(name) for name in names)
        self.reserved = (recording("held out"),)
        self.nuisances = (Nuisance("stiffness", "-", 1.0, 0.5, owner=owner),)
        size = Parameter("amount", "-", 0.0, bounds, "share of a cubic spring", "made up")
        self.candidates = (Candidate.of("cubic", (size,), lambda psi: psi["amount"], starts, frame="amplitude"),)

    def predict(self, values, terms, observations):
        loads = [LEVELS[o.name] * np.sin(5.0 * T) for o in observations]
        return self.change([values["stiffness"] * x + sum(terms) * x**3 for x in loads])


def test_a_case_that_can_be_fitted_passes_and_its_amount_has_an_interval():
    found = diagnose(Spring())
    assert found.names == ("cubic",)
    (estimate,) = found.fit.estimates
    name, value, sign, half, _, unit = estimate.split()
    assert (name, sign, unit) == ("amount", "±", "%)")
    assert float(value) == pytest.approx(0.2, abs=float(half)) and 0.0 < float(half) < 0.02


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: [x[:-1] for x in p], "'a' must be real numbers of shape"),
        (lambda p: [x[:1] for x in p], "'a' must be real numbers of shape"),  # would be repeated for all samples
        (lambda p: [x[:, None] for x in p], "'a' must be real numbers of shape"),
        (lambda p: [x + 0j for x in p], "not complex128"),
        (lambda p: [list(x) for x in p], "not list"),
        (lambda p: p[:1], "3 arrays, one per observation, not 1"),
        (lambda p: None, "not NoneType"),
    ],
    ids=["shorter", "one sample", "column", "complex", "lists", "fewer", "none"],
)
def test_a_prediction_that_does_not_fit_its_recording_is_rejected(change, message):
    with pytest.raises(ValueError, match=message):
        diagnose(Spring(change))


def test_a_prediction_that_is_not_a_number_is_no_answer():
    """It was "none", with a probability of 0.93."""
    with pytest.raises(SimulationError, match="prediction of 'a' is nan at sample 3 of 200"):
        diagnose(Spring(lambda p: [np.where(np.arange(x.size) == 3, np.nan, x) for x in p]))


def test_a_step_to_values_that_are_not_finite_is_a_simulation_that_fails():
    """Derivatives that overflow give such a step; a model that rounds its values then ended the diagnosis."""
    case = Spring()
    case.predict = lambda values, terms, observations: [round(values["stiffness"]) * T for _ in observations]
    joint = JointProblem(case, ())
    assert joint.predict_or_none(np.array([np.nan])) is None and joint.predict_or_none(np.array([np.inf])) is None
    assert joint.predict_or_none(np.array([1.0])) is not None


def test_a_fit_avoids_values_at_which_the_simulation_diverges():
    case = Spring()
    plain = case.predict

    def diverging(values, terms, observations):
        predictions = plain(values, terms, observations)
        return [np.full(p.shape, np.inf) for p in predictions] if abs(sum(terms)) > 0.25 else predictions

    case.predict = diverging
    assert diagnose(case).names == ("cubic",)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"names": ()}, "no observations"),
        ({"names": ("a", "a", "c")}, "two recordings of the case are called 'a'"),
        ({"names": ("a", "b", "held out")}, "two recordings of the case are called 'held out'"),
        ({"owner": "nobody"}, "owner 'nobody' is none of the recordings"),
        ({"starts": ()}, "has no starts"),
        ({"starts": ((0.1, 0.2),)}, "must hold 1 finite numbers"),
        ({"starts": (0.1,)}, "must hold 1 finite numbers"),
        ({"bounds": (2.0, -2.0)}, "bounds with the lower one first"),
        ({"bounds": (-np.inf, 2.0)}, "finite bounds"),
        ({"shape": 0.0}, "all observations of the case are constant"),
    ],
)
def test_parts_of_a_case_that_contradict_each_other_are_rejected(options, message):
    with pytest.raises(ValueError, match=message):
        diagnose(Spring(**options))


@pytest.mark.parametrize(
    ("mean", "sd", "bounds", "message"),
    [
        (np.nan, 1.0, (-np.inf, np.inf), "mean nan"),
        (1.0, 0.0, (-np.inf, np.inf), "known exactly"),
        (1.0, -0.5, (-np.inf, np.inf), "above 0"),
        (1.0, np.nan, (-np.inf, np.inf), "must be finite"),
        (1.0, 0.5, (5.0, 1.0), "within the bounds 5 and 1"),
        (1.0, 0.5, (2.0, 5.0), "within the bounds 2 and 5"),
        ("1.0", 0.5, (-np.inf, np.inf), "must be numbers"),
    ],
)
def test_a_nuisance_parameter_without_a_usable_prior_is_rejected(mean, sd, bounds, message):
    with pytest.raises(ValueError, match=rf"'stiffness'.*{message}"):
        Nuisance("stiffness", "N/m", mean, sd, bounds=bounds)


@pytest.mark.parametrize(
    ("data", "sigma", "effective", "message"),
    [
        (np.zeros(0), 0.1, 1.0, "no samples"),
        (np.ones(5), 0.0, 1.0, "state the noise of the sensor"),
        (np.ones(5), np.inf, 1.0, "sigma must be finite"),
        (np.ones(5), 0.1, 2.0, "effective is 2.0"),
        (np.ones(5), 0.1, np.nan, "effective is nan"),
        (np.array([1.0, np.nan]), 0.1, 1.0, "finite numbers"),
    ],
)
def test_an_observation_that_no_fit_can_use_is_rejected(data, sigma, effective, message):
    with pytest.raises(ValueError, match=f"'r'.*{message}"):
        Observation("r", "c", data, sigma, effective)


def mount(change=lambda record: record, rate=200.0, frequency=(3.8, 0.5), reserved=True, **options):
    records = [change(r) for r in made_records("quadratic_drag", 0.3, (0.3, 0.6, 1.0, 0.8), seconds=4.0)]
    return Mount(records[:3], records[3:] if reserved else [], rate, frequency, (0.03, 0.03), (90.0, 30.0), **options)


def oscillator(change=lambda record: record, frequency=(3.8, 0.5), **options):
    records = [change(r) for r in made_records("quadratic_drag", 0.3, (0.3, 0.6, 1.0, 0.8), seconds=4.0)]
    options = {"skipped": 100, **options}
    return OscillatorCase(records[:3], records[3:], 200.0, frequency, (0.03, 0.03), (0.15, 0.1), **options)


def with_force(force):
    return lambda record: (*record[:2], force(record[2]), record[3])


@pytest.mark.parametrize("example", [mount, oscillator])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"change": with_force(lambda f: np.where(np.arange(f.size) == 5, np.nan, f))}, "missing samples"),
        ({"change": with_force(lambda f: f[:-7])}, "two rows of equal length"),
        ({"change": with_force(lambda f: f[:1])}, "two rows of equal length"),
        ({"change": lambda r: (*r[:2], r[2][:1], r[3][:1])}, "two rows of equal length"),
        ({"frequency": (0.0, 0.5)}, "frequency is 0.*above 0"),
        ({"frequency": (3.8, 0.0)}, "known exactly"),
        ({"without": ("coulomb",)}, "no law is called 'coulomb'"),
    ],
)
def test_example_cases_reject_what_they_cannot_simulate(example, options, message):
    with pytest.raises(ValueError, match=message):
        example(**options)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"rate": 0.0}, "rate is 0"), ({"rate": "200 Hz"}, "200 Hz"), ({"tolerance": -1.0}, "must not be negative")],
)
def test_a_mount_rejects_numbers_out_of_range(options, message):
    with pytest.raises(ValueError, match=message):
        mount(**options)


def test_an_oscillator_whose_records_end_before_they_are_compared_is_rejected():
    with pytest.raises(ValueError, match="800 samples, of which the first 800 are not compared"):
        oscillator(skipped=800)


def test_a_simulation_that_diverges_ends_the_diagnosis_with_its_time():
    """It continued from rest, and the answer was that of the records."""
    with pytest.raises(SimulationError, match="prediction of 'record 0' is nan at sample"):
        diagnose(mount(rate=5.0))


def test_the_programs_say_what_an_answer_was_tested_with(capsys):
    show("forced", diagnose(mount(reserved=False)))
    named = capsys.readouterr().out
    assert "named: quadratic drag" in named and "± " in named and "no record was held out" in named
    assert "no law is named" not in named
    records = made_records("", 0.0, (1.0, 0.5, 0.25, 0.7), force_sd=0.0, seconds=4.0)
    show("free", diagnose(Pendulum(records[:3], records[3:], 200.0, (3.8, 0.5), (0.03, 0.03))))
    without_effect = capsys.readouterr().out
    assert "Diagnosis(none" in without_effect and "no law is named" not in without_effect
