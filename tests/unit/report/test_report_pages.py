"""Pages of a small registry that all stages produced, as a reader sees them."""

import re
import shutil
from dataclasses import replace
from datetime import date
from functools import cache
from html.parser import HTMLParser

import duckdb
import numpy as np
import pytest
from benchmarks.published.response import paper_response

from turnout.config import load_configuration, with_raw
from turnout.demo.hammer import hammer_test
from turnout.readers.writing import write
from turnout.registry.database import open_registry, rebuild_database
from turnout.registry.job import register
from turnout.report.job import report_job
from turnout.report.pages.turnout import lines_of
from turnout.report.panels.diagram import diagram
from turnout.report.site import write_pages
from turnout.report.source import CAMPAIGNS, ROWS, FleetSource
from turnout.stages.hammer import hammer_unit
from turnout.workflow.batches import UnitResult, read_results, write_batch
from turnout.workflow.configuration_rows import configuration_rows
from turnout.workflow.job_log import job_log
from turnout.workflow.scan import scan, unit_id

DAYS = (date(2024, 5, 13), date(2024, 6, 17))


@pytest.fixture(scope="module")
def pages(tmp_path_factory, repository):
    """(folder of pages, open registry) of tommerup_s1 with two sections and two campaigns. The second SP is cut off,
    and the force at a third section, OT, has the wrong sign.
    """
    root = tmp_path_factory.mktemp("fleet")
    raw, notes = root / "raw", ["campaign,started_at_utc,rail_temperature_c"]
    rng = np.random.default_rng(3)
    for day in DAYS:
        folder = raw / "tommerup_s1" / "hammer" / day.isoformat()
        folder.mkdir(parents=True)
        notes.append(f"{day},{day}T09:00:00,12.0")
        for section in ("A7", "SP"):
            recordings, _ = hammer_test(paper_response(section, 1.0, 1.0), 12.0, day, 1, rng)
            write(recordings, folder / f"{section}_1.npz", "npz")
    recordings, _ = hammer_test(paper_response("OT", 1.0, 1.0), 12.0, day, 1, rng)
    reversed_force = [replace(r, samples=r.samples * [[-1.0], [1.0]]) for r in recordings]
    write(reversed_force, folder / "OT_1.npz", "npz")
    (folder / "SP_1.npz").write_bytes((folder / "SP_1.npz").read_bytes()[:5000])
    (raw / "tommerup_s1" / "campaigns.csv").write_text("\n".join(notes) + "\n")
    configuration = load_configuration(repository / "config")
    turnout = with_raw(configuration.turnout("tommerup_s1"), raw)
    results = [
        UnitResult(unit_id(u), u.turnout, u.kind, "key", "1", "ok", hammer_unit(u, turnout, raw, algo="1"))
        for u in scan(turnout, raw).units
    ]
    batch = write_batch(root / "work", results)
    tables = configuration_rows(configuration, raw, [])
    register([batch], root / "registry", read=read_results, tables=tables)
    with open_registry(root / "registry") as connection:
        write_pages(connection, root / "pages", 1, progress=False)
        yield root / "pages", connection


class Reader(HTMLParser):
    """Parser of the text, links and anchors of a page."""

    def __init__(self, text):
        super().__init__()
        self.words, self.links, self.ids, self.hidden = [], [], set(), 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.hidden += tag == "style"
        if "href" in attributes:
            self.links.append(attributes["href"])
        if "id" in attributes:
            self.ids.add(attributes["id"])

    def handle_endtag(self, tag):
        self.hidden -= tag == "style"

    def handle_data(self, data):
        if not self.hidden:
            self.words.append(data)


def read(path):
    return Reader(path.read_text())


def test_every_link_has_a_target_and_no_page_loads_from_the_network(pages):
    folder, _ = pages
    read_once = cache(read)  # pages have hundreds of links to others
    for path in folder.rglob("*.html"):
        for link in read_once(path).links:
            file, _, anchor = link.partition("#")
            target = (path.parent / file).resolve() if file else path
            assert target.exists(), f"{path.name} links to {link}"
            assert not anchor or anchor in read_once(target).ids, f"{path.name} links to {link}"
        text = re.sub(r"xmlns[^ >]*", "", path.read_text())
        assert "http" not in text and "src=" not in text  # the only script is inside the page


def test_no_page_shows_a_missing_value_as_none_or_nan(pages):
    folder, _ = pages
    for path in folder.rglob("*.html"):
        text = re.sub(r"<script>.*?</script>", "", path.read_text(), flags=re.DOTALL).replace("(null ", "(")
        if path.name == "glossary.html":
            text = text.replace("null model", "").replace("null hypothesis", "")
        assert not re.search(r"\b(nan|NaN|None|null)\b", text), path.name


def test_the_page_shows_the_resonance_of_the_registry_with_interval_and_n(pages):
    from scipy.stats import t as student

    folder, connection = pages
    frequency, error, n = connection.execute(
        """select frequency_hz, frequency_se_hz, n_impacts from modes_current
        where section_id = 'tommerup_s1/A7' and band = 'ballast' order by measured_at_utc desc limit 1"""
    ).fetchall()[0]
    words = " ".join(read(folder / "turnouts" / "tommerup_s1.html").words)
    half = student.ppf(0.975, n - 1) * error
    assert f"{frequency:.1f} ± {half:.1f}" in words
    # 99.4 Hz of the paper, with a spread between impacts of 0.6 %
    assert abs(frequency - 99.4) < 1.0


def test_a_line_without_a_change_names_its_sections_and_resonance():
    without_change = {
        "turnout_id": "W1",
        "state": "cannot tell",
        "sections": "A8",
        "band": "railpad",
        "change_pct": None,
        "sentence": "too little",
    }
    with_change = without_change | {
        "state": "inspect this week",
        "change_pct": -9.2,
        "sentence": "railpad resonance of A8 fell",
    }
    assert [line["words"] for line in lines_of([without_change, with_change])] == [
        "A8, railpad: too little",
        with_change["sentence"],
    ]


@pytest.mark.parametrize(("band", "words"), [("railpad", "railpad"), ("amplitude", "acceleration")])
def test_a_line_of_a_campaign_to_confirm_names_its_sections_and_chart(band, words):
    row = {
        "turnout_id": "W1",
        "state": "confirm now",
        "sections": "A8",
        "band": band,
        "change_pct": -22.0,
        "sentence": "the campaign of 2026-05-13 lies 22.0 % below its expected value",
    }
    assert lines_of([row])[0]["words"] == f"A8, {words}: {row['sentence']}"


def test_a_diagnosis_of_two_alarms_is_shown_once():
    row = {
        "turnout_id": "W1",
        "state": "plan",
        "sections": "A8",
        "band": "railpad",
        "change_pct": 1.0,
        "sentence": "it fell",
    }
    rows = [row | {"diagnosis": "local pad; 4 tests"}, row, row | {"diagnosis": "local pad; 4 tests"}]
    assert [line["diagnosis"] for line in lines_of(rows)] == ["local pad", "", "as above for this turnout"]
    assert [line["evidence"] for line in lines_of(rows)] == ["4 tests", "", ""]


def test_the_modes_of_a_page_have_the_campaigns_of_their_models(pages):
    """The rows of modes off their history are those of a view of modes_current: one with all modes stands for it."""
    _, connection = pages
    source = FleetSource(connection)
    campaigns = {f"tommerup_s1/{day}" for day in DAYS}
    assert {m["campaign_id"] for m in source.rows_of(["tommerup_s1"])["modes"]["tommerup_s1"]} == campaigns
    all_modes = ROWS["off_track"].replace(
        "from modes_off_track",
        """from (select *, 0.0 as frequency_track_hz, 0.0 as damping_track, 0.0 as residue_ratio, 9 as n_history,
        0.0 as shape_mac, '' as verdict, 0.0 as frequency_distance, 0.0 as damping_distance from modes_current)""",
    )
    rows = connection.execute(all_modes, {"turnouts": ["tommerup_s1"]}).fetch_df()
    assert set(rows["campaign_id"]) == campaigns


def test_the_campaigns_of_a_page_need_no_models_of_other_turnouts():
    """A site of many turnouts is written in groups: each would join the models of all."""
    connection = duckdb.connect()
    connection.execute("""create view models_current as
        select * from (values ('a', 't1', 't1/2026-05-01'), ('b', 't2', 't2/2026-05-01'))
            as of_model (model_id, turnout_id, campaign_id)""")
    rows = connection.execute(f"from {CAMPAIGNS}", {"turnouts": ["t1"]}).fetchall()
    assert rows == [("a", "t1/2026-05-01")]


def test_files_that_were_not_used_are_listed_as_in_quarantine(pages):
    folder, _ = pages
    words = " ".join(read(folder / "turnouts" / "tommerup_s1.html").words)
    assert "SP_1.npz" in words and "In quarantine" in words


def test_the_page_states_that_a_section_has_no_measurements(pages):
    folder, _ = pages
    page = read(folder / "turnouts" / "tommerup_s1.html")
    words = " ".join(page.words)
    assert "Not measured yet, or nothing could be read" in words and "not measured" in words
    assert "Latest hammer test, none" not in words and words.count("Without a hammer test") == 1


def test_the_reason_of_a_rejected_test_is_visible_without_a_click(pages):
    text = (pages[0] / "turnouts" / "tommerup_s1.html").read_text()
    own = text[text.index('<h2 id="OT"') : text.index('<h2 id="SP"')]
    assert "No model yet." in own and "Latest hammer test, 2024-06-17: 0 of 10 impacts accepted" in own
    assert "<details" not in own


def test_the_diverging_track_starts_at_the_switch_toe_in_the_diagram():
    """Formerly, without a sensor at the switch panel, it started at the first sensor, wherever that was."""
    one = {"section_id": "t/A", "label": "A", "panel": "CP", "track": "main", "position_m": 24.0}
    rows = [one, one | {"position_m": 26.0}]
    main, branch = re.findall(r'class="rail" d="M([\d.]+)', diagram(rows, {}))
    left, right = 20.0, 900.0  # -4 m and 30 m
    assert float(main) == left and float(branch) == pytest.approx(left + (right - left) * 4.0 / 34.0, abs=0.1)


def test_a_fleet_page_is_written_without_data(tmp_path):
    register([], tmp_path / "registry", read=read_results)
    with open_registry(tmp_path / "registry") as connection:
        assert write_pages(connection, tmp_path / "pages", progress=False) == 1
    assert "No chart has been computed yet" in " ".join(read(tmp_path / "pages" / "index.html").words)


@pytest.fixture
def copied(pages, tmp_path):
    """Copies for a test to change: (folder of pages, folder of the registry)."""
    for name in ("pages", "registry"):
        shutil.copytree(pages[0].parent / name, tmp_path / name, ignore=shutil.ignore_patterns(".spill"))
    rebuild_database(tmp_path / "registry")
    return tmp_path / "pages", tmp_path / "registry"


def written(folder, action):
    """Names of the turnout pages that ``action`` writes."""
    before = {p: p.stat().st_mtime_ns for p in folder.glob("turnouts/*.html")}
    action()
    after = {p: p.stat().st_mtime_ns for p in folder.glob("turnouts/*.html")}
    return sorted(p.stem for p in after if after[p] != before.get(p))


def test_a_page_is_written_again_only_if_its_rows_in_the_registry_change(copied):
    folder, registry = copied
    with job_log(folder / "log"):
        assert written(folder, lambda: report_job(registry, folder, progress=False)) == []
    assert "1 pages of generation" in (folder / "log").read_text()
    event = {"event_id": "e1", "turnout_id": "tommerup_s2", "event_at_utc": "2024-06-01T00:00:00", "kind": "tamping"}
    event |= {"resets_ballast": True, "resets_railpad": False}
    with open_registry(registry) as connection:
        known = connection.sql("from events").to_arrow_table().to_pylist()
    known = [row | {"event_at_utc": row["event_at_utc"].isoformat()} for row in known]
    register([], registry, read=read_results, tables={"events": [*known, event]})
    assert written(folder, lambda: report_job(registry, folder)) == ["tommerup_s2"]
    assert "tamping" in (folder / "turnouts/tommerup_s2.html").read_text()


def test_a_deleted_or_truncated_page_is_written_again(copied):
    folder, registry = copied
    (folder / "turnouts/tommerup_s1.html").unlink()
    (folder / "turnouts/tommerup_s2.html").write_text("<!doctype html>")
    assert written(folder, lambda: report_job(registry, folder)) == ["tommerup_s1", "tommerup_s2"]


def test_the_page_of_a_removed_turnout_is_deleted_and_other_files_are_kept(copied):
    folder, registry = copied
    page = (folder / "turnouts/tommerup_s1.html").read_text()
    (folder / "turnouts/gone.html").write_text(page)
    (folder / "turnouts/notes.html").write_text("<p>mine</p>")
    report_job(registry, folder, ["tommerup_s1"])
    assert (folder / "turnouts/gone.html").exists(), "a report of one turnout must not change the pages of others"
    report_job(registry, folder)
    assert not (folder / "turnouts/gone.html").exists() and (folder / "turnouts/notes.html").exists()


def test_several_processes_write_the_same_pages(copied, tmp_path, monkeypatch):
    folder, registry = copied
    monkeypatch.setattr("turnout.report.job.AT_ONCE", 1)
    report_job(registry, tmp_path / "two", threads=2)
    names = sorted(p.name for p in folder.glob("turnouts/*.html"))
    assert len(names) > 2
    assert sorted(p.name for p in (tmp_path / "two/turnouts").iterdir()) == names
    assert all((tmp_path / "two/turnouts" / n).read_text() == (folder / "turnouts" / n).read_text() for n in names)


def test_tables_can_be_read_by_keyboard_and_screen_reader(pages):
    """Every table is in a named region that scrolls, every header cell has a scope, every drawing has a name."""
    folder, _ = pages
    for path in folder.rglob("*.html"):
        text = path.read_text()
        regions = re.findall('<div class="scroll" tabindex="0" role="region" aria-label="[^"]+">(<table|.)', text)
        assert regions.count("<table") == text.count("<table")
        assert "<th>" not in text and "<th class" not in text
        outer = re.findall(r"<svg[^>]*class=[^>]*>", text)
        assert all(re.search('role="(img|group)"', tag) and "aria-label" in tag for tag in outer)
        assert 'href="#main"' in text and 'id="main"' in text
