"""Linear responses in a switch: of the rail that wheels press, over the surface that carries them."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.turnout.sensitivity import _difference
from turnout.mismatch.turnout.wave_response import rail_receptances
from turnout.mismatch.turnout.wheel_line import carrying_weights, rows_under_wheels
from turnout.simulate.blade import Blade, transfer_position
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.track import uniform_track
from turnout.simulate.wheel_path import BladeTop, StockFall

TRACK = uniform_track(30.0, elements_per_bay=2)
BLADE = Blade(9.0, 15.0, 24.0, TRACK.rail, 3e8, 3e4)
SURFACES = ((StockFall(10.5, 3.0, 0.02),), (BladeTop(9.0, 3.0, 0.015),))
FREQUENCY = np.linspace(20.0, 112.0, 8)


def test_a_wave_behind_the_change_acts_on_the_blade():
    """Receptance to a sensor on the stock rail from each node under wheels: of the rail before, of the blade behind."""
    matrices = assemble(TRACK.with_(blade=BLADE))
    transfer = transfer_position(SURFACES, BLADE)
    rows = rows_under_wheels(matrices, BLADE, SURFACES)
    nodes = [int(np.searchsorted(matrices.node, transfer)) + k for k in (-2, 1)]
    h, about = rail_receptances(matrices, FREQUENCY, np.array(nodes), [12.6], rows[nodes])
    before = receptance(matrices, FREQUENCY, float(matrices.node[nodes[0]]), 12.6)
    name = ("blade", *divmod(nodes[1], 2))
    behind = receptance(matrices, FREQUENCY, name, 12.6)
    assert h[:, 0] == pytest.approx(np.column_stack([before, behind]), rel=1e-6)
    on_rail = receptance(matrices, FREQUENCY, float(matrices.node[nodes[1]]), 12.6)
    assert np.max(np.abs(behind / on_rail - 1.0)) > 0.05
    assert about[:, 1] == pytest.approx(receptance(matrices, FREQUENCY, name, name), rel=0.1)


def test_all_wheels_are_on_the_rail_without_a_top_of_the_blade():
    matrices = assemble(TRACK.with_(blade=BLADE))
    assert (rows_under_wheels(matrices, BLADE, SURFACES[:1]) == matrices.node_index).all()
    assert (carrying_weights(SURFACES[:1], np.linspace(5.0, 20.0, 9)) == 1.0).all()


def test_the_higher_top_carries():
    transfer = transfer_position(SURFACES, BLADE)
    stock, blade = carrying_weights(SURFACES, transfer + np.array([-0.5, 0.0, 0.5]))
    assert stock + blade == pytest.approx(1.0)
    assert stock[0] > 0.999
    assert blade[2] > 0.999
    assert 0.3 < blade[1] < 0.7


@pytest.mark.parametrize(("surfaces", "simulated"), [(SURFACES, [True, False, True]), (SURFACES[:1], [True] * 3)])
def test_a_quotient_in_a_switch_is_used_again_until_a_common_value_has_moved(surfaces, simulated):
    """By 0, 0.4 and 0.8 of its prior standard deviation. On plain track it is always computed."""
    values_seen = []

    def predict_passage(values, terms, aligned, with_probes):
        values_seen.append(values["load"])
        return np.array([values["load"] ** 2])

    predictor = SimpleNamespace(
        predict_passage=predict_passage, differences={}, site=SimpleNamespace(common_sds={"ballast_stiffness": 0.25}),
        surface=SimpleNamespace(turnout=SimpleNamespace(surfaces=lambda route: surfaces)),
    )  # fmt: skip
    aligned = SimpleNamespace(name="a passage", passage=SimpleNamespace(route="main"))
    for moved, is_simulated in zip((0.0, 0.1, 0.2), simulated):
        values, before = {"load": 1.0, "ballast_stiffness": moved}, len(values_seen)
        column = _difference(predictor, values, (), aligned, np.array([1.0]), "load", 0.1)
        assert column == pytest.approx(2.1)
        assert (len(values_seen) > before) == is_simulated
