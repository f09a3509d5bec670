"""A section none of whose newest recordings could be used is on tomorrow's list, with the reason."""

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
    """Result of a hammer test all of whose six impacts were rejected."""
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


def test_a_section_all_of_whose_impacts_were_rejected_is_on_the_list(bench):
    bench.register(rejected_result(day="2026-01-05"), hammer_result(section="A2", day="2026-01-05"))
    said = "no hammer test could be used yet (1 tried); 2026-01-05: 6 of 6 impacts rejected (sign_reversed)"
    assert bench.ask(LIST) == [("t1", "A1", "hammer", "cannot tell", said)]


def test_a_section_whose_newest_test_failed_says_since_when_and_a_good_one_later_takes_it_off(bench):
    bench.register(hammer_result(), rejected_result(day="2026-02-09"), quarantined_result(day="2026-03-09"))
    said = "no hammer test could be used since 2026-01-05 (2 tried); 2026-03-09: 1 file in quarantine (truncated)"
    assert bench.ask(LIST) == [("t1", "A1", "hammer", "cannot tell", said)]
    earlier = LIST.replace("2027-01-01", "2026-02-10")
    assert "(1 tried); 2026-02-09: 6 of 6 impacts rejected" in bench.ask(earlier)[0][4]
    bench.register(hammer_result(day="2026-04-06"))
    assert bench.ask(LIST) == []


@pytest.mark.parametrize(("reason", "n"), [("truncated", 1), ("entry_unknown", 0), ("condition_lost", 0)])
def test_a_remark_on_a_recording_that_is_used_is_no_failure(bench, reason, n):
    bench.register(hammer_result(), quarantined_result(day="2026-03-09", reason=reason))
    assert len(bench.ask(LIST)) == n
    assert bench.ask("select count(*) from rejected where what = 'recording'") == [(n,)]
    assert bench.ask("select reason_code, is_remark from quarantine_open") == [(reason, n == 0)]


def test_sections_that_failed_alike_are_one_row_and_the_view_of_a_registry_without_a_model_has_it(bench):
    bench.register(quarantined_result(section="A1"), quarantined_result(section="A2"))
    assert [row[1] for row in bench.ask(LIST)] == ["A1, A2"]
    assert bench.ask("select count(*) from worklist") == [(1,)]


def test_a_file_that_fails_again_in_the_same_way_stays_on_the_list(bench):
    """Its row in quarantine is the one of the first result, which another has superseded."""
    bench.register(quarantined_result(key="first"))
    once = bench.ask(LIST)
    bench.register(quarantined_result(key="again"))
    assert bench.ask("select count(*) from results_current where kind = 'hammer'") == [(1,)]
    assert bench.ask(LIST) == once != []


@pytest.mark.parametrize(("n", "listed"), [(9, 0), (10, 1)])
def test_ten_passages_in_a_row_that_did_not_count_are_on_the_list_and_single_ones_are_not(bench, n, listed):
    bench.register(
        passage(0, "2026-01-05", "accepted"), *(passage(k, "2026-01-06", "rejected") for k in range(1, n + 1))
    )
    rows = bench.ask(LIST)
    assert len(rows) == listed
    if rows:
        said = "no passage could be used since 2026-01-05 (10 tried); most often: train_cut_off"
        assert rows == [("t1", "whole turnout", "passage", "cannot tell", said)]


def test_a_turnout_none_of_whose_files_has_a_known_name_is_on_the_list(tmp_path):
    row = {
        "quarantine_id": "0" * 32, "turnout_id": "t9", "kind": "configuration", "path": "t9", "stage": "plan",
        "reason_code": "nothing_found", "place": "folder", "found": "no file", "remedy": "Correct it",
    }  # fmt: skip
    register([], tmp_path / "registry", read=iter, tables={"quarantine": [row]})
    with open_registry(tmp_path / "registry") as con:
        rows = con.execute(LIST).fetchall()
    said = "nothing was read: 1 entry in quarantine (nothing_found)"
    assert rows == [("t9", "whole turnout", None, "cannot tell", said)]


def test_the_command_and_the_page_show_it_before_any_chart(bench, capsys):
    bench.register(rejected_result(day="2026-01-05"), tables={"turnouts": [
        {"turnout_id": "t1", "layout": "l", "config_hash": "h"}]})  # fmt: skip
    assert main(["worklist", "--registry", str(bench.registry)]) == 0
    told = capsys.readouterr().out
    assert "CANNOT TELL: t1, A1, all" in told and "6 of 6 impacts rejected (sign_reversed)" in told
    assert "from rejected where turnout_id = 't1'" in told and "No chart has been computed yet" in told


def test_a_turnout_counts_once_on_the_cards_however_many_rows_of_the_list_it_has(bench):
    """Two rows: A1, and A2 and A3 that failed alike on another day."""
    day = "2026-02-02"
    others = rejected_result("A2", day), rejected_result("A3", day)
    bench.register(rejected_result(day="2026-01-05", reason="double_hit"), *others, tables={"turnouts": [
        {"turnout_id": "t1", "layout": "l", "config_hash": "h"}]})  # fmt: skip

    class Template:
        def render(self, **said):
            return said

    with open_registry(bench.registry) as con:
        said = fleet_page(FleetSource(con), Template(), {})
    assert [w["label"] for w in said["worklist"]] == ["A1", "A2, A3"]
    counts = {card["state"]: card["n"] for card in said["cards"]}
    assert counts == {"inspect this week": 0, "plan": 0, "cannot tell": 1, "ok": 0} and said["n_turnouts"] == 1


def test_a_turnout_that_was_taken_out_is_on_no_list_and_back_on_it_when_it_is_back(bench):
    both = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2")]
    lists = {
        name: f"select distinct turnout_id from {name} order by all"
        for name in ("unusable()", "cannot_see()", "quarantine_open", "quarantine_by_reason")
    }

    def said():
        return {name: [row[0] for row in bench.ask(sql)] for name, sql in lists.items()}

    bad = [quarantined_result("t2", section="A2"), quarantined_result("t1", section="A2")]
    bench.register(rejected_result(), rejected_result(turnout="t2"), *bad, tables={"turnouts": both})
    assert said() == {name: ["t1", "t2"] for name in lists}
    bench.register(tables={"turnouts": both[1:]})
    assert said() == {name: ["t2"] for name in lists}
    assert bench.ask("select count(*) from models_current where turnout_id = 't1'") == [(1,)]  # history stays
    bench.register(tables={"turnouts": both})
    assert said() == {name: ["t1", "t2"] for name in lists}


def test_a_test_that_was_not_used_stays_on_the_page_when_newer_ones_were(bench):
    """The newest test of A1 was used, two before it were not; the rejected one of A2 is its newest, said elsewhere."""
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
    said = "Earlier hammer tests that were not used: 2026-03-09 (too few impacts), 2026-02-09 (too few impacts)"
    assert said in first and "were not used" not in second
