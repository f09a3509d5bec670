"""Effects of one part: they are refitted together, distinguished if possible, and compared within their group."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import Entry, component_rivals, with_fitted_start
from turnout.mismatch.engine.decision import judge
from turnout.mismatch.engine.evidence import is_within_spread
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.physics import Parameter

FACTOR = (Parameter("factor", "-", 1.0, (0.05, 20.0), "share of stiffness", "made up 2026"),)
HERE = {"sleeper": 7, "place": 4.2}


def first(_):
    """Parameters of the only candidate of a fit."""
    return slice(0, 1)


def candidate(family, where=HERE, **more):
    return Candidate.of(family, FACTOR, lambda psi: psi, ((0.4,),), where, **more)


def score(found, gain, factor, error, explained=1.0):
    fit = SimpleNamespace(psi=np.array([factor]), psi_se=np.array([error]), part=first)
    return Score(found, gain, 0.0, explained, fit)


def answer(*scores):
    return judge(list(scores), 2.0, MismatchSettings())


@pytest.mark.parametrize("factor, expected", [(0.05, "a_or_b"), (0.12, "a_or_b"), (0.40, "named")])
def test_ballast_without_reaction_may_be_a_gap_that_no_train_closes(factor, expected):
    ballast = score(candidate("local_ballast", limit_form="hanging_sleeper"), 600.0, factor, 0.1)
    verdict = answer(ballast, score(candidate("hanging_sleeper"), 500.0, 2e-3, 2e-4))
    assert verdict.answer == expected
    assert verdict.names[0] == "local_ballast"


def test_a_gap_elsewhere_or_without_explanation_is_no_limit_form_of_ballast():
    ballast = score(candidate("local_ballast", limit_form="hanging_sleeper"), 600.0, 0.05, 0.1)
    elsewhere = score(candidate("hanging_sleeper", {"sleeper": 9, "place": 5.4}), 500.0, 2e-3, 2e-4)
    useless = score(candidate("hanging_sleeper"), 500.0, 2e-3, 2e-4, explained=0.1)
    assert answer(ballast, elsewhere).answer == "named"
    assert answer(ballast, useless).answer == "named"


@pytest.mark.parametrize(
    "times, usual",
    [(share * THRESHOLDS.max_ordinary_spreads, abs(share) < 1.0) for share in (0.9, 1.1, -1.1)],
)
def test_a_support_is_unusual_against_the_spread_of_its_group(times, usual):
    """Seven other pads have logarithms of mean 0.3 and variance 4e-2, each known to a variance of 9e-2. Pad 0 is the
    candidate; ballast is no part of the group, nor is the common value of all pads."""
    values = 0.3 + 0.2 * np.sqrt(7.0 / 6.0) * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    names = ["pad_0", *(f"pad_{k + 1}" for k in range(7)), "ballast_3", "pad_stiffness"]
    nuisances = [Nuisance(n, "-", 0.0, 0.1, group="pad", index=k) for k, n in enumerate(names[:8])]
    nuisances += [Nuisance("ballast_3", "-", 0.0, 0.1, group="ballast", index=3)]
    case = SimpleNamespace(nuisances=[*nuisances, Nuisance("pad_stiffness", "-", 0.0, 0.1, group="pad")])
    spread = np.sqrt(4e-2 + 9e-2)
    refit = SimpleNamespace(
        values=dict(zip(names, [9.0, *values, 9.0, 9.0])),
        covariance=np.diag([50.0, *np.full(7, 9e-2), 50.0, 50.0, 1e-4]),
        psi=np.array([np.exp(times * spread)]),
        part=first,
    )
    assert is_within_spread(case, refit, candidate("local_pad", masking_parameter="pad_0")) == usual
    assert not is_within_spread(case, refit, candidate("local_pad"))


def test_effects_of_the_leading_parts_are_refitted_from_their_best_starts():
    there = {"sleeper": 9, "place": 5.4}
    leader, gap = candidate("local_ballast", component="ballast"), candidate("hanging_sleeper", component="ballast")
    other, far = candidate("sensor_gain", {"sensor": "S1"}), candidate("hanging_sleeper", there, component="ballast")
    chosen = [Entry(40.0, leader, np.array([0.4]), {}), Entry(30.0, other, np.array([0.9]), {})]
    weak, strong = Entry(-9.0, gap, np.array([1.0]), {}), Entry(-2.0, gap, np.array([2.0]), {})
    scored = {"local_ballast": chosen[:1], "hanging_sleeper": [strong, Entry(5.0, far, np.array([3.0]), {}), weak]}
    assert component_rivals(chosen, scored) == [strong]
    assert component_rivals(chosen[1:], scored) == []


@pytest.mark.parametrize("behind, expected", [(0.9, "a_or_b"), (1.1, "named")])
def test_a_rival_within_the_margin_is_one_also_below_the_threshold(behind, expected):
    """13 nats and 8 are odds of 150 to 1 between the two, for any evidence against the base model."""
    settings = MismatchSettings()
    best = settings.threshold + 1.0
    rival = best - behind * settings.margin
    pair = [score(candidate(n, {}), g, 2.0, 0.1) for n, g in (("clipping", best), ("wheel_flat", rival))]
    assert judge(pair, 0.5, settings).answer == expected


@pytest.mark.parametrize(
    "gain, excess, expected", [(1.1, 0.9, "none"), (2.1, 0.9, "unknown"), (1.1, 1.2, "unknown"), (20.0, 0.5, "unknown")]
)
def test_a_weak_name_that_predicts_worse_has_the_answer_none_without_an_excess(gain, excess, expected):
    """``gain`` in thresholds, ``excess`` over the control level: either one alone gives the answer unknown."""
    settings = MismatchSettings()
    found = score(candidate("rail_shear", {}), gain * settings.threshold, 2.0, 0.1)
    assert judge([found], excess, settings, consistent=False).answer == expected


@pytest.mark.parametrize(
    "gain, worst, excess, expected",
    [
        (1.4, -0.4, 0.5, "named"),
        (1.4, -0.6, 0.5, "none"),
        (1.4, -0.6, 2.0, "unknown"),
        (10.0, -1.9, 2.0, "named"),
        (10.0, -2.1, 0.5, "unknown"),
    ],
)
def test_a_name_that_one_condition_contradicts_is_withdrawn(gain, worst, excess, expected):
    """``gain`` and ``worst`` in thresholds: a loss of half a threshold may be chance, a fifth of the gain is not."""
    settings = MismatchSettings()
    fit = SimpleNamespace(psi=np.array([2.0]), psi_se=np.array([0.1]), part=first)
    found = Score(candidate("rail_shear", {}), gain * settings.threshold, worst * settings.threshold, 1.0, fit)
    assert judge([found], excess, settings).answer == expected


@pytest.mark.parametrize(
    "aside, scanned, sounding, gain, expected",
    [
        (30.0, 20, True, 50.0, "named"),
        (13.0, 20, True, 50.0, "unknown"),
        (30.0, 20, False, 50.0, "unknown"),
        (30.0, 20, True, 21.1, "named"),
        (30.0, 20, True, 20.9, "unknown"),
    ],
)
@pytest.mark.parametrize("explained", [0.08, -0.03])
def test_a_name_with_separate_evidence_need_not_explain_the_residual_of_the_fit(
    aside, scanned, sounding, gain, expected, explained
):
    """Impacts once a turn are those of a flat, although the waveform in the band does not fit, which needs the angle to
    the millimetre: 30 nats less ln 20 exceed the threshold of 12, and 13 less ln 20 do not. A limit of a channel or a
    line above the band is no such evidence. A gain below 30 less ln 20, 27.004, means that the fit has become worse. A
    loss of more than the margin of 6, the penalty of its numbers, contradicts the name; a higher level of the strongest
    channel alone does not."""
    where = {"train": "railcar", "axle": 1}
    flat = candidate("wheel_flat", where, external_evidence=aside, n_scanned=scanned, evidence_suffices=sounding)
    verdict = answer(score(flat, gain, 0.08, 0.01, explained=explained))
    assert verdict.answer == expected and f"{100 * explained:.0f} %" in verdict.reason


def test_a_candidate_that_explains_too_little_is_no_leader_against_other_data():
    """A gain in a sensor that a flat keeps above the control level: both are named, and tested together."""
    flat = candidate(
        "wheel_flat", {"train": "railcar", "axle": 1}, external_evidence=43.6, n_scanned=20, evidence_suffices=True
    )
    gain = candidate("sensor_gain", {"sensor": "A1"})
    found = [score(gain, 150.0, 0.7, 0.01, explained=0.02), score(flat, 37.6, 0.08, 0.01, explained=0.01)]
    assert answer(*found).names == ("wheel_flat", "sensor_gain")
    separated_by_fit = [score(gain, 150.0, 0.7, 0.01, explained=0.9), found[1]]
    assert answer(*separated_by_fit).names == ("sensor_gain",)
    assert answer(found[0]).answer == "unknown"


def test_an_existing_fit_is_a_better_start_than_a_column():
    here, there = candidate("sensor_gain", {"sensor": "A1"}), candidate("sensor_gain", {"sensor": "A2"})
    column = Entry(90.0, here, np.array([0.85]), {})
    made = Entry(60.0, here, np.array([0.66]), {"gain_A1": 0.0})
    elsewhere = Entry(70.0, there, np.array([0.9]), {"gain_A2": 0.1})
    scored = {"sensor_gain": [column, made, elsewhere]}
    assert with_fitted_start(column, scored) is made
    assert with_fitted_start(column, {"sensor_gain": [column, elsewhere]}) is column
