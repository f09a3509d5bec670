"""Values of the whole track that a fit puts beyond their tolerance are stated with their ratio to the file."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout.mismatch.turnout.priors import TRACK
from turnout.stages.values_off_file import sentences_on_values

SHEAR = Nuisance("rail_shear", "-", 0.0, 0.12, meaning="ln shear stiffness of the rail", group="rail")


def sentences_of(*values_and_errors):
    """The sentences about (nuisance parameter, value, standard error), ..."""
    values = {n.name: v for n, v, _ in values_and_errors}
    covariance = np.diag([error**2 for *_, error in values_and_errors])
    fit = SimpleNamespace(values=values, covariance=covariance)
    return sentences_on_values([n for n, *_ in values_and_errors], fit)


def test_a_rail_softer_than_its_tolerance_is_stated_with_factor_and_interval():
    """exp(-0.631) = 0.532, exp(-0.631 ± 1.96 * 0.03) = 0.502 and 0.564; 0.631 / 0.12 = 5.26."""
    (sentence,) = sentences_of((SHEAR, -0.631, 0.03))
    assert sentence == (
        "The shear stiffness of the rail is 0.53 times that of the file (0.50 to 0.56): 5.3 times its tolerance."
    )


def test_the_interval_contains_the_error_of_the_model():
    """exp(-0.631 ± 1.96 * hypot(0.03, 0.04)) = 0.482 and 0.587."""
    (sentence,) = sentences_of((replace(SHEAR, model_sd=0.04), -0.631, 0.03))
    assert "is 0.53 times that of the file (0.48 to 0.59): 5.3 times its tolerance." in sentence


@pytest.mark.parametrize(("value", "stated"), [(0.359, False), (0.361, True), (-0.359, False), (-0.361, True)])
def test_a_value_beyond_three_tolerances_in_either_direction_is_stated(value, stated):
    assert bool(sentences_of((SHEAR, value, 0.01))) is stated


def test_the_largest_deviation_is_first_and_a_wheelset_is_stated_with_its_train():
    wheels = Nuisance("wheels_railcar", "-", 0.0, 0.06, meaning="ln unsprung mass", group="wheels")
    first, second = sentences_of((SHEAR, -0.5, 0.02), (wheels, 0.4, 0.02))
    assert (
        "The unsprung mass of railcar is 1.49 times that of the file" in first
    )  # 6.7 tolerances; the rail deviates by 4.2
    assert "The shear stiffness of the rail is 0.61 times" in second


def test_values_that_are_not_of_the_whole_track_are_not_stated():
    """A wave, the speed of one passage, one support of many; the running surface has a separate sentence."""
    wave = Nuisance("wave_3", "m", 0.0, 1e-5, group="wave")
    speed = Nuisance("v@p1", "-", 0.0, 0.01, "p1", meaning="ln speed")
    pad = Nuisance("pad_37", "-", 0.0, 0.1, meaning="ln pad_stiffness of 37", group="pad", index=37)
    depth = Nuisance("nose", "-", 0.0, 0.1, meaning="ln depth of the kink", group="surface")
    assert sentences_of((wave, 1e-3, 1e-6), (speed, 0.2, 0.001), (pad, 1.0, 0.01), (depth, 1.0, 0.01)) == []


def test_all_values_of_the_whole_track_of_a_case_can_be_stated():
    """Pads, ballast, sleepers, the rail and the wheelsets, each changed by four tolerances."""
    case = PlannedCase(small_plan(), families=("sensor_gain",))
    whole_track = [n for n in case.nuisances if n.group in ("track", "rail", "wheels")]
    assert {n.group for n in whole_track} == {"track", "rail", "wheels"}
    for nuisance in whole_track:
        (sentence,) = sentences_of((nuisance, 4.0 * nuisance.sd, 0.01))
        assert sentence.endswith(": 4.0 times its tolerance.")
        assert "_" not in sentence.removesuffix(nuisance.name.removeprefix("wheels_"))


def test_the_shear_of_the_rail_and_the_mass_of_sleepers_have_an_error_of_the_model():
    case = PlannedCase(small_plan(), families=("sensor_gain",))
    errors = {n.name: n.model_sd for n in case.nuisances if n.model_sd}
    assert errors == {"rail_shear": TRACK.rail_shear_model_sd, "sleeper_mass": TRACK.sleeper_mass_model_sd}
