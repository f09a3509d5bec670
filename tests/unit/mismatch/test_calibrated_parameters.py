"""Parameters of the calibrated model: deviations of a visit and random walks where the file is uncertain."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.calibration import calibrated_parameters

SUPPORTS = 0.6 * np.arange(6)
EFFECTS_AT = range(2, 6)  # the two supports before them absorb effects farther out
SENSORS = tuple(SimpleNamespace(name=name, place=place) for name, place in (("A1", 1.1), ("A2", 2.2)))
SDS = {"pad": 0.1, "ballast": 0.1, "sleeper": 0.03}
UNSURE = 3.0  # times the standard deviation of other supports, at the first support of a section


def parameters(unsure_at, more=(), waves=None):
    """Parameters by name of six supports, one of which is uncertain in the file."""
    nuisances = [
        Nuisance(f"{group}_{j}", "-", 0.0, sd * (UNSURE if j == unsure_at else 1.0), group=group, index=j)
        for group, sd in SDS.items()
        for j in range(len(SUPPORTS))
    ]
    turnout = SimpleNamespace(track=SimpleNamespace(support=SUPPORTS))
    zone = SimpleNamespace(turnout=turnout, castings=(), effect_supports=EFFECTS_AT)
    case = SimpleNamespace(
        data=SimpleNamespace(site=SimpleNamespace(nominal=zone, waves=waves)),
        campaign=SimpleNamespace(turnout=turnout, sensors=SENSORS, hammer=()),
        accepted=SimpleNamespace(nuisances=()),
        nuisances=(*nuisances, *more),
    )
    return {p.name: p for p in calibrated_parameters(case).values()}


@pytest.mark.parametrize("group", SDS)
def test_the_deviation_of_outer_supports_at_a_visit_does_not_depend_on_the_file(group):
    found = parameters(unsure_at=1)
    assert found[f"{group}@0.60"].sd == pytest.approx(UNSURE * SDS[group])
    own = [found[f"{group}@{x:.2f}"].visit_sd for x in SUPPORTS]
    assert own == pytest.approx([5.0 * SDS[group]] * 2 + [0.0] * 4)


@pytest.mark.parametrize("group", SDS)
def test_values_that_are_uncertain_in_the_file_have_the_same_random_walk(group):
    found = parameters(unsure_at=3)
    walks = {found[f"{group}@{x:.2f}"].walk_sd for x in SUPPORTS}
    assert len(walks) == 1 and 0.0 < walks.pop() <= 0.03


def test_supports_beside_a_sensor_are_not_beyond_the_sensors():
    """Sensors at 1.1 and 2.2 m: the sleepers at 1.2 and 2.4 m are beside them, those at 0.6 and 3.0 m beyond."""
    pads = [p for p in parameters(unsure_at=3).values() if p.group == "pad"]
    assert [p.position for p in pads if p.is_beyond_sensors] == pytest.approx([0.0, 0.6, 3.0])


def test_numbers_of_a_nose_have_its_position_and_waves_their_stretch():
    """Formerly they had none, as if they were values of the whole track: ``twin_states`` said so."""
    surface = [
        Nuisance("surface_0", "-", 0.0, 0.4, group="surface", meaning="ln depth of the kink at 5.24 m"),
        Nuisance("surface_1", "m", 0.0, 0.01, group="surface", meaning="place of the kink at 5.24 m less its file's"),
        Nuisance("cos_wave_3", "m", 0.0, 1e-4, group="wave"),
    ]
    depth, place, wave = list(parameters(3, surface, SimpleNamespace(start=-0.9, end=12.0)).values())[-3:]
    assert (depth.group, depth.position, place.group, place.position) == ("depth", 5.24, "surface", 5.24)
    assert (wave.name, wave.position, wave.start, wave.end) == ("cos_wave_3@-0.90-12.00", None, -0.9, 12.0)
