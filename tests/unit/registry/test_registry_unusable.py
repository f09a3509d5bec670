"""The worklist contains a section if none of its newest recordings could be used, with the reason."""

import pytest
from registry_rows import hammer_result, quarantined_result

from turnout.cli.main import main
from turnout.registry.database import open_registry
from turnout.registry.job import register
from turnout.report.pages.fleet import fleet_page
from turnout.report.site import write_pages
from turnout.report.source import FleetSource
from turnout.workflow.batches import UnitResult

LIST = "select turnout_id, sections, source, state, sentence from worklist(timestamp '2027-01-01') where band = 'all'"


def rejected_result(section="A1", day="2026-02-09", reason="sign_reversed", turnout="t1"):
    """Result of a hammer test whose six impacts were all rejected."""
    result = hammer_result(turnout, section, day)
    (model,), (recording,) = result.tables["models"], result.tables["recordings"]
    model |= {"status": "rejected", "reason": "too_few_impacts"}
    base = {k: recording[k] for k in ("turnout_id", "section_id", "campaign_id", "recording_id")}
    impacts = [
        base | {"impact_id": f"{recording['recording_id']}:{k}", "record": k, "status": "rejected", "reason": reason}
        for k in range(6)
    ]
    result.tables.update(modes=[], impacts=impacts)
    return result


def passage(k, day, status):
    """Result of one passage file."""
    at = f"{day}T10:{k:02d}:00"
    row = {
        "turnout_id": "t1", "passage_id": f"{k:032x}", "recording_id": f"{k:032x}", "passed_at_utc": at,
        "status": status, "reason": None if status == "accepted" else "train_cut_off",
    }  # fmt: skip
    unit = f"t1/passage/{day.replace('-', '')}T10{k:02d}00Z.npz"
    return UnitResult(unit, "t1", "passage", "k", "1", "ok", {"passages": [row]})


def test_a_section_whose_impacts_were_all_rejected_is_on_the_list(bench):
    bench.register(rejected_result(day="2026-01-05"), hammer_result(section="A2", day="2026-01-05"))
    expected = "no hammer test could be used yet (1 tried); 2026-01-05: 6 of 6 impacts rejected (sign_reversed)"
    assert bench.ask(LIST) == [("t1", "A1", "hammer", "cannot tell", expected)]


def test_a_section_whose_newest_tests_failed_is_listed_with_the_last_good_day_until_a_test_is_good(bench):
    bench.register(hammer_result(), rejected_result(day="2026-02-09"), quarantined_result(day="2026-03-09"))
    expected = "no hammer test could be used since 2026-01-05 (2 tried); 2026-03-09: 1 file in quarantine (truncated)"
    assert bench.ask(LIST) == [("t1", "A1", "hammer", "cannot tell", expected)]
    earlier = LIST.replace("2027-01-01", "2026-02-10")
    assert "(1 tried); 2026-02-09: 6 of 6 impacts rejected" in bench.ask(earlier)[0][4]
    bench.register(hammer_result(day="2026-04-06"))
    assert bench.ask(LIST) == []


def test_a_test_after_midnight_local_time_has_the_day_of_its_folder(bench):
    """In UTC it began on the day before."""
    good, bad = hammer_result(), rejected_result(day="2026-02-09")
    for result, night in ((good, "2026-01-04T22:30:00"), (bad, "2026-02-08T22:30:00")):
        for row in (*result.tables["models"], *result.tables["modes"]):
            row["measured_at_utc"] = night
    bench.register(good, bad)
    expected = "no hammer test could be used since 2026-01-05 (1 tried); 2026-02-09: 6 of 6 impacts rejected"
    assert bench.ask(LIST)[0][4].startswith(expected)


@pytest.mark.parametrize(("reason", "n"), [("truncated", 1), ("entry_unknown", 0), ("condition_lost", 0)])
def test_a_remark_about_a_used_recording_does_not_put_the_section_on_the_list(bench, reason, n):
    bench.register(hammer_result(), quarantined_result(day="2026-03-09", reason=reason))
    assert len(bench.ask(LIST)) == n
    assert bench.ask("select count(*) from rejected where what = 'recording'") == [(n,)]
    assert bench.ask("select reason_code, is_remark from quarantine_open") == [(reason, n == 0)]


def test_sections_that_failed_in_the_same_way_share_one_row_also_in_a_registry_without_models(bench):
    bench.register(quarantined_result(section="A1"), quarantined_result(section="A2"))
    assert [row[1] for row in bench.ask(LIST)] == ["A1, A2"]
    assert bench.ask("select count(*) from worklist") == [(1,)]


def test_a_file_that_fails_again_in_the_same_way_remains_on_the_list(bench):
    """Its row in quarantine belongs to the first result, which a later one superseded."""
    bench.register(quarantined_result(key="first"))
    once = bench.ask(LIST)
    bench.register(quarantined_result(key="again"))
    assert bench.ask("select count(*) from results_current where kind = 'hammer'") == [(1,)]
    assert bench.ask(LIST) == once != []


@pytest.mark.parametrize(("n", "listed"), [(9, 0), (10, 1)])
def test_ten_rejected_passages_in_a_row_are_on_the_list_and_fewer_are_not(bench, n, listed):
    bench.register(
        passage(0, "2026-01-05", "accepted"), *(passage(k, "2026-01-06", "rejected") for k in range(1, n + 1))
    )
    rows = bench.ask(LIST)
    assert len(rows) == listed
    if rows:
        expected = "no passage could be used since 2026-01-05 (10 tried); most often: train_cut_off"
        assert rows == [("t1", "whole turnout", "passage", "cannot tell", expected)]


def test_a_turnout_without_any_file_of_a_known_name_is_on_the_list(tmp_path):
    row = {
        "quarantine_id": "0" * 32, "turnout_id": "t9", "kind": "configuration", "path": "t9", "stage": "plan",
        "reason_code": "nothing_found", "place": "folder", "found": "no file", "remedy": "Correct it",
    }  # fmt: skip
    register([], tmp_path / "registry", read=iter, tables={"quarantine": [row]})
    with open_registry(tmp_path / "registry") as con:
        rows = con.execute(LIST).fetchall()
    expected = "nothing was read: 1 entry in quarantine (nothing_found)"
    assert rows == [("t9", "whole turnout", None, "cannot tell", expected)]


def test_the_command_shows_the_section_before_any_chart_exists(bench, capsys):
    bench.register(rejected_result(day="2026-01-05"), tables={"turnouts": [
        {"turnout_id": "t1", "layout": "l", "config_hash": "h"}]})  # fmt: skip
    assert main(["worklist", "--registry", str(bench.registry)]) == 0
    printed = capsys.readouterr().out
    assert "CANNOT TELL: t1, A1, all" in printed and "6 of 6 impacts rejected (sign_reversed)" in printed
    assert "from rejected where turnout_id = 't1'" in printed and "No chart has been computed yet" in printed


def test_the_cards_count_a_turnout_once_if_it_has_several_rows_in_the_list(bench):
    """Two rows: A1, and A2 with A3, which failed in the same way on another day."""
    day = "2026-02-02"
    others = rejected_result("A2", day), rejected_result("A3", day)
    bench.register(rejected_result(day="2026-01-05", reason="double_hit"), *others, tables={"turnouts": [
        {"turnout_id": "t1", "layout": "l", "config_hash": "h"}]})  # fmt: skip

    class Template:
        def render(self, **values):
            return values

    with open_registry(bench.registry) as con:
        values = fleet_page(FleetSource(con), Template(), {})
    assert [w["label"] for w in values["worklist"]] == ["A1", "A2, A3"]
    counts = {card["state"]: card["n"] for card in values["cards"]}
    assert counts == {"inspect this week": 0, "plan": 0, "cannot tell": 1, "ok": 0} and values["n_turnouts"] == 1


def test_a_removed_turnout_is_on_no_list_until_it_is_added_again(bench):
    both = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2")]
    lists = {
        name: f"select distinct turnout_id from {name} order by all"
        for name in ("unusable()", "cannot_see()", "quarantine_open", "quarantine_by_reason")
    }

    def listed_turnouts():
        return {name: [row[0] for row in bench.ask(sql)] for name, sql in lists.items()}

    bad = [quarantined_result("t2", section="A2"), quarantined_result("t1", section="A2")]
    bench.register(rejected_result(), rejected_result(turnout="t2"), *bad, tables={"turnouts": both})
    assert listed_turnouts() == {name: ["t1", "t2"] for name in lists}
    bench.register(tables={"turnouts": both[1:]})
    assert listed_turnouts() == {name: ["t2"] for name in lists}
    assert bench.ask("select count(*) from models_current where turnout_id = 't1'") == [(1,)]  # the history is kept
    bench.register(tables={"turnouts": both})
    assert listed_turnouts() == {name: ["t1", "t2"] for name in lists}


def test_the_page_lists_earlier_tests_that_were_not_used(bench):
    """The newest test of A1 was used, two before it were not; the rejected test of A2 is its newest."""
    sections = [
        {"section_id": f"t1/{label}", "turnout_id": "t1", "label": label, "panel": "CP", "track": "main"}
        for label in ("A1", "A2")
    ]
    turnout = {"turnout_id": "t1", "layout": "l", "config_hash": "h"}
    bench.register(
        hammer_result(day="2026-01-05"), rejected_result(day="2026-02-09"), rejected_result(day="2026-03-09"),
        hammer_result(day="2026-04-06"), rejected_result(section="A2", day="2026-04-06"),
        tables={"turnouts": [turnout], "sections": sections},
    )  # fmt: skip
    with open_registry(bench.registry) as con:
        write_pages(con, bench.root / "pages", 1, progress=False)
    page = (bench.root / "pages/turnouts/t1.html").read_text()
    first, second = page.split('<h2 id="A2"')
    expected = "Earlier hammer tests that were not used: 2026-03-09 (too few impacts), 2026-02-09 (too few impacts)"
    assert expected in first and "were not used" not in second
