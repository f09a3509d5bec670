"""Planned recordings determine which effects can be distinguished, before they are taken."""

import json

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.mismatch.engine.distinguishability import Distinguishability, distinguishability
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan

FAMILIES = ("pad_temperature", "zener_pad", "local_ballast", "local_pad", "mount_resonance")


def planned_case(plan, families=FAMILIES):
    return distinguishability(PlannedCase(plan, families=families))


@pytest.fixture(scope="module")
def one_warm_day():
    return planned_case(small_plan((30.0,), passages=False))


def test_at_one_temperature_soft_pads_are_not_distinguished_from_warm_pads(one_warm_day):
    """3 nats at one temperature, thousands at two: at one, the common pad stiffness absorbs the effect."""
    two = planned_case(small_plan((5.0, 30.0), passages=False))
    assert one_warm_day.detectability[one_warm_day.names.index("pad_temperature")] < 5.0
    assert "none" in one_warm_day.confused_with("pad_temperature")
    assert two.detectability[two.names.index("pad_temperature")] > 1000.0 and two.confused_with("pad_temperature") == []


def test_no_effect_explains_the_data_of_an_effect_better_than_itself(one_warm_day):
    assert np.all(np.diag(one_warm_day.loss) == 0.0)
    assert np.all(one_warm_day.loss <= one_warm_day.detectability[:, None] + 1e-6 * one_warm_day.detectability.max())


def test_a_name_needs_the_threshold_against_none_and_the_margin_against_each_other_effect():
    loss = np.array([[0.0, 7.0, 30.0], [5.5, 0.0, 30.0], [3.0, 4.0, 0.0]])
    matrix = Distinguishability(("a", "b", "c"), loss, np.array([30.0, 30.0, 4.0]))
    assert [matrix.can_be_named(name, 12.0, 6.0) for name in "abc"] == [True, False, False]
    assert [matrix.can_be_named(name, 12.0, 5.0) for name in "abc"] == [True, True, False]
    assert not matrix.can_be_named("a", 40.0, 6.0)


def test_the_command_states_once_what_cannot_be_seen(capsys, monkeypatch):
    """Such an effect is not listed again beside every other one: it cannot be distinguished from any of them."""
    from turnout.stages import distinguish

    loss = np.array([[0.0, 2.0, 30.0], [3.0, 0.0, 4.0], [30.0, 28.0, 0.0]])
    matrix = Distinguishability(("local_pad", "sensor_gain", "hum"), loss, np.array([13.0, 4.0, 31.0]))
    monkeypatch.setattr(distinguish, "planned_matrix", lambda *_: (matrix, "No single addition."))
    assert main(["distinguish", "--sensor-positions", "23.4", "--impact-positions", "24.6"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "evidence [nats]     none        1        2        3",
        " 1 local_pad          13        0        2       30",
        " 2 sensor_gain         4        3        0        4",
        " 3 hum                31       30       28        0",
        "cannot be seen (below 5 nats in the column none): sensor_gain",
        "local_pad cannot be distinguished from sensor_gain",
        "enough evidence for a name: hum",
        "No single addition.",
    ]
    assert main(["distinguish", "--sensor-positions", "23.4", "--impact-positions", "24.6", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["result"]
    assert rows[1] == {
        "effect": "sensor_gain", "evidence_nats": 4.0, "confused_with": ["none", "local_pad", "hum"], "is_named": False,
    }  # fmt: skip
    assert [r["is_named"] for r in rows] == [False, False, True]


@pytest.mark.slow
def test_passages_below_160_hz_do_not_show_frequency_dependent_pads_and_impacts_do(one_warm_day):
    from dataclasses import replace

    plan = small_plan((15.0,), speeds=(40.0,))
    rolling = planned_case(replace(plan, hammer_points=()), ("zener_pad", "mount_resonance", "surface_dip"))
    assert "none" in rolling.confused_with("zener_pad")
    # twenty times what a name needs: the smooth errors of the model, integrated out, absorb a part
    assert one_warm_day.detectability[one_warm_day.names.index("zener_pad")] > 100.0
    ratio = {n: s for n, s in zip(rolling.names, rolling.detectability)}
    impacts = {n: s for n, s in zip(one_warm_day.names, one_warm_day.detectability)}
    # 5 nats of expected evidence are what a name needs
    assert ratio["mount_resonance"] < 5.0 < impacts["mount_resonance"]
    # the waves of the rail and of each wheel absorb a part of a dip; a hammer does not roll over it
    assert ratio["surface_dip"] > 100.0 and "surface_dip" not in impacts


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ([], "nothing is planned: give --impact-positions, --vehicles or both."),
        (
            ["--impact-positions", "24.6", "--effects", "hanging_slepper"],
            "no effect 'hanging_slepper' in such a campaign",
        ),
    ],
)
def test_a_plan_that_can_show_no_effect_is_rejected_with_a_message(more, expected, capsys):
    assert main(["distinguish", "--sensor-positions", "23.4", *more]) == 2
    assert expected in capsys.readouterr().err
