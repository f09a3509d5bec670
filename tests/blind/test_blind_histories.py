"""Histories of sites: the drawn values, the changes between visits, and the scores of the answers."""

import csv
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import date, datetime, timedelta

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config.events import read_events
from turnout_blind import history
from turnout_blind.effect import ConcealedEffect, load_effects
from turnout_blind.history import HistoryPlan, make_history, parameters_at, plan_histories
from turnout_blind.make import make_set
from turnout_blind.score.histories import history_figures, judge_history
from turnout_blind.score.metrics import Rate, Share
from turnout_blind.seal import BlindError

EFFECTS = load_effects()


def panel(kind):
    return EFFECTS[kind].site.get("panel", "plain")


def test_a_set_has_the_stated_shares_of_patterns_effects_and_panels():
    plans = plan_histories(5, 80, EFFECTS)
    assert [sum(p.pattern == n for p in plans) for n in history.PATTERNS] == [20, 10, 25, 25]
    assert sum(p.panel == "crossing" for p in plans) == 40
    kinds = [p.effect[0] for p in plans if p.effect]
    assert set(kinds) == set(history.HISTORY_EFFECTS) and max(map(kinds.count, kinds)) <= 14
    assert all(p.effect is None for p in plans if p.pattern == "none")
    assert all(p.panel == "crossing" for p in plans if p.effect and p.effect[0] == "nose")
    assert plans == plan_histories(5, 80, EFFECTS) != plan_histories(6, 80, EFFECTS)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A site with growing soft ballast, whose recordings are not simulated."""
    folder = tmp_path_factory.mktemp("history")
    worlds, patch = [], pytest.MonkeyPatch()
    patch.setattr(history, "write_campaign", lambda f, site, world, c, rng, decoys: worlds.append(world))
    patch.setattr(history, "write_passage", lambda *a: None)
    patch.setattr(history, "effect_visibility", lambda *a: {"hammer_pct": 30.0, "passage_pct": 0.0})
    (folder / "T1" / "raw" / "T1").mkdir(parents=True)
    truth = make_history(folder, "T1", HistoryPlan("growth", ("ballast", 5), (4, 2, 8)), EFFECTS)
    patch.undo()
    return folder / "T1", truth, worlds


def test_the_effect_grows_from_its_day_on_and_the_track_wears(site):
    _, truth, worlds = site
    effect, shares = truth["effects"][0], truth["severities"]
    assert shares[0] == 0.0 and sorted(shares) == shares and 0.0 < shares[-1] <= 1.0
    assert truth["visits"][0] < truth["onset"] < truth["visits"][-1]
    j = effect["where"]["sleeper"]
    far = j + 6  # wear alone, and tamping where it is recorded
    others = [w.ballast[far] / worlds[0].ballast[far] for w in worlds]
    if not any(m["kind"] == "tamping" for m in truth["maintenance"]):
        assert 0.85 < others[-1] < 1.0
    changes = [w.ballast[j] / worlds[0].ballast[j] for w in worlds]
    expected = effect["parameters"]["factor"] ** shares[-1]
    assert changes[-1] / others[-1] == pytest.approx(expected, rel=0.1)


def test_the_files_of_the_owner_hold_all_visits_and_events_but_not_the_effect(site):
    folder, truth, _ = site
    with open(folder / "raw" / "T1" / "campaigns.csv") as file:
        assert [row["campaign"] for row in csv.DictReader(file)] == truth["visits"]
    events, errors, _ = read_events(folder / "config" / "events.csv", "events.csv", None, {})
    assert not errors and [(e.at.date().isoformat(), e.kind) for e in events] == sorted(
        (m["day"], m["kind"]) for m in truth["maintenance"]
    )
    written = "".join(p.read_text() for p in folder.rglob("*") if p.is_file())
    assert "growth" not in written and truth["onset"] not in written


def test_maintenance_changes_the_track_from_the_start_of_its_day_as_in_the_events():
    site = history.draw_site(np.random.default_rng(3))
    n = site.world.position.size
    when = site.campaigns[0].replace(hour=9)
    for hour, day in ((0, 0), (9, 0), (23, 0), (23, -1)):
        at = when.replace(hour=hour) + timedelta(days=day)
        work = [(at, "tamping", "", {"ballast": np.full(n, 0.5), "damping": np.ones(n)})]
        world = history._world_at(site, when, np.zeros(n), work)
        assert world.ballast == pytest.approx(0.5 * site.world.ballast)
    work = [(when.replace(hour=0) + timedelta(days=1), "tamping", "", work[0][3])]
    assert history._world_at(site, when, np.zeros(n), work).ballast == pytest.approx(site.world.ballast)


@pytest.mark.parametrize("kind", history.HISTORY_EFFECTS)
def test_no_recorded_maintenance_repairs_the_concealed_effect(kind, tmp_path, monkeypatch):
    """The first draw has tamping and an exchange of every sensor; the second draw has no maintenance."""
    for name in ("write_campaign", "write_passage", "write_configuration", "write_notes", "set_file_times"):
        monkeypatch.setattr(history, name, lambda *a: None)
    monkeypatch.setattr(history, "effect_visibility", lambda *a: {"hammer_pct": 30.0, "passage_pct": 0.0})
    draws = []

    def draw_maintenance(rng, site):
        draws.append(site)
        day, n = site.campaigns[0] + timedelta(days=200), site.world.position.size
        tamping = (day, "tamping", "", {"ballast": np.ones(n), "damping": np.ones(n)})
        others = [
            (day, "sensor_change", f"S{k + 1}", {"sensor": name, "gain": 1.0, "shift": 0.0})
            for k, name in enumerate(site.names())
        ]
        return [tamping, *others] if len(draws) == 1 else []

    monkeypatch.setattr(history, "_draw_maintenance", draw_maintenance)
    (tmp_path / "T1" / "config").mkdir(parents=True)
    truth = make_history(tmp_path, "T1", HistoryPlan("start", (kind, 4), (4, 2), panel(kind)), EFFECTS)
    is_repaired = kind in ("ballast", "void", "gain", "position")
    assert len(draws) == (2 if is_repaired else 1) and bool(truth["maintenance"]) != is_repaired


def test_maintenance_elsewhere_or_before_the_effect_does_not_repair_it():
    onset = datetime(2023, 3, 1, 15)
    gain = ConcealedEffect("gain", "sensor", {"sensor": "A2"})
    for sensor, day, expected in (("A2", 2, True), ("A2", 1, True), ("A3", 2, False), ("A2", -1, False)):
        when = datetime(2023, 3, 1) + timedelta(days=day - 1)
        work = [(when, "sensor_change", f"S{sensor[1:]}", {"sensor": sensor, "gain": 1.0, "shift": 0.0})]
        assert history.has_repair(gain, onset, work) == expected
    assert not history.has_repair(None, onset, work) and not history.has_repair(gain, None, work)


def test_parameters_of_a_growing_effect_end_at_their_full_size():
    for kind in history.HISTORY_EFFECTS:
        site = history.draw_site(np.random.default_rng(3), panel=panel(kind))
        full = EFFECTS[kind].draw_concealed(np.random.default_rng(1), site, 5).parameters
        assert parameters_at(kind, full, 1.0) == pytest.approx({**full, **({"growth": 0.0} if kind == "void" else {})})
    assert parameters_at("void", {"gap": 2e-3, "seated": 0.2, "close": 1e-4, "growth": 0.02}, 0.5) == pytest.approx(
        {"gap": 1e-3, "seated": 0.6, "close": 1e-4, "growth": 0.0}
    )


def test_a_set_of_histories_is_sealed_like_any_other(tmp_path, monkeypatch):
    def make_small_case(folder, case, plan, effects):
        (folder / case).mkdir(parents=True)
        (folder / case / "raw.txt").write_text(f"{plan.seed}")
        return {"case": case, "pattern": plan.pattern, "effects": []}

    monkeypatch.setattr("turnout_blind.make.make_history", make_small_case)
    monkeypatch.setattr("turnout_blind.make.ProcessPoolExecutor", ThreadPoolExecutor)
    sha = [make_set(tmp_path / f"s{k}", tmp_path / f"t{k}", 7, histories=(4, 2)) for k in range(2)]
    assert sha[0] == sha[1]
    assert json.loads((tmp_path / "t0" / "set.json").read_text())["histories"] == [4, 2]


@pytest.fixture
def begun_set(tmp_path, monkeypatch):
    """Makes a set of which nothing but set.json exists, as after an interruption."""

    def make(**options):
        monkeypatch.setattr("turnout_blind.make.plan_cases", lambda *arguments: [])
        monkeypatch.setattr("turnout_blind.make.plan_histories", lambda *arguments, **named: [])
        make_set(tmp_path / "s", tmp_path / "t", **options)
        (tmp_path / "s" / "commit.json").unlink()

    (tmp_path / "s").mkdir()
    return make


@pytest.mark.parametrize(
    ("begun", "now", "message"),
    [
        ({"histories": (2, 1)}, {}, "--histories and --passages: begun otherwise: 2 and 1, now none"),
        ({}, {"histories": (2, 3)}, "--histories and --passages: begun otherwise: none, now 2 and 3"),
        ({"full": False}, {}, "--fast: begun otherwise: with it, now without it"),
        ({"only": {"dip", "pad"}}, {"only": {"pad"}}, "--only: begun otherwise: dip and pad, now pad"),
        ({"limit": 3}, {}, "--limit: begun otherwise: 3, now none"),
        ({"panel": "switch"}, {}, "--panel: begun otherwise: switch, now plain"),
        ({"seed": 1}, {"seed": 2}, "--seed: begun otherwise: another seed. Go on"),
    ],
)
def test_a_set_that_is_continued_with_other_options_states_both(begun_set, begun, now, message):
    """Formerly a set of histories could be continued as one of single campaigns, and messages named no option."""
    begun_set(**begun)
    with pytest.raises(BlindError, match=message):
        begun_set(**now)
    begun_set(**begun)


@pytest.mark.parametrize("options", [["--fast"], ["--only", "dip"], ["--panel", "crossing"]])
def test_options_that_histories_do_not_have_are_errors(tmp_path, capsys, options):
    """Formerly they were ignored: --panel crossing gave plain track at half of the sites."""
    where = ["--out", str(tmp_path / "s")]
    assert main(["blind", "make", "--histories", "2", *options, *where]) == 2
    assert f"{' '.join(options[:2]) if options[0] == '--panel' else options[0]}: a set" in capsys.readouterr().err
    assert not (tmp_path / "s-truth").exists()


def test_passages_are_an_option_of_histories_alone(tmp_path, capsys):
    assert main(["blind", "make", "--limit", "1", "--passages", "3", "--out", str(tmp_path / "s")]) == 2
    assert "--passages, 3: only histories have this option. Give --histories N, too" in capsys.readouterr().err


TRUTH = {
    "case": "T1", "pattern": "step", "panel": "plain", "onset": "2023-04-20", "maintenance": [],
    "effects": [{"kind": "pad", "where": {"sleeper": 42, "position": 1.8}, "parameters": {"factor": 0.24}}],
    "visits": ["2022-02-06", "2022-10-12", "2023-06-13", "2024-01-29"], "severities": [0.0, 0.0, 1.0, 1.0],
    "visible": [{"hammer_pct": h, "passage_pct": 0.0} for h in (0.0, 0.0, 70.0, 70.0)],
}  # fmt: skip
NOTHING = {"verdict": "none", "term": None, "rival_term": None, "position_m": None, "channel": None}
PAD = {
    **NOTHING,
    "verdict": "named",
    "term": "local_pad",
    "position_m": 1.9,
    "onset_after": "2022-10-12",
    "onset_by": "2023-06-13",
}


def rows(*change):
    return [
        {**row, "visit": v, "question": q}
        for v, c in zip(TRUTH["visits"], change)
        for q, row in (("change", c), ("file", NOTHING))
    ]


def test_a_change_that_is_named_at_its_position_and_in_time_counts():
    result = judge_history(TRUTH, rows(NOTHING, NOTHING, PAD, PAD))
    assert (result.named, result.is_located, result.onset_covered) == ("named", True, True)
    assert not result.wrong_names and not result.alarms
    late = judge_history(TRUTH, rows(NOTHING, NOTHING, NOTHING, PAD))
    assert late.named == "named"
    far = judge_history(TRUTH, rows(NOTHING, NOTHING, {**PAD, "position_m": 4.2}, NOTHING))
    assert far.named == "named" and not far.is_located


def test_wrong_names_false_alarms_and_maintenance_are_counted():
    early = judge_history(
        {**TRUTH, "maintenance": [{"day": "2022-05-01", "kind": "tamping"}]}, rows(NOTHING, PAD, PAD, PAD)
    )
    assert early.alarms == {"change": ("2022-10-12",)} and early.maintenance_alarms == 1
    assert early.years == pytest.approx((date(2022, 10, 12) - date(2022, 2, 6)).days / 365.25)
    gain = {**PAD, "term": "sensor_gain", "channel": "A1"}
    wrong = judge_history(TRUTH, rows(NOTHING, NOTHING, gain, gain))
    assert wrong.wrong_names == ("sensor_gain",) and wrong.named == ""
    outside = judge_history({**TRUTH, "onset": "2022-06-01"}, rows(NOTHING, NOTHING, PAD, PAD))
    assert outside.onset_covered is False
    none = judge_history(TRUTH, None)
    assert not none.answered and none.named == "" and none.last_answer == "no answer"
    listed = history_figures([early, wrong, none])
    shares = {f.name: (f.k, f.n) for f in listed if isinstance(f, Share)}
    assert shares["clear effects named within two visits"] == (1, 3)
    assert shares["sites with recorded maintenance called a defect"] == (1, 1)
    assert shares["sites with a wrong name"] == (1, 3)
    (rate,) = (f for f in listed if isinstance(f, Rate))
    assert (rate.k, rate.years) == (1, pytest.approx(3 * 248 / 365.25))


def test_each_false_alarm_counts_when_it_begins_also_after_maintenance():
    """Four visits without an effect: two alarms of a pad are one, a gain after it and work before are a second."""
    gain = {**PAD, "term": "sensor_gain", "channel": "A1"}
    intact = {**TRUTH, "pattern": "none", "effects": [], "severities": [0.0] * 4, "onset": None}
    work = [{"day": "2023-07-01", "kind": "tamping"}]
    result = judge_history({**intact, "maintenance": work}, rows(NOTHING, PAD, PAD, gain))
    assert result.alarms == {"change": ("2022-10-12", "2024-01-29")}
    assert (result.n_works, result.maintenance_alarms) == (1, 1)
    again = judge_history(intact, rows(PAD, NOTHING, PAD, PAD))
    assert again.alarms == {"change": ("2022-02-06", "2023-06-13")} and again.n_works == 0
    unknown = {**NOTHING, "verdict": "unknown"}
    assert judge_history(intact, rows(unknown, unknown, gain, gain)).alarms["change"] == ("2022-02-06", "2023-06-13")
    figures = {f.name: f for f in history_figures([result, again])}
    rate, worked = figures["false alarms of a change, per site-year"], "sites with recorded maintenance called a defect"
    assert (rate.k, rate.years) == (4, pytest.approx(2 * 722 / 365.25)) and not rate.is_met
    assert rate.interval == pytest.approx((100 * 1.0899 / rate.years, 100 * 10.2416 / rate.years), rel=1e-4)  # Garwood
    assert (figures[worked].k, figures[worked].n) == (1, 1)


def test_a_visit_with_the_effect_has_no_exposure_to_false_alarms():
    """The effect is present but not clear from the second visit on: a wrong name then is no false alarm."""
    truth = {**TRUTH, "severities": [0.0, 0.3, 1.0, 1.0], "maintenance": [{"day": "2022-10-12", "kind": "tamping"}]}
    result = judge_history(truth, rows(NOTHING, {**PAD, "term": "sensor_gain", "channel": "A1"}, PAD, PAD))
    assert not result.alarms and result.years == 0.0 and result.n_works == 0
    assert result.wrong_names == ("sensor_gain",)
    (rate,) = (f for f in history_figures([result]) if isinstance(f, Rate))
    assert rate.is_met is None


def test_an_effect_of_the_first_day_is_scored_by_the_comparison_with_the_file():
    truth = {**TRUTH, "pattern": "start", "onset": None, "severities": [1.0] * 4, "visible": [TRUTH["visible"][2]] * 4}
    answers = [{**PAD, "visit": TRUTH["visits"][0], "question": "file", "onset_after": None}]
    result = judge_history(truth, answers)
    assert (result.named, result.is_located, result.onset_covered) == ("named", True, None)
    change = judge_history(
        truth, [{**PAD, "visit": TRUTH["visits"][1], "question": "change", "term": "sensor_gain", "channel": "A1"}]
    )
    assert change.alarms == {"change": ("2022-10-12",)}


def test_times_of_campaigns_and_passages_of_single_cases_do_not_change(tmp_path):
    site = history.draw_site(np.random.default_rng(1))
    assert site.passage_time(1) == datetime(2024, 7, 16, 11, 30)
    moved = replace(site, passages=[replace(site.passages[0], when=datetime(2023, 1, 1))])
    assert moved.passage_time(0) == datetime(2023, 1, 1) and len(site.campaigns) == 2


@pytest.mark.parametrize(
    "kind, parameters, share, row, covered",
    [
        ("pad", {"factor": 0.24}, 1.0, {"size": -1.40, "size_se": 0.02, "grows": False}, True),  # ln 0.24 = -1.427
        ("pad", {"factor": 0.24}, 0.5, {"size": -1.40, "size_se": 0.02, "grows": False}, False),  # half of it
        ("pad", {"factor": 0.24}, 0.5, {"size": -9.0, "size_se": 0.1, "total": -0.7, "total_se": 0.05}, True),
        ("gain", {"gain": 0.81}, 0.5, {"size": -0.1, "size_se": 0.01}, True),  # 0.81 to the power of a half
        ("position", {"shift": -0.2}, 0.5, {"size": -0.2, "size_se": 0.01}, False),
        ("position", {"shift": -0.2}, 0.5, {"size": -0.2, "size_se": 0.01, "grows": True}, None),  # a rate alone
        ("void", {"gap": 1e-3, "seated": 0.35, "growth": 0.0}, 1.0, {"size": -0.2, "size_se": 0.01}, None),
        ("pad", {"factor": 0.24}, 1.0, {"size": None, "size_se": None}, None),
    ],
)
def test_the_size_at_the_last_answer_is_compared_with_the_size_of_the_effect_at_that_time(
    kind, parameters, share, row, covered
):
    where = {"sensor": "A1", "position": 1.8, "sleeper": 42}
    effect = {"kind": kind, "where": where, "parameters": parameters}
    truth = {**TRUTH, "effects": [effect], "severities": [0.0, 0.0, share, share]}
    term = {"pad": "local_pad", "gain": "sensor_gain", "position": "sensor_position", "void": "hanging_sleeper"}[kind]
    last = {**PAD, "term": term, "channel": "A1", **row}
    assert judge_history(truth, rows(NOTHING, NOTHING, last, last)).size_covered is covered
