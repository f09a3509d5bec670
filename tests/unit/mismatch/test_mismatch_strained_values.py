"""A model that absorbs an effect by a value beyond all tolerances is not intact."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.strained_values import conflict_of_files, strained_value
from turnout.physics import Parameter
from turnout.stages.finding_row import recommendation

TIME = np.linspace(0.0, 1.0, 400)
TOLERANCE, THRESHOLD = 0.1, MismatchSettings().threshold
BUMP = np.cos(57.0 * TIME)
SIZE = (Parameter("size", "-", 0.0, (-1.0, 1.0), "of a shape", "made up 2026"),)


class Beam(Case):
    """A response that the logarithm of a stiffness scales. One candidate has another shape and explains nothing."""

    def __init__(self, shift, bound=6.0, bump=0.0, **more):
        stiffness = Nuisance(
            "bending", "-", 0.0, TOLERANCE, None, (-bound * TOLERANCE, bound * TOLERANCE), "ln bending"
        )
        self.nuisances = (replace(stiffness, **more), Nuisance("mass", "-", 0.0, 0.1, meaning="ln mass"))
        self.candidates = (Candidate.of("bump", SIZE, dict, ((0.1,),), {"place": 3.0}),)
        rng = np.random.default_rng(3)
        self.observations = tuple(
            Observation(
                f"o{k}", f"day {k}", self.response(shift, 0.0) + bump * BUMP + 0.1 * rng.normal(size=TIME.size), 0.1
            )
            for k in range(3)
        )

    @staticmethod
    def response(bending, mass):
        return np.exp(bending) * np.sin(20.0 * TIME) + mass * np.cos(31.0 * TIME)

    def predict(self, values, terms, observations):
        bump = sum(t["size"] for t in terms) * BUMP
        return [self.response(values["bending"], values["mass"]) + bump for _ in observations]


def strained_value_of(case):
    return strained_value(case, fit_jointly(case, iterations=40), THRESHOLD)


@pytest.mark.parametrize("sds", [5.7, -5.7])
def test_a_value_with_a_prior_cost_above_the_threshold_of_a_name_is_strained(sds):
    """5.7 standard deviations cost 16.2 nats, of which the choice among two takes 0.7."""
    value = strained_value_of(Beam(sds * TOLERANCE))
    assert value.nuisance.name == "bending" and "5." in str(value)
    assert value.nats == pytest.approx(0.5 * value.deviation**2 - np.log(2.0), rel=0.02)


@pytest.mark.parametrize("sds", [0.0, 3.0, -4.8])
def test_a_value_with_a_prior_cost_below_the_threshold_is_not_strained(sds):
    """4.8 standard deviations cost 11.5 nats: less than a name."""
    assert strained_value_of(Beam(sds * TOLERANCE)) is None


def test_the_number_of_values_among_which_the_farthest_was_chosen_counts():
    """5.2 standard deviations cost 13.5 nats; the largest of a hundred values needs 4.6 more than the threshold."""
    case = Beam(5.2 * TOLERANCE)
    assert strained_value_of(case)
    case.nuisances += tuple(Nuisance(f"v{k}", "-", 0.0, 1.0) for k in range(98))
    assert strained_value_of(case) is None


@pytest.mark.parametrize("error", [0.01, 0.1, 0.3])
def test_a_value_that_its_prior_reduces_still_shows_the_conflict(error):
    """Data alone give x with the standard error e; its density is N(0, sd² + e²), for any value of the fit."""
    case, at = Beam(0.0, at=("sensor", "S1")), 0.8
    weight = TOLERANCE**2 / (TOLERANCE**2 + error**2)
    fit = SimpleNamespace(
        values={"bending": weight * at, "mass": 0.0}, covariance=np.diag([weight * error**2, 0.01 * TOLERANCE**2])
    )
    paid = 0.5 * at**2 / (TOLERANCE**2 + error**2) - np.log(2.0)
    value = strained_value(case, fit, paid - 1e-6)
    assert value.nats == pytest.approx(paid) and value.deviation == pytest.approx(weight * at / TOLERANCE)
    assert strained_value(case, fit, paid + 1e-6) is None


def test_a_value_that_the_data_do_not_determine_is_not_strained():
    fit = SimpleNamespace(values={"bending": 0.1, "mass": 0.0}, covariance=np.diag([TOLERANCE**2, 0.1**2]))
    assert strained_value(Beam(0.0), fit, THRESHOLD) is None


@pytest.mark.parametrize("more", [{"owner": "o0"}, {"index": 4}, {"can_mask": False}])
def test_values_of_one_recording_one_of_many_and_of_a_surface_do_not_count(more):
    assert strained_value_of(Beam(0.57, **more)) is None


def test_a_gain_that_masks_no_effect_counts_if_its_channel_is_known():
    assert strained_value_of(Beam(0.57, can_mask=False, at=("sensor", "S1"))).nuisance.at == ("sensor", "S1")


def test_a_value_that_masks_an_effect_is_not_strained():
    case = Beam(0.57)
    site = replace(case.candidates[0].site, masking_parameter="bending")
    case.candidates = (replace(case.candidates[0], site=site),)
    assert strained_value_of(case) is None


def test_a_strained_value_gives_the_answer_unknown_although_the_residual_is_small():
    """Formerly the answer was that such a model agrees like an intact one, since its residual is noise."""
    strained_case, intact = (diagnose(Beam(sds * TOLERANCE)) for sds in (5.7, 0.5))
    assert max(strained_case.base.level.values()) < 1.2
    assert strained_case.verdict.answer == "unknown" and "bending" in strained_case.verdict.reason
    assert intact.verdict.answer == "none"


def test_a_name_beside_a_strained_value_is_withdrawn_and_the_value_is_the_location():
    """Wheelsets beyond their tolerance leave a small residual that another effect may explain, such as contact
    stiffness."""
    at = ("train", "railcar")
    named, withdrawn = (diagnose(Beam(sds * TOLERANCE, bump=0.1, at=at)) for sds in (0.5, 5.7))
    assert named.verdict.names == ("bump",)
    assert withdrawn.verdict.answer == "unknown" and "bending" in withdrawn.verdict.reason
    assert withdrawn.where.train == "railcar" and withdrawn.where.place is None


RAIL, SLEEPER, WHEELS = (
    Nuisance(name, "-", 0.0, 0.1, meaning=f"ln {words}", group=group)
    for name, words, group in (
        ("shear", "shear stiffness of the rail", "rail"),
        ("sleeper_mass", "sleeper_mass", "track"),
        ("wheels_railcar", "unsprung mass", "wheels"),
    )
)


def conflict(*deviations):
    """Of rail, sleepers and wheelsets that lie so many tolerances off their files."""
    nuisances = (RAIL, SLEEPER, WHEELS)
    values = {n.name: 0.1 * d for n, d in zip(nuisances, deviations, strict=True)}
    return conflict_of_files(nuisances, SimpleNamespace(values=values, covariance=np.eye(3)), THRESHOLD)


def test_files_are_in_conflict_if_two_parts_of_the_model_are_far_off():
    """4.0² / 2 + 3.8² / 2 - 2 ln 3 = 13.0 nats, above the 12 of a name."""
    assert conflict(0.0, 4.0, -3.8) == (
        "sleeper mass (it differs from the file by 4.0 times its tolerance), "
        "unsprung mass of railcar (it differs from the file by 3.8 times its tolerance)"
    )


@pytest.mark.parametrize(
    "deviations",
    [
        (0.0, 0.0, 11.0),  # wheelsets alone: the vehicle file is wrong, and a name beside them may be right
        (0.0, 3.4, 3.6),  # 12.3 nats of two values among three, of which the choice takes 2.2
        (2.9, 2.9, 2.9),  # none is beyond three tolerances
    ],
)
def test_one_wrong_part_or_little_conflict_leaves_a_name(deviations):
    assert conflict(*deviations) == ""


def test_a_name_beside_files_in_conflict_is_withdrawn():
    """Without a lock neither value is located, and neither alone would withdraw the name."""
    case = Beam(4.5 * TOLERANCE, group="rail", bump=0.3)
    named = diagnose(case)
    assert named.verdict.answer == "named"
    case.nuisances = (case.nuisances[0], replace(case.nuisances[1], sd=0.1, group="track"))
    shape = np.cos(31.0 * TIME)
    case.observations = tuple(replace(o, data=o.data + 0.45 * shape) for o in case.observations)
    withdrawn = diagnose(case)
    assert withdrawn.verdict.answer == "unknown"
    assert "bending" in withdrawn.verdict.reason and "mass" in withdrawn.verdict.reason
    assert "vehicle files" in recommendation(withdrawn)
