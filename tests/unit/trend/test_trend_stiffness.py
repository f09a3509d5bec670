"""The pair of resonances of a section tells whether the stiffness of ballast, pads or both has changed."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, modes
from scipy.linalg import eigvalsh

from turnout.trend import candidates, chart_status, describe_flagged, evaluate
from turnout.trend.stiffness import (
    ResonancePair,
    coupling_limits,
    coupling_share,
    judged_change,
    stiffness_change,
)

from .evaluated_views import evaluated_views


def chain(pad, ballast, rail=36.0, sleeper=150.0):
    """Resonances [Hz] of a rail on a pad on a sleeper on ballast, by the eigenvalues of its matrices."""
    stiffness = np.array([[pad, -pad], [-pad, pad + ballast]])
    return np.sqrt(eigvalsh(stiffness, np.diag([rail, sleeper]))) / (2.0 * np.pi)


@pytest.mark.parametrize("pad, ballast, sleeper", [(450e6, 170e6, 150.0), (200e6, 250e6, 90.0), (80e6, 60e6, 60.0)])
def test_the_sensitivities_are_those_of_the_chain(pad, ballast, sleeper):
    low, high = chain(pad, ballast, 36.0, sleeper)
    share = coupling_share(high / low, sleeper / 36.0)
    step = 1e-5
    by_ballast = np.log(chain(pad, ballast * (1 + step), 36.0, sleeper) / [low, high]) / np.log1p(step)
    by_pad = np.log(chain(pad * (1 + step), ballast, 36.0, sleeper) / [low, high]) / np.log1p(step)
    assert by_ballast == pytest.approx([0.5 * (1 - share), 0.5 * share], abs=1e-5)
    assert by_pad == pytest.approx([0.5 * share, 0.5 * (1 - share)], abs=1e-5)
    assert coupling_limits(high / low)[1] >= share


def test_resonances_that_contradict_the_masses_give_no_component():
    assert coupling_limits(1.1) == (0.0, 0.5) and coupling_limits(float("nan")) == (0.0, 0.5)
    assert judged_change(np.log([0.95, 0.95]), np.full(2, 1e-6), (0.0, 0.5)).component == "either"


@pytest.mark.parametrize("component, factors", [("ballast", (0.8, 1.0)), ("pad", (1.0, 0.8)), ("both", (0.9, 0.8))])
def test_the_component_and_its_size_are_those_of_the_chain(component, factors):
    before, after = chain(450e6, 170e6), chain(450e6 * factors[1], 170e6 * factors[0])
    found = judged_change(np.log(after / before), np.full(2, 1e-3**2), coupling_limits(before[1] / before[0]))
    assert found.component == component
    for factor, (_, low, high) in zip(factors, (found.ballast, found.pad)):
        assert low - 0.1 <= 100.0 * (factor - 1.0) <= high + 0.1


def test_a_change_within_the_errors_of_both_is_either():
    found = judged_change(np.log([0.99, 0.997]), np.full(2, 5e-3**2), (0.0, 0.08))
    assert found.component == "either" and found.ballast[1] < 0.0 < found.ballast[2]


def both_bands(pad, ballast, seed, turnouts=2, weeks=120, start=80, **more):
    """Modes of a fleet whose first section changes its stiffness at week ``start`` by the factors of both springs."""
    before, after = chain(450e6, 170e6), chain(450e6 * pad, 170e6 * ballast)
    frames = []
    for k, (band, sigma) in enumerate((("ballast", 0.9), ("railpad", 0.5))):
        fleet = Fleet(turnouts=turnouts, weeks=weeks, phi=0.1, sigma=sigma, frequency=before[k], band=band, **more)
        change = np.zeros((turnouts, fleet.sections, len(np.arange(0, weeks, fleet.every))))
        change[:, 0] = 100.0 * (after[k] / before[k] - 1.0) * (np.arange(0, weeks, fleet.every) >= start)
        frames.append(modes(fleet, [seed, k], change).astype({"band": object}))
    return pd.concat(frames, ignore_index=True)


@pytest.mark.parametrize("pad, ballast, component", [(1.0, 0.88, "ballast"), (0.88, 1.0, "pad")])
def test_no_alarm_of_a_fleet_names_the_wrong_component(settings, pad, ballast, component):
    charts = evaluate(both_bands(pad, ballast, 5, turnouts=40), None, settings)
    status = chart_status(charts, settings)
    status = describe_flagged(status, candidates(charts, status, settings), settings)
    flagged = status[(status["state"] == "alarm") & status["section_id"].str.endswith("/S0")]
    named = flagged["changed_component"].value_counts()
    assert named[component] >= 0.95 * len(flagged) and set(named.index) <= {component, "either"}
    own = flagged[flagged["changed_component"] == component]
    is_covered = (own[f"{component}_stiffness_low_pct"] <= -12.0) & (own[f"{component}_stiffness_high_pct"] >= -12.0)
    assert len(own) >= 40 and is_covered.mean() >= 0.9


def test_one_campaign_of_another_mode_does_not_name_its_component():
    """Five campaigns after softer ballast; in the fourth another mode was taken for the railpad resonance."""
    time, rng = np.arange(25.0) * 46.0, np.random.default_rng(8)
    since, after = 900.0, time >= 900.0
    values = {"ballast": -6.0 * after + 0.3 * rng.standard_normal(25), "railpad": 0.3 * rng.standard_normal(25)}
    values["railpad"][23] += 28.0
    error = {band: np.full(25, 0.5) for band in values}
    pair = ResonancePair({band: time for band in values}, values, error, coupling_limits(4.0))
    found = stiffness_change(pair, (("step", since),))
    assert found.component == "ballast" and found.ballast[1] < 100.0 * (0.94**2 - 1.0) < found.ballast[2]
    error["railpad"][:] = 20.0
    assert stiffness_change(pair, (("step", since),)).component == "ballast"
    assert stiffness_change(None, (("step", since),)).component == "either"


def test_softer_ballast_lists_no_inspection_of_the_railpads(settings):
    rows = both_bands(1.0, 0.5, 7, turnouts=2)
    with evaluated_views(rows, settings) as con:
        listed = con.execute(
            "select band, component, state, sentence, look_at from worklist where section_id like '%/S0'"
        ).fetchall()
    inspected = {band: (component, look) for band, component, state, _, look in listed if state == "inspect this week"}
    assert set(inspected) == {"ballast"} and inspected["ballast"][0] == "ballast"
    assert "ballast" in inspected["ballast"][1]
    sentence = next(s for band, _, state, s, _ in listed if band == "ballast" and state == "inspect this week")
    assert "; if all supports around the section have changed alike, the ballast lost 5" in sentence
    assert "of stiffness (" in sentence and "railpads" not in sentence
    coupled = [(state, component) for band, component, state, _, _ in listed if band == "railpad"]
    assert all(state != "inspect this week" for state, _ in coupled)


def test_the_advice_for_each_component_follows_its_own_sign(settings):
    """Pads were exchanged for stiffer ones while the ballast lost stiffness; probabilities by the closed form."""
    rows = both_bands(1.4, 0.6, 9, turnouts=2)
    with evaluated_views(rows, settings) as con:
        looks = con.execute(
            "select look_at from worklist where section_id like '%/S0' and changed_component = 'both'"
        ).fetchall()
    assert looks
    assert all("voids" in look and "exchanged or hardened" in look and "worn" not in look for (look,) in looks)


def test_both_rows_of_a_section_state_the_same_change_of_stiffness(settings):
    """The railpad resonance moves by 0.6 %, too little for a separate onset; the true loss is half of the stiffness."""
    with evaluated_views(both_bands(1.0, 0.5, 7, turnouts=2), settings) as con:
        sizes = con.execute(
            "select ballast_stiffness_low_pct, ballast_stiffness_high_pct, band from chart_states "
            "where section_id like '%/S0' and raised_at_utc is not null order by section_id"
        ).fetchall()
    assert {band for *_, band in sizes} == {"ballast", "railpad"}
    assert all(low <= -50.0 <= high for low, high, _ in sizes)


def test_a_coupled_alarm_refers_to_the_other_one_only_if_that_is_listed(settings):
    rows = both_bands(1.0, 0.5, 7, turnouts=2)
    at = rows["measured_at_utc"].max()
    silence = pd.DataFrame(
        {
            "acknowledgement_id": ["a"], "turnout_id": ["T00000"], "section_id": ["T00000/S0"], "band": ["ballast"],
            "action": ["suppress"], "by_whom": ["test"], "at_utc": [at - pd.Timedelta(days=1)],
            "until_utc": [at + pd.Timedelta(days=100)], "reason": ["test"],
        }
    )  # fmt: skip
    question = "select sentence, look_at from worklist where section_id = 'T00000/S0' and band = 'railpad'"
    with evaluated_views(rows, settings, acknowledgements=silence) as con:
        ((sentence, look),) = con.execute(question).fetchall()
    assert "whose own row" not in sentence and "see the other" not in look
    with evaluated_views(rows, settings) as con:
        ((sentence, look),) = con.execute(question).fetchall()
    assert "whose own row" in sentence and "see the other" in look
