"""The rail's element: exact statics, local compliance, rejections."""

import numpy as np
import pytest
from scipy.linalg import eigh

from turnout.errors import SimulationError
from turnout.simulate.rail import (
    Rail,
    element_mass,
    element_stiffness,
    local_compliance,
    rotation_functions,
    shape_functions,
)

UIC60 = {
    "bending_stiffness": 6.42e6,
    "mass": 60.21,
    "shear_stiffness": 0.4 * 81e9 * 76.7e-4,
    "rotary_inertia": 7850 * 3.055e-5,
}


def clamped_deflection_by_two_elements(rail, length, at, force_at):
    """Deflection at ``at`` of a clamped-clamped beam cut into three elements at both places."""
    cuts = np.unique([0.0, min(at, force_at), max(at, force_at), 1.0]) * length
    n = 2 * cuts.size
    k = np.zeros((n, n))
    for e, h in enumerate(np.diff(cuts)):
        k[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += element_stiffness(rail, h)
    f = np.zeros(n)
    f[2 * int(np.argmin(np.abs(cuts - force_at * length)))] = 1.0
    inner = slice(2, n - 2)
    w = np.zeros(n)
    w[inner] = np.linalg.solve(k[inner, inner], f[inner])
    return w[2 * int(np.argmin(np.abs(cuts - at * length)))]


@pytest.mark.parametrize("beam", ["timoshenko", "euler"])
@pytest.mark.parametrize("places", [(0.5, 0.5), (0.23, 0.23), (0.31, 0.78), (0.9, 0.15)])
def test_local_compliance_is_that_of_the_clamped_element(beam, places):
    rail = Rail(**UIC60, beam=beam)
    expected = clamped_deflection_by_two_elements(rail, 0.3, *places)
    assert local_compliance(*places, 0.3, rail) == pytest.approx(
        expected, rel=1e-10, abs=0.0
    )  # check 18; rounding of K^-1


@pytest.mark.parametrize("beam", ["timoshenko", "euler"])
def test_rigid_motion_has_no_strain_energy_and_the_whole_mass(beam):
    rail = Rail(**UIC60, beam=beam)
    h = 0.37
    lift, turn = np.array([1.0, 0.0, 1.0, 0.0]), np.array([-h / 2, 1.0, h / 2, 1.0])
    stiffness, mass = element_stiffness(rail, h), element_mass(rail, h)
    assert np.max(np.abs(stiffness @ lift)) < 1e-6 * np.max(stiffness)
    assert np.max(np.abs(stiffness @ turn)) < 1e-6 * np.max(stiffness)
    assert lift @ mass @ lift == pytest.approx(rail.mass * h, rel=1e-12)
    rotary = 0.0 if beam == "euler" else rail.rotary_inertia * h
    assert turn @ mass @ turn == pytest.approx(rail.mass * h**3 / 12 + rotary, rel=1e-12)


def test_shape_functions_agree_with_displacement_and_rotation_of_the_nodes():
    rail = Rail(**UIC60)
    h = 0.3
    p = rail.shear_ratio(h)
    assert np.allclose(shape_functions(np.array([0.0, 1.0]), h, p), [[1, 0, 0, 0], [0, 0, 1, 0]], atol=1e-12)
    assert np.allclose(rotation_functions(np.array([0.0, 1.0]), h, p), [[0, 1, 0, 0], [0, 0, 0, 1]], atol=1e-12)
    assert np.sum(shape_functions(0.37, h, p)[[0, 2]]) == pytest.approx(1.0)


@pytest.mark.parametrize("change", [{"bending_stiffness": -1.0}, {"mass": 0.0}, {"damping": -1.0}, {"beam": "wire"}])
def test_an_impossible_rail_is_rejected_with_its_value(change):
    with pytest.raises(SimulationError, match=str(next(iter(change.values()))).replace(".", r"\.")):
        Rail(**(UIC60 | change))


@pytest.mark.parametrize("beam", ["timoshenko", "euler"])
def test_the_pinned_pinned_frequency_is_that_of_a_beam_on_two_pins(beam):
    """Against 40 finite elements; without shear and rotary inertia pi sqrt(EI / m) / 2 L^2."""
    rail, bay, n = Rail(**UIC60, beam=beam), 0.65, 40
    stiffness, mass = (np.zeros((2 * n + 2, 2 * n + 2)) for _ in range(2))
    for e in range(n):
        stiffness[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += element_stiffness(rail, bay / n)
        mass[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += element_mass(rail, bay / n)
    free = np.delete(np.arange(2 * n + 2), [0, 2 * n])
    lowest = eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True)[0]
    expected = np.sqrt(lowest) / (2.0 * np.pi)
    if beam == "timoshenko":
        assert rail.pinned_pinned_frequency(bay) == pytest.approx(
            expected, rel=1e-3
        )  # elements have an error of 1 / n^2
    else:
        slender = Rail(**{**UIC60, "rotary_inertia": 0.0}, beam=beam)
        closed = np.pi * np.sqrt(6.42e6 / 60.21) / (2.0 * bay**2)
        assert slender.pinned_pinned_frequency(bay) == pytest.approx(closed, rel=1e-12)
        assert slender.pinned_pinned_frequency(bay) == pytest.approx(expected, rel=1e-4)
