"""Answers of the calibrated model after each visit, on seeded linear histories with a known change."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    Event,
    GroupInformation,
    Innovation,
    ModelAnswer,
    OnsetEvidence,
    StateParameter,
    VisitInformation,
    answers_after_visits,
    answers_of_change,
    change_answer,
    change_candidates,
    compare_onsets,
    estimate_history,
    stretch_candidates,
)
from turnout.mismatch.calibrated.model_answer import is_explained, position_of
from turnout.mismatch.turnout.calibration import dip_directions, nose_errors
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.stages.calibrated_model import within_library
from turnout.stages.recorded_work import events_of

N_SUPPORT, SD, STEP = 5, 0.05, 0.5
SUPPORTS = [StateParameter(f"ballast@{0.6 * k:.2f}", 0.0, 0.1, 0.03, "ballast", k, 0.6 * k) for k in range(N_SUPPORT)]
GAINS = [StateParameter(f"gain_A{k}", 1.0, 0.02, 0.003, "gain", None, 0.6 * k) for k in (1, 3)]
PARAMETERS = [*SUPPORTS, *GAINS]
NAMES = tuple(p.name for p in PARAMETERS)
MEAN = np.array([p.mean for p in PARAMETERS])
CANDIDATES = change_candidates(PARAMETERS)
SOFT_OR_GAP = ("local_ballast", "hanging_sleeper")


def histories(rng, n_visit, change, trains_feel=1.0):
    """Visits with one group of impacts and one of trains; ``change(visit)`` is added to the parameters."""
    rows = np.array([[0.6 ** abs(i - j) for j in range(N_SUPPORT)] + [0.0, 0.0] for i in range(6)])
    rows = np.vstack([rows, np.eye(len(PARAMETERS))[N_SUPPORT:]])
    x = rng.normal(MEAN, [p.sd for p in PARAMETERS])
    visits = []
    for v in range(n_visit):
        groups = []
        for group, share in (("A: impacts at 1.20 m", 1.0), ("A: locomotive, 120 km/h", trains_feel)):
            y = rows @ (x + share * change(v)) + rng.normal(0.0, SD, len(rows))
            groups.append(GroupInformation(group, 1, NAMES, rows.T @ rows / SD**2, rows.T @ y / SD**2))
        visits.append(VisitInformation(f"v{v}", STEP * v, tuple(groups)))
    return visits


def step(name, size, first):
    return lambda v: size * (v >= first) * np.eye(len(PARAMETERS))[NAMES.index(name)]


def last_answers(visits):
    return {a.question: a for a in answers_after_visits(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0, len(visits))}


def test_a_step_is_named_with_its_onset_from_its_first_visit_on_and_not_before():
    visits = histories(np.random.default_rng(1), 5, step("ballast@1.20", 0.8, 3))
    answers = [a for a in answers_after_visits(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0) if a.question == "change"]
    assert [a.verdict for a in answers] == ["none", "none", "none", "named", "named"]
    last = answers[-1]
    assert (last.names, last.parameter, last.position) == (("local_ballast",), "ballast@1.20", 1.2)
    assert last.onset == (2 * STEP, 3 * STEP)
    assert last.size == pytest.approx(0.8, abs=4.0 * last.sd)


def test_the_evidence_of_a_name_does_not_depend_on_the_spacing_of_its_candidates():
    """With three copies of each candidate each counts a third, and the three together count as one."""
    visits = histories(np.random.default_rng(1), 5, step("ballast@1.20", 0.8, 3))
    once, thrice = (change_answer(PARAMETERS, visits, [], n * CANDIDATES, 12.0, 6.0) for n in (1, 3))
    assert once.names == thrice.names == ("local_ballast",)
    assert thrice.gain == pytest.approx(once.gain, abs=1e-9)


def test_a_growing_effect_is_a_change_with_its_onset_in_the_interval():
    visits = histories(np.random.default_rng(2), 6, lambda v: 0.3 * max(v - 1, 0) * np.eye(len(PARAMETERS))[2])
    answer = last_answers(visits)["change"]
    assert answer.verdict == "named" and answer.parameter == "ballast@1.20" and answer.grows
    assert answer.size == pytest.approx(0.6, abs=0.1)  # a year
    assert answer.onset[0] <= STEP <= answer.onset[1]


def during(name, size, first, last):
    """A change of visits ``first`` to ``last`` alone, as by a logger with another gain for a month."""
    return lambda v: step(name, size, first)(v) - step(name, size, last + 1)(v)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("last", [2, 3])
def test_a_change_that_has_ended_is_stated_while_it_lasts_and_not_afterwards(last, seed):
    visits = histories(np.random.default_rng(seed), 7, during("gain_A1", -0.5, 2, last))
    answers = [a for a in answers_after_visits(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0) if a.question == "change"]
    assert [(a.verdict, a.parameter) for a in answers[2 : last + 1]] == [("named", "gain_A1")] * (last - 1)
    assert [a.verdict for a in answers[last + 1 :]] == ["none"] * (6 - last)


@pytest.mark.parametrize("seed", range(4))
def test_a_change_that_has_ended_does_not_hide_one_that_lasts(seed):
    ended, lasting = during("gain_A1", -0.9, 2, 4), step("ballast@1.20", -0.5, 4)
    answer = last_answers(histories(np.random.default_rng(seed), 7, lambda v: ended(v) + lasting(v)))["change"]
    assert answer.verdict != "none" and answer.parameter == "ballast@1.20"
    assert answer.onset[0] < 4 * STEP <= answer.onset[1]
    assert answer.size == pytest.approx(-0.5, abs=4.0 * answer.sd)


def test_a_visit_that_differs_alone_and_has_no_name_is_unknown_until_the_next_one():
    """Signals of a train with another model error in one visit: no parameter explains them."""
    visits = histories(np.random.default_rng(6), 6, lambda v: 0.0)
    wrong = visits[3].groups[1]
    noise = 60.0 * np.random.default_rng(7).standard_normal(len(NAMES))
    visits[3] = replace(visits[3], groups=(visits[3].groups[0], replace(wrong, vector=wrong.vector + 4.0 * noise)))
    answers = [a for a in answers_after_visits(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0) if a.question == "change"]
    assert answers[3].verdict == "unknown" and [a.verdict for a in answers[4:]] == ["none", "none"]


def test_softer_ballast_with_less_effect_on_trains_is_a_hanging_sleeper():
    visits = histories(np.random.default_rng(3), 4, step("ballast@1.20", -1.0, 2), trains_feel=0.3)
    assert last_answers(visits)["change"].names == ("hanging_sleeper",)
    only_trains = [
        replace(v, groups=v.groups[1:]) for v in histories(np.random.default_rng(4), 4, step("ballast@1.20", -1.0, 2))
    ]
    answer = change_answer(PARAMETERS, only_trains, [], CANDIDATES, 12.0, 6.0)
    assert answer.verdict == "a_or_b" and answer.names == ("local_ballast", "hanging_sleeper")


@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("seed", range(5))
def test_impacts_alone_or_trains_alone_do_not_distinguish_a_gap_from_soft_ballast(kind, seed):
    visits = histories(np.random.default_rng(seed), 4, step("ballast@1.20", -1.6, 2))
    alone = [replace(v, groups=v.groups[kind : kind + 1]) for v in visits]
    before = [replace(v, groups=v.groups[: 2 - (v.time >= 2 * STEP)]) for v in visits]  # trains before the change only
    for chosen in (alone, before):
        answer = change_answer(PARAMETERS, chosen, [], CANDIDATES, 12.0, 6.0)
        assert (answer.verdict, answer.names) == ("a_or_b", ("local_ballast", "hanging_sleeper"))


@pytest.mark.parametrize(
    ("trains_feel", "names"), [(1.0, ("local_ballast", "hanging_sleeper")), (0.0, ("hanging_sleeper",))]
)
def test_trains_distinguish_a_gap_from_soft_ballast_only_if_they_close_it(trains_feel, names):
    """At a gap that no train closes the ballast is soft under impacts and under trains."""
    answers = [
        last_answers(histories(np.random.default_rng(s), 4, step("ballast@1.20", -1.6, 2), trains_feel))["change"]
        for s in range(10)
    ]
    assert [a.names for a in answers] == [names] * 10


def test_trains_of_some_visits_identify_a_gap_and_do_not_change_the_evidence_of_impacts():
    visits = histories(np.random.default_rng(7), 6, step("ballast@1.20", -1.6, 3), trains_feel=0.0)
    impacts = [replace(v, groups=v.groups[:1]) for v in visits]
    ends = [v if k in (0, 5) else i for k, (v, i) in enumerate(zip(visits, impacts))]
    alone = change_answer(PARAMETERS, impacts, [], CANDIDATES, 12.0, 6.0, True)
    with_trains = change_answer(PARAMETERS, impacts, [], CANDIDATES, 12.0, 6.0, True, (PARAMETERS, ends))
    assert (alone.names, with_trains.names) == (SOFT_OR_GAP, ("hanging_sleeper",))
    assert with_trains.gain == alone.gain and (with_trains.size, with_trains.onset) == (alone.size, alone.onset)


def test_a_change_has_the_same_prior_where_the_file_is_uncertain():
    """The evidence of a step has the same prior at a boundary of two sections; that of a sensor is its own."""
    unsure = [replace(p, sd=1.3) if p.name == "ballast@1.20" else p for p in PARAMETERS]
    by_name = {c.name: c.sd for c in change_candidates(unsure)}
    assert {by_name[p.name] for p in SUPPORTS} == {0.5}
    assert by_name["gain_A1"] == pytest.approx(0.1)
    assert {c.sd for c in stretch_candidates(unsure)} == {0.5}


def test_trains_with_little_information_on_the_support_do_not_decide():
    visits = []
    for v in histories(np.random.default_rng(1), 4, step("ballast@1.20", -1.6, 2)):
        trains = replace(v.groups[1], matrix=1e-6 * v.groups[1].matrix, vector=1e-6 * v.groups[1].vector)
        visits.append(replace(v, groups=(v.groups[0], trains)))
    assert change_answer(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0).verdict == "a_or_b"


def test_a_rival_just_below_the_threshold_counts(monkeypatch):
    """Evidence of 12.3 and 11.9 nats less the penalty of the choice: only the best one must reach the threshold."""
    price = float(np.log(len(CANDIDATES)))
    by_name = {c.name: c for c in CANDIDATES if not c.grows}

    def evidence(name, gain, size):
        gains, sizes = np.array([gain + price]), np.array([size])
        return OnsetEvidence(by_name[name], ("v0", "v1"), np.array([0.0, 0.5]), gains, sizes, np.array([0.01]))

    def answer(rival):
        pair = [evidence("gain_A1", 12.3, 0.3), evidence("ballast@1.20", rival, 0.5)]
        monkeypatch.setattr(
            answers_of_change,
            "compare_onsets",
            lambda h, c: sorted(pair, key=lambda e: -e.gain) if c == CANDIDATES else [],
        )
        found = change_answer(PARAMETERS, visits, [], CANDIDATES, 12.0, 6.0)
        return found.verdict, found.names

    visits = histories(np.random.default_rng(1), 2, step("gain_A1", 0.0, 1))
    assert answer(11.9) == ("a_or_b", ("sensor_gain", "local_ballast"))
    assert answer(6.2) == ("named", ("sensor_gain",))
    assert answer(12.4) == ("a_or_b", ("local_ballast", "sensor_gain"))


def test_a_sensor_whose_gain_changed_is_named_with_its_channel_position():
    answer = last_answers(histories(np.random.default_rng(5), 4, step("gain_A3", 0.5, 2)))["change"]
    assert answer.names == ("sensor_gain",) and answer.position == pytest.approx(1.8)


def test_an_effect_of_the_first_day_is_a_difference_from_the_file_and_no_change():
    answers = last_answers(histories(np.random.default_rng(6), 5, step("ballast@1.20", 0.8, 0)))
    assert answers["change"].verdict == "none"
    assert answers["file"].names == ("local_ballast",) and answers["file"].position == pytest.approx(1.2)


def test_intact_histories_have_no_finding():
    """60 histories: by Markov's inequality a name has a probability below exp(-12) in each."""
    rng = np.random.default_rng(7)
    verdicts = [last_answers(histories(rng, 5, step("ballast@1.20", 0.0, 0)))["change"].verdict for _ in range(60)]
    assert verdicts.count("none") >= 59 and "named" not in verdicts


def test_a_change_below_the_smallest_size_has_no_name():
    answer = last_answers(histories(np.random.default_rng(8), 6, step("gain_A1", 0.07, 3)))["change"]
    assert answer.verdict == "none"  # 0.08 is the smallest change of a gain that matters


def test_a_small_change_that_makes_visits_differ_has_its_name(monkeypatch):
    """The same change in more exact recordings: the visits are not used, and "unknown" helps nobody."""
    monkeypatch.setattr(sys.modules[__name__], "SD", 0.4 * SD)
    answer = last_answers(histories(np.random.default_rng(9), 6, step("gain_A1", 0.07, 3)))["change"]
    assert (answer.verdict, answer.names, answer.parameter) == ("named", ("sensor_gain",), "gain_A1")
    assert answer.size == pytest.approx(0.07, abs=2.0 * answer.sd) and answer.onset == (1.0, 1.5)


WAVES = Waves((2.0, 9.0), 0.0)
SURFACE = [
    StateParameter(f"{n}@{WAVES.start:.2f}-{WAVES.end:.2f}", 0.0, float(sd), 0.0, "wave")
    for n, sd in zip(WAVES.names, WAVES.sd)
]


def test_dips_are_sums_of_waves_without_large_amplitudes_that_cancel():
    directions = dip_directions(SURFACE)
    direction = directions["dip of 0.8 m@5.00"]
    x = np.linspace(4.0, 6.0, 201)
    amplitudes = np.array([direction[p.name] for p in SURFACE])
    shape = amplitudes @ WAVES.shapes(x)
    dip = 0.5 + 0.5 * np.cos(2.0 * np.pi * np.clip((x - 5.0) / 0.8, -0.5, 0.5))
    assert np.corrcoef(shape, dip)[0, 1] > 0.85  # waves longer than the stretch of the sensors are missing
    assert np.argmax(shape) == pytest.approx(100, abs=5) and 0.6 < np.ptp(shape) < 1.3
    assert np.max(np.abs(amplitudes)) < 0.3  # of a dip of 1
    assert dip_directions([replace(p, group="pad") for p in SURFACE]) == {}


@pytest.mark.parametrize(("depth", "verdict"), [(6e-4, "named"), (0.0, "none")])
def test_a_dip_of_the_first_day_is_a_difference_from_the_file(depth, verdict):
    """Trains measure the waves with half of their prior sd; no candidate has the length of this dip, 0.7 m."""
    rng, names, sd = np.random.default_rng(9), tuple(p.name for p in SURFACE), WAVES.sd
    x = np.arange(WAVES.start, WAVES.end, 0.02)
    dip = depth * (0.5 + 0.5 * np.cos(2.0 * np.pi * np.clip((x - 5.03) / 0.7, -0.5, 0.5)))
    rows = WAVES.shapes(x).T * sd
    truth = sd * np.linalg.solve(rows.T @ rows + 1e-10 * np.eye(len(sd)), rows.T @ dip) + rng.normal(0.0, sd)
    visits = []
    for v in range(3):
        y = truth + 0.5 * sd * rng.normal(size=len(sd))
        group = GroupInformation("A: locomotive", 1, names, np.diag(4.0 / sd**2), 4.0 * y / sd**2)
        visits.append(VisitInformation(f"v{v}", 0.5 * v, (group,)))
    candidates = change_candidates(SURFACE, dip_directions(SURFACE))
    answers = {a.question: a for a in answers_after_visits(SURFACE, visits, [], candidates, 12.0, 6.0, 3)}
    assert answers["change"].verdict == "none" and answers["file"].verdict == verdict
    if depth:
        assert answers["file"].names == ("surface_dip",) and answers["file"].position == pytest.approx(5.03, abs=0.15)
        assert answers["file"].size == pytest.approx(depth, rel=0.35)


def visits_with_a_dip(position, first, n_visit=4):
    """Trains measure the waves with a fifth of their prior sd; from one visit on there is a dip of 0.8 mm."""
    rng, names, sd = np.random.default_rng(12), tuple(p.name for p in SURFACE), WAVES.sd
    x = np.arange(WAVES.start, WAVES.end, 0.02)
    dip = 8e-4 * (0.5 + 0.5 * np.cos(2.0 * np.pi * np.clip((x - position) / 0.7, -0.5, 0.5)))
    rows = WAVES.shapes(x).T * sd
    change, waves = sd * np.linalg.solve(rows.T @ rows + 1e-10 * np.eye(len(sd)), rows.T @ dip), rng.normal(0.0, sd)
    for v in range(n_visit):
        y = waves + (v >= first) * change + 0.2 * sd * rng.normal(size=len(sd))
        group = GroupInformation("A: locomotive", 1, names, np.diag(25.0 / sd**2), 25.0 * y / sd**2)
        yield VisitInformation(f"v{v}", 0.5 * v, (group,))


@pytest.mark.parametrize("position", [1.4, 5.5, 9.6])
def test_dips_are_tested_as_far_beyond_the_sensors_as_effects_of_supports(position):
    """The sensors stand at 2.0 to 9.0 m, and a wheel beyond them still excites them."""
    candidates = change_candidates(SURFACE, dip_directions(SURFACE))
    answer = change_answer(SURFACE, list(visits_with_a_dip(position, 2)), [], candidates, 12.0, 6.0)
    assert (answer.verdict, answer.names) == ("named", ("surface_dip",))
    assert answer.position == pytest.approx(position, abs=0.15)


@pytest.mark.parametrize("is_in_library", [False, True])
@pytest.mark.parametrize("position", [4.4, 5.5])
def test_a_change_of_the_surface_without_a_name_has_a_position(monkeypatch, position, is_in_library):
    """Formerly the location was a wave, without a position: dips were not in the library, or explained too little."""
    shapes, visits = dip_directions(SURFACE), list(visits_with_a_dip(position, 2))
    monkeypatch.setattr(answers_of_change, "is_explained", lambda *jumps: False)
    candidates = change_candidates(SURFACE, shapes, () if is_in_library else ("surface_dip",))
    answers = [
        change_answer(SURFACE, visits, [], candidates, 12.0, 6.0, surface=surface)
        for surface in (answers_of_change.surface_changes(shapes), ())
    ]
    assert [(a.verdict, a.names, a.group) for a in answers] == [("unknown", (), "wave")] * 2
    assert answers[0].position == pytest.approx(position, abs=0.15) and answers[1].position is None


@pytest.mark.parametrize("position", [4.4, 5.5])
def test_a_surface_that_differs_from_its_file_has_a_position_also_without_a_name(position):
    """A dip of the first day, and no dips in the library."""
    parameters, visits = (*SURFACE, GAINS[0]), list(visits_with_a_dip(position, 0, 3))
    candidates = change_candidates(parameters, {}, ("surface_dip",))
    surface = answers_of_change.surface_changes(dip_directions(SURFACE))
    answers = answers_after_visits(parameters, visits, [], candidates, 12.0, 6.0, 3, surface=surface)
    (answer,) = (a for a in answers if a.question == "file")
    assert (answer.verdict, answer.names, answer.group) == ("unknown", (), "wave")
    assert answer.position == pytest.approx(position, abs=0.15)


@pytest.mark.parametrize(("section", "opened"), [("", {"ballast@0.00", "ballast_stiffness"}), ("A", {"ballast@0.00"})])
def test_maintenance_of_the_whole_turnout_makes_common_parameters_uncertain(tmp_path, section, opened):
    rows = f"turnout,section,date,kind,resets,note\nt1,{section},2026-01-10,tamping,,\n"
    (tmp_path / "events.csv").write_text(rows)
    sections = [SimpleNamespace(label="A", position=0.6)]
    turnout = SimpleNamespace(folder=tmp_path, id="t1", sections=sections)
    common = [StateParameter(n, 0.0, 0.25, 0.0, "track") for n in ("ballast_stiffness", "pad_stiffness")]
    (event,) = events_of(turnout, [SUPPORTS[0], GAINS[0], *common])
    assert set(event.opened) == opened


def test_a_change_that_no_name_explains_is_unknown():
    """A damper of one support changes. It has no name, and no effect with a name is accepted instead."""
    damper = StateParameter("ballast_damper@1.20", 0.0, 0.15, 0.05, "ballast_damper", 2, 1.2)
    parameters, names = [*PARAMETERS, damper], (*NAMES, damper.name)
    visits = []
    for v in histories(np.random.default_rng(11), 4, step("ballast@1.20", 0.0, 0)):
        rows = np.eye(len(names))[[NAMES.index("ballast@1.20"), len(NAMES)]]
        rows[1, NAMES.index("ballast@1.20")] = 0.3
        y = rows @ np.r_[np.zeros(len(NAMES)), 2.0 * (v.time >= 2 * STEP)]
        extra = GroupInformation("A: impacts at 1.20 m", 1, names, rows.T @ rows / SD**2, rows.T @ y / SD**2)
        visits.append(replace(v, groups=(*v.groups, extra)))
    answer = change_answer(parameters, visits, [], change_candidates(parameters), 12.0, 6.0)
    assert (answer.verdict, answer.names) == ("unknown", ()) and answer.onset[0] <= STEP < answer.onset[1] == 2 * STEP
    assert abs(answer.position - 1.2) <= 0.6


def test_a_change_beside_recorded_tamping_is_a_change():
    """Tamping makes the ballast uncertain between the visits; the first visit still shows that it was intact."""
    tamping = Event(1.2 * STEP, {p.name: p.sd for p in SUPPORTS})
    visits = histories(np.random.default_rng(13), 4, step("ballast@1.20", 1.6, 2))
    answer = change_answer(PARAMETERS, visits, [tamping], CANDIDATES, 12.0, 6.0)
    assert answer.names == ("local_ballast",) and answer.onset == (STEP, 2 * STEP)


@pytest.mark.parametrize(("true", "verdict"), [(1.54, "named"), (1.05, "none"), (0.55, "none")])
def test_a_nose_that_is_clearly_twice_as_deep_as_in_the_file_is_a_finding_with_its_position(true, verdict):
    """The file has 0.43 mm with a tolerance of 40 %. 1.05 mm may be less than twice as deep, with 10 % for fits."""
    nose = StateParameter("ln depth of the kink at 5.50 m", 0.0, 0.4, 0.0, "depth")
    size, sd = np.log(true / 0.43), 0.12
    group = GroupInformation("A: locomotive", 1, (nose.name,), np.array([[sd**-2]]), np.array([size / sd**2]))
    visits = [VisitInformation("v0", 0.0, (group,))]
    answer = {a.question: a for a in answers_after_visits([nose], visits, [], change_candidates([nose]), 12.0, 6.0)}
    assert answer["file"].verdict == verdict
    if verdict == "named":
        assert answer["file"].names == ("surface_dip",) and answer["file"].position == 5.5
        assert answer["file"].size == pytest.approx(size, abs=2.0 * answer["file"].sd)


def test_a_spring_with_its_damper_is_named_and_outer_supports_have_no_finding():
    """Data determine the sum of spring and damper best: without the pair the damper explains them better."""
    pad = StateParameter("pad@1.20", 0.0, 0.1, 0.02, "pad", 2, 1.2)
    damper = StateParameter("pad_damper@1.20", 0.0, 0.15, 0.04, "pad_damper", 2, 1.2)
    names = (pad.name, damper.name)
    rows = np.array([[0.3, 1.0], [0.0, 0.25]]) / 0.02
    for outer, expected in ((False, "named"), (True, "unknown")):
        parameters = [replace(p, may_change=not outer) for p in (pad, damper)]
        visits = []
        for v in range(4):
            y = rows @ (np.array([1.8, 0.9]) * (v >= 2))
            group = GroupInformation("A: impacts at 1.20 m", 1, names, rows.T @ rows, rows.T @ y)
            visits.append(VisitInformation(f"v{v}", STEP * v, (group,)))
        answer = change_answer(parameters, visits, [], change_candidates(parameters), 12.0, 6.0)
        assert answer.verdict == expected
        if not outer:
            assert (answer.names, answer.position) == (("local_pad",), 1.2)
            assert answer.size == pytest.approx(1.8, abs=0.1)


def test_another_locomotive_is_no_change():
    """Each visit has another locomotive: its unsprung mass is no value of the turnout."""
    mass = StateParameter("wheels_locomotive", 0.0, 0.06, 0.006, "wheels", visit_sd=0.06)
    visits = []
    for v, deviation in enumerate((-0.05, -0.05, -0.05, 0.12)):
        group = GroupInformation("A: locomotive", 1, (mass.name,), np.array([[1e4]]), np.array([1e4 * deviation]))
        visits.append(VisitInformation(f"v{v}", STEP * v, (group,)))
    assert change_answer([mass], visits, [], CANDIDATES[:0], 12.0, 6.0).verdict == "none"
    assert change_answer([replace(mass, visit_sd=0.0)], visits, [], CANDIDATES[:0], 12.0, 6.0).verdict == "unknown"


def test_the_surface_at_a_nose_belongs_to_the_nose_and_is_no_dip():
    """The file has an estimate of the nose; the error of its shape is no difference from the file."""
    rng, names, sd = np.random.default_rng(9), tuple(p.name for p in SURFACE), WAVES.sd
    nose = StateParameter("ln depth of the kink at 5.30 m", 0.0, 0.4, 0.0, "depth")
    direction = dip_directions(SURFACE)["dip of 0.6 m@5.00"]
    y = 6e-4 * np.array([direction[n] for n in names]) + 0.2 * sd * rng.normal(size=len(sd))
    group = GroupInformation("A: locomotive", 1, names, np.diag(25.0 / sd**2), 25.0 * y / sd**2)
    for parameters, verdict in ((SURFACE, "named"), ([*SURFACE, nose], "none")):
        candidates = change_candidates(parameters, dip_directions(parameters))
        answer = answers_after_visits(
            parameters,
            [VisitInformation("v0", 0.0, (group,))],
            nose_errors(parameters, dip_directions(parameters)),
            candidates,
            12.0,
            6.0,
        )[-1]
        assert (answer.question, answer.verdict) == ("file", verdict)


@pytest.mark.parametrize(
    ("size", "expected"),
    [(-0.3, ("a_or_b", ("local_ballast", "hanging_sleeper"))), (0.3, ("named", ("local_ballast",)))],
)
def test_a_stretch_softer_than_in_the_file_may_have_soft_ballast_or_gaps(size, expected):
    """None of three supports has enough evidence for a name; together they differ from the file."""
    change = sum(step(f"ballast@{x:.2f}", size, 0)(0) for x in (0.6, 1.2, 1.8))
    answer = last_answers(histories(np.random.default_rng(23), 4, lambda v: change))["file"]
    assert (answer.verdict, answer.names) == expected and answer.gain is None
    assert answer.position == pytest.approx(1.2, abs=0.31)


def test_a_nose_that_wears_unevenly_is_named_at_the_nose():
    """The surface changes by four dips and humps, of which one alone explains less than half."""
    rng, names, sd = np.random.default_rng(19), tuple(p.name for p in SURFACE), WAVES.sd
    nose = StateParameter("ln depth of the kink at 5.30 m", 0.0, 0.4, 0.0, "depth")
    directions = dip_directions(SURFACE)
    dips = {"4.90": 1.0, "5.20": -1.0, "5.50": 1.0, "5.80": -1.0}
    shape = [1e-3 * sum(size * directions[f"dip of 0.4 m@{x}"][n] for x, size in dips.items()) for n in names]
    parameters, visits = [*SURFACE, nose], []
    truth = sd * rng.normal(size=len(sd))
    for v in range(4):
        y = truth + np.array(shape) * (v >= 2) + 0.2 * sd * rng.normal(size=len(sd))
        group = GroupInformation("A: locomotive", 1, names, np.diag(25.0 / sd**2), 25.0 * y / sd**2)
        visits.append(VisitInformation(f"v{v}", STEP * v, (group,)))
    answer = change_answer(parameters, visits, [], change_candidates(parameters, directions), 12.0, 6.0)
    assert (answer.verdict, answer.names, answer.position) == ("named", ("surface_dip",), 5.3)
    assert answer.onset == (STEP, 2 * STEP)


def test_a_visit_with_the_usual_deviation_from_its_prediction_is_no_unknown_change():
    innovation = Innovation(400.0, 190, 1e-16, "wave", 5.0, 190)
    assert not innovation.is_expected and innovation.is_expected_at(2.1)
    assert not replace(innovation, deviates=9.0).is_expected_at(2.1)


@pytest.mark.parametrize(
    ("size", "names"), [(-3.2, ("hanging_sleeper",)), (-1.6, ("local_ballast", "hanging_sleeper"))]
)
def test_a_support_without_ballast_reaction_under_impacts_and_trains_hangs(size, names):
    """A gap that no train closes: impacts and trains agree."""
    visits = histories(np.random.default_rng(15), 4, step("ballast@1.20", size, 2))
    assert last_answers(visits)["change"].names == names
    start = histories(np.random.default_rng(16), 4, step("ballast@1.20", size, 0))
    assert last_answers(start)["file"].names == names
    near = histories(np.random.default_rng(15), 4, step("ballast@1.20", np.log(0.1), 2))  # a tenth: neither is certain
    assert last_answers(near)["change"].names == ("local_ballast", "hanging_sleeper")


def test_an_effect_that_explains_little_of_a_change_has_no_name():
    """Half of the excess over the 100 directions of a visit; without a change they leave 100."""
    jump = Innovation(1100.0, 100, 0.0, "seat_A3", 50.0, 190)
    assert is_explained(jump, replace(jump, statistic=600.0))
    assert not is_explained(jump, replace(jump, statistic=601.0))
    expected = replace(jump, statistic=90.0)
    assert is_explained(expected, expected)


@pytest.mark.parametrize("first", [0, 2])
def test_another_effect_that_explains_little_of_a_change_has_no_name(first):
    """A sensor is moved, and its gain has the evidence of a name, although it explains only a part of the change."""
    seat = StateParameter("seat_A3", 0.0, 0.02, 0.002, "seat", None, 1.8)
    parameters, names = [*PARAMETERS, seat], (*NAMES, seat.name)
    visits = []
    for v in histories(np.random.default_rng(17), 4, step("gain_A3", 0.0, 0)):
        rows = np.zeros((2, len(names)))
        rows[0, NAMES.index("gain_A3")], rows[:, -1] = 1.0, (0.5, 1.0)
        y = rows @ np.r_[MEAN, 2.0 * (v.time >= first * STEP)]
        extra = GroupInformation("A: impacts at 1.80 m", 1, names, rows.T @ rows / SD**2, rows.T @ y / SD**2)
        visits.append(replace(v, groups=(*v.groups, extra)))
    question = "change" if first else "file"
    for without, expected in (((), ("named", ("sensor_position",))), (("sensor_position",), ("unknown", ()))):
        candidates = change_candidates(parameters, without=without)
        stated = {a.question: a for a in answers_after_visits(parameters, visits, [], candidates, 12.0, 6.0, 4)}
        answer = stated[question]
        assert (answer.verdict, answer.names) == expected and answer.position == 1.8
        history = estimate_history(parameters, visits, repeats_between_visits=False, accepted=None)
        gains = [max(e.gain, e.from_first) for e in compare_onsets(history, candidates) if e.effect.name == "gain_A3"]
        assert max(gains) > 12.0 + np.log(len(candidates))  # the precondition of this test


@pytest.mark.parametrize("question", ["change", "file"])
@pytest.mark.parametrize(("name", "parameter"), [("local_ballast", "ballast@1.20"), ("sensor_gain", "gain_A3")])
def test_without_its_effect_in_the_library_a_site_has_no_other_name(question, name, parameter):
    """The true effect is not in the library, n = 5 each: the answer is "unknown" at its position."""
    candidates = change_candidates(PARAMETERS, without=(name,))
    position = next(p.position for p in PARAMETERS if p.name == parameter)
    for seed in range(5):
        first = 0 if question == "file" else 2
        size = 0.5 if name == "sensor_gain" else -1.6
        visits = histories(np.random.default_rng(seed), 4, step(parameter, size, first))
        stated = answers_after_visits(PARAMETERS, visits, [], candidates, 12.0, 6.0, 4)
        assert {a.verdict for a in stated if a.question == question} == {"unknown"}
        assert not any(a.names for a in stated)
        assert abs(next(a.position for a in stated if a.question == question) - position) <= 0.6


def test_a_wave_has_no_position_and_a_dip_has_one():
    assert position_of(SURFACE[0].name, SURFACE[0]) is None
    assert position_of("dip of 0.8 m@5.00", None) == 5.0


def all_candidates():
    return [*CANDIDATES, *stretch_candidates(PARAMETERS)]


def test_stretches_are_adjacent_supports_of_one_group_with_their_dampers():
    stretches = stretch_candidates(PARAMETERS)
    assert len(stretches) == 2 * (4 + 3 + 2 + 1)  # of two to five of five supports, step and growth
    assert {len(c.direction) for c in stretches} == {2, 3, 4, 5} and {c.group for c in stretches} == {"ballast"}
    assert stretches[-1].name == "ballast@0.00 to 2.40, dampers 0.5" and stretches[-1].position == 1.2
    apart = [p for p in SUPPORTS if p.index != 2]
    assert {tuple(c.direction) for c in stretch_candidates(apart) } == {
        ("ballast@0.00", "ballast@0.60"), ("ballast@1.80", "ballast@2.40"),
    }  # fmt: skip
    damper = StateParameter("ballast_damper@1.20", 0.0, 0.15, 0.05, "ballast_damper", 2, 1.2)
    directions = [c.direction for c in change_candidates([SUPPORTS[2], damper])]
    expected = [{"ballast@1.20": 1.0, damper.name: share} for share in (0.5, 0.5, 1.0, 1.0)]
    assert directions == [{"ballast@1.20": 1.0}, {"ballast@1.20": 1.0}, *expected]


@pytest.mark.parametrize("seed", range(5))
def test_a_small_change_of_a_stretch_is_named_after_an_alarm(seed):
    """0.15 at three supports, which would be too small at a single one."""
    affected = ("ballast@0.60", "ballast@1.20", "ballast@1.80")
    change = sum(step(name, 1.0, 0)(0) for name in affected)
    visits = histories(np.random.default_rng(seed), 12, lambda v: -0.15 * (v >= 6) * change)
    answer = change_answer(PARAMETERS, visits, [], all_candidates(), 12.0, 6.0, True)
    assert answer.names[0] == "local_ballast" and answer.group == "ballast" and not answer.grows
    assert abs(answer.position - 1.2) < 0.31 and len({*answer.changed} & {*affected}) >= 2
    assert abs(answer.size + 0.15) < 4.0 * answer.sd + 0.03 and answer.total == answer.size
    assert answer.onset[0] <= 6 * STEP and answer.onset[1] >= 6 * STEP


def test_an_alarm_on_an_intact_history_has_no_name():
    """The mean of the likelihood ratios of all candidates exceeds e^6 in at most e^-6 = 0.25 % of intact histories."""
    named = 0
    for seed in range(200):
        visits = histories(np.random.default_rng(1000 + seed), 8, lambda v: np.zeros(len(PARAMETERS)))
        named += change_answer(PARAMETERS, visits, [], all_candidates(), 6.0, 3.0, True).verdict in ("named", "a_or_b")
    assert named <= 3  # 0.5 expected at most, Poisson: more than 3 with a probability of 0.2 %


def test_trains_distinguish_a_gap_of_several_sleepers_from_soft_ballast():
    change = sum(step(f"ballast@{x:.2f}", 1.0, 0)(0) for x in (0.6, 1.2, 1.8))
    for trains_feel, names in ((1.0, ("local_ballast", "hanging_sleeper")), (0.0, ("hanging_sleeper",))):
        visits = histories(np.random.default_rng(7), 6, lambda v: -1.0 * (v >= 3) * change, trains_feel)
        answer = change_answer(PARAMETERS, visits, [], all_candidates(), 12.0, 6.0, True)
        assert answer.names == names and len(answer.changed) == 3


@pytest.mark.parametrize(
    ("verdict", "names", "without", "expected"),
    [
        ("a_or_b", ("local_ballast", "hanging_sleeper"), ("hanging_sleeper",), ("named", ("local_ballast",))),
        ("named", ("hanging_sleeper",), ("hanging_sleeper",), ("unknown", ())),
        (
            "a_or_b",
            ("local_ballast", "hanging_sleeper"),
            ("local_pad",),
            ("a_or_b", ("local_ballast", "hanging_sleeper")),
        ),
        ("none", (), ("local_pad",), ("none", ())),
    ],
)
def test_an_effect_that_is_left_out_of_the_library_is_not_named(verdict, names, without, expected):
    """Nor is it named as a form of another effect: a gap that no train closes as soft ballast."""
    answer = within_library(ModelAnswer("2024-02-01", "change", verdict, names), without)
    assert (answer.verdict, answer.names) == expected
