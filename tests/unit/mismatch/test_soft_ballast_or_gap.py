"""Softer ballast and a hanging sleeper, on seeded linear histories of springs and dampers of supports."""

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

N_SUPPORT, SD = 5, 0.05
SPRINGS = [StateParameter(f"ballast@{0.6 * k:.2f}", 0.0, 0.1, 0.03, "ballast", k, 0.6 * k) for k in range(N_SUPPORT)]
DAMPERS = [
    StateParameter(f"ballast_damper@{0.6 * k:.2f}", 0.0, 0.15, 0.05, "ballast_damper", k, 0.6 * k)
    for k in range(N_SUPPORT)
]
PARAMETERS = [*SPRINGS, *DAMPERS]
NAMES = tuple(p.name for p in PARAMETERS)
SOFT, GAP, EITHER = ("local_ballast",), ("hanging_sleeper",), ("local_ballast", "hanging_sleeper")


def names_of(
    question, damper_share, trains_feel=1.0, damper_weight=1.0, size=-1.8, seed=0, sd=SD, repeats=False, unsure=1.0
):
    """Names after four visits; two visits have the change, or all of them differ from the file.

    Data are mixtures of neighbouring springs and dampers, dampers by ``damper_weight``. With ``repeats`` their error is
    the same at all visits. The changed support has ``unsure`` times its standard deviations in the file.
    """
    rng = np.random.default_rng(seed)
    near = [[0.6 ** abs(i - j) for j in range(N_SUPPORT)] for i in range(N_SUPPORT)]
    rows = np.kron([[1.0, 0.5 * damper_weight], [0.6, -damper_weight]], near)
    change = np.zeros(len(PARAMETERS))
    change[[2, N_SUPPORT + 2]] = size * np.array([1.0, damper_share])
    visits, truth = [], rng.normal(0.0, [0.3 * p.sd for p in PARAMETERS])
    errors = sd * rng.normal(size=(4, 2, len(rows)))
    for v in range(4):
        groups = []
        felt = (("A: impacts at 1.20 m", 1.0), ("A: locomotive, 120 km/h", trains_feel))
        for (group, share), error in zip(felt, errors[0 if repeats else v]):
            y = rows @ (truth + share * change * (v >= 2 or question == "file")) + error
            groups.append(GroupInformation(group, 1, NAMES, rows.T @ rows / sd**2, rows.T @ y / sd**2))
        visits.append(VisitInformation(f"v{v}", 0.5 * v, tuple(groups)))
    parameters = [replace(p, sd=p.sd * (unsure if p.index == 2 else 1.0)) for p in PARAMETERS]
    found = answers_after_visits(parameters, visits, [], change_candidates(parameters), 12.0, 6.0, 4)
    answer = next(a for a in found if a.question == question)
    assert answer.position == pytest.approx(1.2)
    return answer.names


@pytest.mark.parametrize("question", ["change", "file"])
@pytest.mark.parametrize(("damper_share", "names"), [(0.0, SOFT), (0.5, SOFT), (1.0, EITHER)])
def test_a_damper_that_loses_less_than_the_spring_is_no_gap(question, damper_share, names):
    """At a gap that no train closes the ballast loses as much damping as stiffness; so may softer ballast."""
    assert [names_of(question, damper_share, seed=s) for s in range(5)] == [names] * 5


@pytest.mark.parametrize("question", ["change", "file"])
def test_dampers_that_data_hardly_determine_do_not_decide(question):
    assert [names_of(question, 0.5, damper_weight=0.02, seed=s) for s in range(5)] == [EITHER] * 5


@pytest.mark.parametrize("question", ["change", "file"])
def test_trains_that_close_a_gap_name_it_beside_a_damper_that_fits_it(question):
    assert [names_of(question, 1.0, trains_feel=0.25, seed=s) for s in range(5)] == [GAP] * 5


def test_an_error_that_repeats_at_all_visits_counts_once():
    """Of 40 seeded sites 14 have a name; 26 if each of the four visits had another error."""
    names = [names_of("file", 0.5, seed=s, sd=0.2, repeats=True) for s in range(40)]
    assert 5 <= names.count(SOFT) <= 20 and GAP not in names


def test_an_uncertain_support_in_the_file_does_not_explain_a_difference_between_trains_and_impacts():
    """Between two sections the file is uncertain. With that standard deviation for the offset, the answer was "a or
    b"."""
    assert [names_of("file", 1.0, trains_feel=0.75, seed=s, unsure=2.0) for s in range(5)] == [GAP] * 5


@pytest.mark.parametrize(("damper_share", "trains_feel", "name"), [(0.0, 1.0, SOFT), (1.0, 0.5, GAP)])
def test_trains_and_the_damper_name_a_deviation_without_the_evidence_of_an_effect(damper_share, trains_feel, name):
    """In an uncertain file the support is a deviation. Formerly the answer was "a or b" for any response of trains."""
    names = [names_of("file", damper_share, trains_feel, seed=s, unsure=3.0) for s in range(5)]
    assert names.count(name) >= 4 and set(names) <= {name, EITHER}
