"""Stiffness that differs under trains alone, on seeded linear histories with a known change."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    GroupInformation,
    StateParameter,
    VisitInformation,
    answers_after_visits,
    change_candidates,
)
from turnout.mismatch.calibrated.stiffness_under_load import (
    END,
    candidates_under_load,
    with_evidence_under_load,
    with_offsets,
)

N, SD = 5, 0.03
COMMON = [StateParameter(f"{n}_stiffness", 0.0, 0.2, 0.02, "track") for n in ("pad", "ballast")]
LOCAL = [
    StateParameter(f"{t}@{0.6 * k:.2f}", 0.0, 0.1, 0.01, t, k, 0.6 * k) for t in ("pad", "ballast") for k in range(N)
]
GAINS = [StateParameter(f"gain_A{k}", 0.0, 0.02, 0.003, "gain", None, 0.6 * k) for k in (1, 3)]
PARAMETERS = [*COMMON, *LOCAL, *GAINS]
NAMES = tuple(p.name for p in PARAMETERS)
CANDIDATES = [*change_candidates(PARAMETERS), *candidates_under_load(PARAMETERS)]
ROWS = {
    group: np.random.default_rng(k).normal(size=(40, len(PARAMETERS)))
    for k, group in enumerate(("A: impacts at 1.20 m", "A: locomotive, 120 km/h"))
}


def unit(*names):
    return np.isin(NAMES, names).astype(float)


def history(rng, felt_by_trains, felt_by_impacts=0.0, first=2, n_visit=5, gained=0.0):
    """Visits with one group of impacts and one of trains; each group has its own change from visit ``first`` on."""
    x = rng.normal(0.0, [p.sd for p in PARAMETERS])
    visits = []
    for v in range(n_visit):
        groups = []
        for change, (group, rows) in zip((felt_by_impacts, felt_by_trains), ROWS.items()):
            y = rows @ (x + (v >= first) * (change + gained)) + rng.normal(0.0, SD, len(rows))
            groups.append(GroupInformation(group, 1, NAMES, rows.T @ rows / SD**2, rows.T @ y / SD**2))
        visits.append(VisitInformation(f"v{v}", 0.5 * v, tuple(groups)))
    return visits


def answers(visits, candidates=CANDIDATES):
    against_file = PARAMETERS, [], change_candidates(PARAMETERS)
    found = answers_after_visits(PARAMETERS, visits, [], candidates, 12.0, 6.0, len(visits), against_file)
    return {a.question: a for a in found}


def test_trains_inform_on_the_sum_of_value_and_offset_and_impacts_on_the_value():
    visits = history(np.random.default_rng(1), 0.0, n_visit=1)
    parameters, (felt,) = with_offsets(PARAMETERS, visits)
    offsets = [p.name for p in parameters[len(PARAMETERS) :]]
    assert set(offsets) == {n + END for n in NAMES if n.startswith("pad") or n == "ballast_stiffness"}
    impacts, trains = felt.groups
    assert impacts is visits[0].groups[0]
    rows = ROWS["A: locomotive, 120 km/h"]
    columns = np.column_stack([rows[:, NAMES.index(n.removesuffix(END))] for n in trains.names])
    np.testing.assert_allclose(trains.matrix, columns.T @ columns / SD**2, rtol=1e-12)
    # the same data: y = rows x = columns (x, 0)
    x = np.linalg.solve(visits[0].groups[1].matrix, visits[0].groups[1].vector)
    np.testing.assert_allclose(trains.vector[: len(NAMES)], visits[0].groups[1].vector, rtol=1e-12)
    sums = np.array([x[NAMES.index(n.removesuffix(END))] if not n.endswith(END) else 0.0 for n in trains.names])
    np.testing.assert_allclose(trains.matrix @ sums, trains.vector, rtol=1e-6, atol=1e-6)


def test_an_offset_is_no_larger_where_the_value_is_uncertain_in_the_file():
    unsure = [replace(p, sd=0.35) if p.name == "pad@1.20" else p for p in PARAMETERS]
    offsets = {p.name: p.sd for p in with_offsets(unsure, [])[0][len(PARAMETERS) :]}
    assert {offsets[f"pad@{0.6 * k:.2f}" + END] for k in range(N)} == {0.1}


@pytest.mark.parametrize(
    ("names", "effect", "parameter"),
    [
        (("pad@1.20",), "local_pad", "pad@1.20 under load"),
        (("pad_stiffness",), "pad_preload", "pad_stiffness under load"),
        (("ballast_stiffness",), "ballast_hardening", "ballast_stiffness under load"),
    ],
)
def test_a_change_under_trains_alone_is_named_with_its_size_and_onset(names, effect, parameter):
    answer = answers(history(np.random.default_rng(2), 0.6 * unit(*names)))["change"]
    assert (answer.verdict, answer.names, answer.parameter) == ("named", (effect,), parameter)
    assert answer.size == pytest.approx(0.6, abs=0.1)
    assert answer.sd == pytest.approx(0.25 * answer.size, abs=0.01)  # of the linear model, beyond that of the data
    assert answer.onset == (0.5, 1.0)


def test_the_first_visit_has_no_finding():
    """An error of the model is the same in all trains and not in impacts: only a change of it is evidence."""
    answer = answers(history(np.random.default_rng(3), 0.6 * unit("pad_stiffness"), first=0))
    assert answer["change"].verdict == "none" and answer["file"].names != ("pad_preload",)


def test_a_change_under_impacts_as_well_is_no_effect_under_load():
    change = 0.6 * unit("pad@1.20")
    answer = answers(history(np.random.default_rng(4), change, change))["change"]
    assert (answer.names, answer.parameter) == (("local_pad",), "pad@1.20")


def test_without_these_candidates_the_change_has_no_right_size():
    """Purpose of the offsets: without them a pad that changes under trains alone has the mean of trains and impacts."""
    ordinary = change_candidates(PARAMETERS)
    answer = answers(history(np.random.default_rng(5), 0.6 * unit("pad@1.20")), ordinary)["change"]
    assert (answer.names, answer.parameter) == (("local_pad",), "pad@1.20")
    assert answer.total < 0.6 - 3.0 * answer.total_sd


def test_intact_histories_have_no_evidence_of_a_change_under_load():
    """n = 100 histories of 5 visits: none above 6 nats (expected by Markov's inequality: below 0.25 each)."""
    rng = np.random.default_rng(6)
    candidates = candidates_under_load(PARAMETERS)
    largest = [
        max(e.gain for e in with_evidence_under_load([], PARAMETERS, history(rng, 0.0), [], candidates))
        for _ in range(100)
    ]
    assert max(largest) < 6.0


def test_a_gain_that_no_effect_of_the_library_explains_is_no_pad_under_load():
    """A pad explains it in trains and not in impacts. The best effect leaves the change of impacts: unknown."""
    visits = history(np.random.default_rng(7), 0.0, gained=unit("gain_A1"))
    alike = [replace(v, groups=(v.groups[0], as_pad(v.groups[1], "gain_A1", "pad@0.60"))) for v in visits]
    answer = answers(alike, candidates_under_load(PARAMETERS))["change"]
    assert answer.verdict == "unknown" and answer.gain is not None and answer.gain > 12.0


def as_pad(group, gain, pad):
    """Information of trains on whose signals a gain acts as a pad does."""
    terms, k = np.eye(len(NAMES)), NAMES.index(gain)
    terms[k, k], terms[NAMES.index(pad), k] = 0.0, 1.0
    return replace(group, matrix=terms.T @ group.matrix @ terms, vector=terms.T @ group.vector)


def test_an_effect_under_load_that_is_left_out_of_the_library_is_no_candidate():
    names = {e.group for e in candidates_under_load(PARAMETERS, without=("pad_preload", "local_pad"))}
    assert names == {"hardening"}
