"""Every kind of wrong row or key is reported with file, line, column, the wrong text and the remedy."""

from datetime import UTC, datetime, timedelta

import pytest

from turnout.cli.main import main
from turnout.config import load_configuration
from turnout.config.campaign_notes import read_campaigns
from turnout.config.filename_pattern import compile_pattern
from turnout.config.schema import FORMER_KEYS
from turnout.config.settings_schema import settings_keys
from turnout.config.turnouts_table import read_table
from turnout.errors import ConfigError, ConfigErrors
from turnout.readers.formats import FORMATS
from turnout.units import to_si

LAYOUT = """\
sections:
  A7: {panel: CP, track: main, position: 24.6}
  A8:
    panel: CP
    track: main
    position: 26.4
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  rate: 20000
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: V, sensitivity: 0.23, sensitivity_unit: mV/N}
    rail: {source: rail, quantity: acceleration, unit: m/s²}
passages:
  files: "passages/{time}.{ext}"
  channels:
    web: {source: 0, quantity: acceleration, section: A8}
"""
TABLE = "turnout\tlayout\traw\tkm\thammer_rate_hz\nt1\tmain\t\t1.5\t\nt2\tmain\tline/t2\t\t10000\n"


def configuration(folder, layout=LAYOUT, table=TABLE, settings="", override=None, events=None):
    folder = folder / "config"
    (folder / "layouts").mkdir(parents=True)
    (folder / "layouts" / "main.yaml").write_text(layout)
    (folder / "turnouts.tsv").write_text(table)
    (folder / "config.yaml").write_text(settings)
    if override:
        (folder / "overrides").mkdir()
        (folder / "overrides" / override[0]).write_text(override[1])
    if events:
        (folder / "events.csv").write_text(events)
    return load_configuration(folder, FORMATS, to_si)


def row(text):
    return {"table": TABLE + text + "\n"}


def layout(old, new):
    assert old in LAYOUT
    return {"layout": LAYOUT.replace(old, new)}


WRONG = {
    "id with a space": (
        row("t 3\tmain"),
        "config/turnouts.tsv, line 4, column 1: turnout is 't 3'. Write 1 to 64",
    ),
    "duplicate id": (row("t1\tmain"), "line 4, column 1: turnout 't1' for the second time. Give it another id"),
    "no id": (row("\tmain"), "line 4, column 1: turnout is empty. Write id"),
    "unknown layout": (row("t3\tmian"), "line 4, column 4: no layout 'mian'. Did you mean 'main'?"),
    "number that is none": (row("t3\tmain\t\t12,4"), "line 4, column 10: km is '12,4'. Write a number from 0 to 10000"),
    "rate of zero": (
        row("t3\tmain\t\t\t0"),
        "line 4, column 11: hammer_rate_hz is 0.0. Write a number from 250",
    ),
    "rate of the table in kHz": (
        row("t3\tmain\t\t\t51.2"),
        "hammer_rate_hz is 51.2. Write a number from 250 to 10,000,000 Hz",
    ),
    "rate of the table with digits too many": (
        row("t3\tmain\t\t\t51200000"),
        "hammer_rate_hz is 51200000.0. Write a number from 250 to 10,000,000 Hz",
    ),
    "rate with digits too many": (
        layout("rate: 20000", "rate: 20000000"),
        "line 9, column 9: rate is 20000000. Write a number from 250 to 10,000,000 Hz",
    ),
    "samples beyond any file": (
        layout("rate: 20000", "rate: 20000\n  samples: 10000000000000"),
        "samples is 10000000000000. Write a whole number from 1 to 10¹².",
    ),
    "rate in kHz": (
        layout("rate: 20000", "rate: 12.8"),
        "line 9, column 9: rate is 12.8. Write a number from 250 to 10,000,000 Hz",
    ),
    "rate of passages in kHz": (
        layout('  files: "passages/', '  rate: 51.2\n  files: "passages/'),
        "line 16, column 9: rate is 51.2. Write a number from 100 to 10,000,000 Hz",
    ),
    "limit in kN": (
        layout("source: force, ", "source: force, limit: 22, "),
        "line 13, column 35: limit is 22 N for the hammer's force, and receptance.minimum_peak_force is 50.0 N: no "
        "impact could count. Write the limit in N",
    ),
    "step as large as the limit": (
        layout("source: rail, ", "source: rail, limit: 500, resolution: 800, "),
        "line 14, column 50: resolution is 800, and limit is 500. Write one step of the converter",
    ),
    "limit beyond any sensor": (
        layout("source: rail, ", "source: rail, limit: 1e12, "),
        "limit is 10¹² m/s². No sensor of acceleration has it: write a number from 0.000001 to 2,000,000 m/s²",
    ),
    "step beyond any sensor": (
        layout("source: force, ", "source: force, resolution: 1e9, "),
        "resolution is 10⁹ N. No sensor of force has it: write a number above 0 and up to 10,000,000 N",
    ),
    "sensitivity in V for mV": (
        layout("sensitivity: 0.23, sensitivity_unit: mV/N", "sensitivity: 230, sensitivity_unit: V/N"),
        "sensitivity is 230 V/N, which is 230 V per N. No sensor of force has it",
    ),
    "sensitivity upside down": (
        layout("unit: m/s²", "unit: V, sensitivity: 1e9, sensitivity_unit: g/V"),
        "which is 1.02e-10 V per m/s². No sensor of acceleration has it",
    ),
    "number without end": (layout("rate: 20000", "rate: " + "9" * 400), "9 .... Write a number from 250"),
    "field of a pattern without its brace": (
        layout("{section}_{test}.{ext}", "{section}_{test.{ext}"),
        "a '{' without its pair, in '_{test.'. Write a pattern like hammer/",
    ),
    "too many cells": (row("t3\tmain\t\t\t\tx"), "line 4, column 12: 6 cells under 5 columns"),
    "raw folder outside": (row("t3\tmain\t../t3"), "line 4, column 9: raw is '../t3', outside the raw root"),
    "raw folder absolute": (row("t3\tmain\t/data/t3"), "column 9: raw is '/data/t3', outside the raw root"),
    "raw folder of another": (row("t3\tmain\tt1"), "line 4, column 9: raw folder 't1' is also that of turnout 't1'"),
    "unknown column": (
        {"table": TABLE.replace("km", "kilometre")},
        "line 1, column 20: unknown column 'kilometre'. Allowed:",
    ),
    "column twice": ({"table": TABLE.replace("km", "raw")}, "line 1, column 20: column 'raw' for the second time"),
    "spaces for tabs": (
        {"table": "turnout layout\nt1 main\n"},
        "line 1, column 1: blanks between the columns. Put tabs",
    ),
    "commas for tabs": (
        {"table": "turnout,layout\nt1,main\n"},
        "line 1, column 1: commas between the columns. Put tabs",
    ),
    "semicolons for tabs": (
        {"table": "turnout; layout;\nt1;main\n"},
        "semicolons between the columns. Put tabs between",
    ),
    "commas in a row": (row("t3,main,,1.5"), "line 4, column 1: commas between the columns. Put tabs between"),
    "unknown key": (
        layout("    position: 26.4", "    positoin: 26.4"),
        "config/layouts/main.yaml, line 6, column 5: unknown key 'positoin'. Did you mean 'position'?",
    ),
    "missing key": (layout("    track: main\n", ""), "line 4, column 5: 'track' is missing. Add 'track:'"),
    "key twice": (layout("  rate: 20000", "  rate: 20000\n  rate: 1"), "'rate' for the second time, first in line 9"),
    "text for a number": (layout("26.4", "26,4"), "line 6, column 15: position is '26,4'. Write a number from"),
    "unknown panel": (
        layout("    panel: CP", "    panel: CLB"),
        "line 4, column 12: panel is 'CLB'. Did you mean 'CLP'?",
    ),
    "unknown unit": (layout("unit: V", "unit: furlong"), "line 13, column 51: unit 'furlong' for the force of channel"),
    "unit of another quantity": (layout("mV/N", "mV/g"), "line 13, column 51: unit 'V' for the force of channel force"),
    "no sensitivity": (layout("sensitivity: 0.23, ", ""), "line 13, column 51: unit 'V' for the force"),
    "response that is no channel": (layout("response: rail", "response: rial"), "Did you mean 'rail'?"),
    "response that is the force": (layout("response: rail", "response: force"), "which measures force"),
    "response that is no acceleration": (
        layout("source: rail, quantity: acceleration, unit: m/s²", "source: rail, quantity: displacement, unit: mm"),
        "response is 'rail', which measures displacement. Name a channel of the quantity acceleration",
    ),
    "validation that is the response": (
        layout("response: rail", "response: rail\n  validation: rail"),
        "validation is 'rail', as response is. Name another channel, or null",
    ),
    "source below 0": (layout("source: rail", "source: -1"), "source is -1. Write a name, or a number counted from 0"),
    "source twice": (layout("source: rail", "source: force"), "reads 'force', as force does"),
    "unknown field": (layout("{section}_", "{sektion}_"), "unknown field {sektion} in the pattern. Did you mean"),
    "pattern without section": (layout("{section}_", ""), "line 8, column 10: files is"),
    "unknown section": (layout("section: A8}", "section: A9}"), "line 18, column 55: no section 'A9'"),
    "unknown time zone": (layout("rate: 20000", "time_zone: Denmark/Odense"), "Write an IANA name"),
    "unknown format": (layout("rate: 20000", "format: ufo"), "line 9, column 11: format is 'ufo'. Allowed: auto, csv"),
    "absolute pattern": (
        layout('"hammer/', '"/hammer/'),
        "line 8, column 10: files is '/hammer/{campaign}/{section}_{test}.{ext}': it is a path below the raw folder",
    ),
    "pattern that leaves the folder": (layout('"passages/', '"../passages/'), "without '..'. Write a pattern like"),
    "pattern of Windows": (layout("passages/{time}", "passages\\\\{time}"), "with '/' between folders"),
    "unit in other capitals": (layout("unit: V", "unit: kn"), "the unit 'kn' is not known (did you mean 'kN'?)"),
    "channel of no section": (
        layout(", section: A8}", "}"),
        "line 18, column 10: 'section' is missing. Add 'section:', one of A7, A8",
    ),
    "sections without a line": (
        {"layout": "sections:\n" + LAYOUT[LAYOUT.index("hammer:") :]},
        "main.yaml, line 1, column 1: 'sections' is empty. Add at least one",
    ),
    "no colon": (
        layout("  rate: 20000", "  rate 20000"),
        "line 9, column 3: a name without ':' behind it. Write 'name: value'",
    ),
    "blanks too many": (
        layout("  force: force", "    force: force"),
        "line 10, column 10: a second ':' in one value, or more blanks in front of it than the line above has",
    ),
    "blanks too many in front of names": (
        layout("  rate: 20000", "   rate: 20000"),
        "line 9, column 4: its indentation is not that of the lines above. Begin all lines of a block with",
    ),
    "two documents": ({"settings": "trend: {}\n---\ntrend: {}\n"}, "line 2, column 1: a second document begins"),
    "list for names": ({"settings": "- trend\n"}, "a list where names with values are expected. Write 'name: value'"),
    "YAML that is none": (layout("    panel: CP", "    panel: [CP"), "Correct the YAML syntax there"),
    "unknown setting": (
        {"settings": "receptance:\n  gate_levle: 0.9\n"},
        "config/config.yaml, line 2, column 3: unknown key 'gate_levle'. Did you mean 'gate_level'?",
    ),
    "setting beyond its limits": (
        {"settings": "receptance: {gate_level: 1.5}"},
        "line 1, column 26: gate_level is 1.5. Write a number from 0",
    ),
    "flag that is none": ({"settings": "receptance: {force_window: 2}"}, "Write true or false"),
    "override without a turnout": (
        {"override": ("t9.yaml", "hammer: {rate: 1}")},
        "config/overrides/t9.yaml, line 1, column 1: an override without a turnout 't9'. Allowed: t1, t2",
    ),
    "override of an unknown key": (
        {"override": ("t1.yaml", "hammer:\n  channels:\n    rail: {sing: -1}\n")},
        "config/overrides/t1.yaml, line 3, column 12: unknown key 'sing'. Did you mean 'sign'?",
    ),
    "override with half a section": (
        {"override": ("t1.yaml", "sections:\n  B1: {panel: CP, position: 3}\n")},
        "config/overrides/t1.yaml, line 2, column 7: 'track' is missing",
    ),
    "event of no turnout": (
        {"events": "turnout,section,date,kind\n,,2025-01-01,tamping\n"},
        "line 2, column 1: turnout is empty. Write the id of the turnout",
    ),
    "event on no day": ({"events": "turnout,section,date,kind\nt1,,1.1.2025,tamping\n"}, "Write YYYY-MM-DD"),
    "event of no kind": ({"events": "turnout,section,date,kind\nt1,,2025-01-01,taming\n"}, "Did you mean 'tamping'?"),
    "events between semicolons": (
        {"events": "turnout;section;date;kind\nt1;;2025-01-01;tamping\n"},
        "line 1, column 1: semicolons between the columns. Put commas between the columns, and a point before "
        "decimals, or 'sep=;' in a line above the header",
    ),
    "event with a comma": (
        {"events": "turnout,section,date,kind,resets,note\nt1,,2025-01-01,tamping,,by machine, twice\n"},
        "more cells than columns. Put a text with commas in double quotes; a number has a decimal point",
    ),
    "trend of one turnout": (
        {"override": ("t1.yaml", "settings:\n  trend:\n    target_percent: 0.5\n")},
        "config/overrides/t1.yaml, line 2, column 3: 'trend' holds for the whole fleet and would be ignored here. "
        "It belongs into config.yaml: move it there.",
    ),
    "shards of one layout": (
        layout("hammer:\n", "settings: {fleet: {shards: 8}}\nhammer:\n"),
        "config/layouts/main.yaml, line 7, column 12: 'fleet' holds for the whole fleet",
    ),
    "clusters of one turnout": (
        {"override": ("t1.yaml", "settings: {passage: {cluster_maximum: 3}}")},
        "config/overrides/t1.yaml, line 1, column 22: 'cluster_maximum' holds for the whole fleet",
    ),
    "unknown part of one turnout": (
        {"override": ("t1.yaml", "settings: {trends: {}}")},
        "unknown key 'trends'. Allowed: identify, mismatch, passage, receptance, simulate.",
    ),
    "override that is not read": (
        {"override": ("t1.yml", "hammer: {rate: 1}")},
        "config/overrides/t1.yml, line 1, column 1: it ends in .yml and would not be read. Rename it to t1.yaml",
    ),
    "trends that no alarm can follow": (
        {"settings": "trend: {single_share: 0}"},
        "config/config.yaml, line 1, column 23: single_share is 0. Write a number from 0.1 to 1",
    ),
    "range upside down": (
        {"settings": "identify:\n  ballast_low: 400\n  ballast_high: 300\n"},
        "config/config.yaml, line 2, column 16: identify.ballast_low is 400, and ballast_high is 300 in "
        "config/config.yaml, line 3, column 17. Write a ballast_low below ballast_high.",
    ),
    "range upside down with a default": (
        {"settings": "passage: {speed_maximum: 12}"},
        "line 1, column 26: passage.speed_minimum is 15.0, and speed_maximum is 12. Write",
    ),
    "range upside down for one turnout": (
        {
            "settings": "receptance: {agreement_high: 500}",
            "override": ("t1.yaml", "settings: {receptance: {agreement_low: 600}}"),
        },
        "config/overrides/t1.yaml, line 1, column 40: receptance.agreement_low is 600, and agreement_high is 500 in "
        "config/config.yaml, line 1, column 30",
    ),
    "bands that overlap": (
        {"settings": "identify: {ballast_high: 600}"},
        "line 1, column 26: identify.ballast_high is 600, and railpad_low is 300.0. Write a ballast_high "
        "below railpad_low",
    ),
    "bands that are no pairs": (
        {"settings": "identify: {extra_bands: [900, 1100, 1200]}"},
        "line 1, column 25: extra_bands is [900, 1100, 1200]. Write pairs",
    ),
    "anchor within itself": (
        {"settings": "trend: &a\n  target_percent: *a\n"},
        "config/config.yaml, line 1, column 8: it contains itself. Write out what the alias stands for",
    ),
}


def test_settings_whose_lines_are_all_comments_are_empty(tmp_path, capsys):
    read = configuration(
        tmp_path, settings="receptance:\n  # gate_level: 0.9\ntrend:\n", override=("t1.yaml", "hammer:\n")
    )
    assert read.turnout("t1").settings == read.turnout("t2").settings
    (read.folder / "config.yaml").write_text("receptance:\nidentify: {duration: 0.04}\n")
    assert main(["config", "generate", "--configuration", str(read.folder), "--docs", str(tmp_path / "no")]) == 0
    assert "\n  duration: 0.04\n" in (read.folder / "config.yaml").read_text()


def test_a_channel_of_a_passage_that_is_ignored_needs_no_section(tmp_path, capsys):
    ignored = f"{LAYOUT}    rain: {{source: 1, quantity: ignored}}\n"
    passages = configuration(tmp_path, layout=ignored).turnout("t1").passages
    assert [(c.name, c.position) for c in passages.description.channels] == [("web", 26.4), ("rain", None)]
    assert dict(passages.sections) == {"web": "A8"}


def test_a_byte_that_is_not_utf_8_is_reported_with_line_and_column(tmp_path):
    folder = configuration(tmp_path).folder
    (folder / "config.yaml").write_bytes(b"trend: {}\n# m/s\xb2\n")
    with pytest.raises(ConfigErrors, match=r"config\.yaml, line 2, column 6: a byte that is not UTF-8"):
        load_configuration(folder)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["add", "t3", "main", "--km", "3,4"], "turnouts.tsv, the new row, which was not written: km is '3,4'. Write"),
        (["add", "t3", "mian"], "turnouts.tsv, the new row, which was not written: no layout 'mian'. Did you mean"),
        (["events", "t1", "tampping", "2026-05-01"], "the new row, which was not written: kind is 'tampping'. Did you"),
        (["add", "t1", "main"], "turnouts.tsv, line 2: there is a turnout 't1' already"),
    ],
)
def test_an_error_of_a_new_row_states_no_line_that_the_table_lacks(tmp_path, capsys, words, message):
    assert main([*words, "--configuration", str(configuration(tmp_path).folder)]) == 2
    assert message in capsys.readouterr().err


def test_every_error_of_an_event_is_reported_with_its_cell(tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, events='turnout,section,date,kind,resets\n"t1",B1,1.1.2025,taming,ballst\n')
    places = [(e.place, e.problem.split(" is ")[0]) for e in caught.value.errors]
    assert places == [
        ("line 2, column 9", "date"), ("line 2, column 18", "kind"), ("line 2, column 25", "resets"),
    ]  # fmt: skip


def test_different_spellings_of_one_raw_folder_are_the_same_folder(tmp_path):
    path = tmp_path / "turnouts.tsv"
    spelt = {
        "T1": "line_7/T1",
        "T2": "line_7/T1/",
        "T3": "./line_7/T1",
        "T4": "line_7//T1",
        "T5": "line_7/./T5/",
        "T6": "",
    }
    path.write_text("turnout\tlayout\traw\n" + "".join(f"{t}\tmain\t{raw}\n" for t, raw in spelt.items()))
    rows, errors = read_table(path, "turnouts.tsv")
    assert [(row.id, row.raw) for row in rows] == [("T1", "line_7/T1"), ("T5", "line_7/T5"), ("T6", "T6")]
    assert [str(e).split(". ")[0] for e in errors] == [
        f"turnouts.tsv, line {n}, column 9: raw folder 'line_7/T1' is also that of turnout 'T1'" for n in (3, 4, 5)
    ]


HEADER = "turnout,section,date,kind\n"


@pytest.mark.parametrize(
    ("former", "present"), [("softest_blow", "minimum_peak_force"), ("weakest_blow", "minimum_peak_share")]
)
def test_the_error_of_a_renamed_setting_states_its_present_name(tmp_path, former, present):
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, settings=f"receptance: {{{former}: 0.1}}")
    assert f"unknown key {former!r}. It is called {present!r} now." in str(caught.value)


def test_every_renamed_setting_has_a_key_that_exists():
    keys = {name for group in settings_keys().values() for name in group.spec}
    assert FORMER_KEYS.keys().isdisjoint(keys) and set(FORMER_KEYS.values()) <= keys


def test_the_limit_of_a_small_hammer_may_be_below_the_least_force_of_a_large_one(tmp_path):
    small = LAYOUT.replace("source: force, ", "source: force, limit: 22, ")
    assert configuration(tmp_path, layout=small, settings="receptance: {minimum_peak_force: 0}").ids == ("t1", "t2")


def test_a_unit_that_overrides_the_file_is_checked_without_its_exclamation_mark(tmp_path):
    """The reader proposes ``unit: N!`` where file and layout differ."""
    overridden = LAYOUT.replace("unit: V, sensitivity: 0.23, sensitivity_unit: mV/N", "unit: N!")
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    assert overridden != LAYOUT and configuration(tmp_path / "a", layout=overridden).ids == ("t1", "t2")
    with pytest.raises(ConfigErrors, match="'furlong!'"):
        configuration(tmp_path / "b", layout=overridden.replace("N!", "furlong!"))


def test_a_pattern_matches_names_with_composed_umlauts():
    """A Mac writes an umlaut as a letter and a combining mark; names are composed before they are compared."""
    decomposed = "hammer/{campaign}/Pru\u0308fung_{section}_{test}.{ext}"
    assert compile_pattern(decomposed, "hammer", ("A7",)).fullmatch("hammer/2024-05-13/Pr\u00fcfung_A7_1.uff")


def test_an_event_far_in_the_future_is_reported_and_planned_maintenance_is_no_fault(tmp_path, capsys):
    today = datetime.now(UTC).date()
    soon, tomorrow = today + timedelta(days=40), today + timedelta(days=1)
    events = f"{HEADER}t1,,{tomorrow},tamping\nt2,A8,{soon},grinding\n"
    read = configuration(tmp_path, events=events)
    assert read.warnings == ()
    folder = ["--configuration", str(read.folder)]
    assert main(["check", *folder]) == 0
    messages = capsys.readouterr().out
    assert (
        f"planned, counts from its day: grinding at t2/A8, {soon} (events.csv)" in messages
        and str(tomorrow) not in messages
    )
    (read.folder / "events.csv").write_text(f"{events}t1,A7,2205-04-02,tamping\n")
    assert main(["check", *folder]) == 1
    messages = capsys.readouterr().out
    assert (
        "does not count: config/events.csv, line 4, column 7: date 2205-04-02 is more than a year ahead. Correct"
        in messages
    )
    assert (
        "planned, counts from its day: grinding at t2/A8" in messages
        and "planned, counts from its day: tamping" not in messages
    )


def test_the_error_states_how_to_add_a_turnout_if_there_is_none(tmp_path, capsys):
    read = configuration(tmp_path, table="turnout\tlayout\n", events=f"{HEADER}t1,,2025-01-01,tamping\n")
    (warning,) = map(str, read.warnings)
    none = "There are no turnouts yet: add one with 'turnout add ID LAYOUT'."
    assert warning.endswith(f"turnout 't1' has no row in turnouts.tsv. {none}")
    with pytest.raises(ConfigError, match=none):
        read.turnout("t1")
    with pytest.raises(ConfigErrors, match=r"no layout 'main'\. There are no layouts yet: write layouts/main\.yaml"):
        (read.folder / "layouts" / "main.yaml").unlink()
        (read.folder / "turnouts.tsv").write_text(TABLE)
        load_configuration(read.folder)


def test_add_reports_a_table_without_tabs(tmp_path, capsys):
    folder = configuration(tmp_path).folder
    (folder / "turnouts.tsv").write_text("turnout;layout\n")
    assert main(["add", "t9", "main", "--configuration", str(folder)]) == 2
    assert "turnouts.tsv, line 1, column 1: semicolons between the columns. Put tabs between" in capsys.readouterr().err


def test_an_event_of_a_turnout_without_a_row_is_reported_and_stops_no_run(tmp_path, capsys):
    """The turnout was removed or is misspelt: the event stays in the history, and the fleet is computed."""
    events = "turnout,section,date,kind\nt2,,2025-01-01,tamping\nt7,A8,2025-02-01,grinding\n"
    read = configuration(tmp_path, events=events)
    assert [(e.turnout, e.kind) for e in read.events] == [("t2", "tamping"), ("t7", "grinding")]
    (warning,) = [str(w) for w in read.warnings]
    assert "events.csv, line 3, column 1: turnout 't7' has no row in turnouts.tsv. Allowed: t1, t2" in warning
    folder = ["--configuration", str(read.folder)]
    assert main(["check", *folder]) == 1
    assert "events.csv, line 3, column 1: turnout 't7' has no row" in capsys.readouterr().out
    before = (read.folder / "events.csv").read_bytes()
    assert main(["events", "t7", "tamping", "2025-03-01", *folder]) == 2
    assert "turnout 't7' has no row in turnouts.tsv" in capsys.readouterr().err
    assert (read.folder / "events.csv").read_bytes() == before
    with pytest.raises(ConfigErrors, match="Did you mean 'tamping'"):  # any other fault in such a row is an error
        configuration(tmp_path / "other", events=events.replace("grinding", "tampin"))


def test_an_event_of_a_section_that_the_layout_no_longer_has_is_reported_and_stops_no_run(tmp_path, capsys):
    read = configuration(tmp_path, events="turnout,section,date,kind\nt1,B1,2025-01-01,tamping\n")
    assert [(e.turnout, e.section, e.kind) for e in read.events] == [("t1", "B1", "tamping")]
    (warning,) = map(str, read.warnings)
    assert warning.startswith("config/events.csv, line 2, column 4: turnout 't1' has no section 'B1'")
    folder = ["--configuration", str(read.folder)]
    assert main(["events", "t1/B1", "tamping", "2025-03-01", *folder]) == 2  # a new event of such a section is an error
    assert "no section 'B1'" in capsys.readouterr().err


def test_a_faulty_turnouts_table_causes_no_error_of_an_event(tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        events = "turnout,section,date,kind\nt1,,2025-01-01,tamping\nt2,,2025-01-01,taming\n"
        configuration(tmp_path, table="turnout\tlayuot\nt1\tmain\n", events=events)
    messages = [str(e) for e in caught.value.errors]
    assert not [s for s in messages if "has no row" in s] and [s for s in messages if "events.csv, line 3" in s]


@pytest.mark.parametrize(
    ("row", "column", "found"),
    [
        ("2025-01-10,2025-01-10T10:00,warm", 29, "rail_temperature_c is 'warm'. Write a number from -50 to 80 °C"),
        ('2025-01-10,2025-01-10T10:00,"3,5"', 29, "Write a number from -50 to 80 °C, with a decimal point: 3.5, or"),
        ("2025-01-10,2025-01-10T10:00,nan", 29, "rail_temperature_c is 'nan'"),
        ("10.1.2025,2025-01-10T10:00,3", 1, "campaign is '10.1.2025'. Write YYYY-MM-DD"),
        ("2025-02-30,2025-01-10T10:00,3", 1, "campaign is '2025-02-30', which is no day of the calendar. Write a day"),
        ("2025-01-10,2025-13-10T10:00,3", 12, "started_at_utc is '2025-13-10T10:00', which is no day of the calendar"),
        ("2025-01-10,ten,3", 12, "started_at_utc is 'ten'. Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC"),
        ("2025-01-10,2025-03-10T10:00,3", 12, "is not on the campaign's day 2025-01-10"),
    ],
)
def test_a_wrong_campaign_is_reported_with_column_value_and_remedy(tmp_path, row, column, found):
    path = tmp_path / "campaigns.csv"
    path.write_text(f"campaign,started_at_utc,rail_temperature_c\n2025-01-03,2025-01-03T10:00,\n{row}\n", "utf-8")
    campaigns, errors = read_campaigns(path, "t1/campaigns.csv")
    assert list(campaigns) == ["2025-01-03", *["2025-01-10"] * (column > 1)] and len(errors) == 1
    assert f"t1/campaigns.csv, line 3, column {column}: " in str(errors[0]) and found in str(errors[0])


def test_a_cell_of_a_campaign_that_cannot_be_used_counts_as_empty_and_the_others_count(tmp_path):
    path = tmp_path / "campaigns.csv"
    rows = "2025-01-10,2025-01-10T10:00,warm,H2,soft,AB\n2025-01-11,ten,3.5,H2,,\n2025-01-12,eleven,cold,H3,,\n"
    path.write_text(f"campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator\n{rows}")
    campaigns, errors = read_campaigns(path, "t1/campaigns.csv")
    assert [(c.started_at.hour, c.rail_temperature, c.hammer_id) for c in campaigns.values()] == [
        (10, None, "H2"), (12, 3.5, "H2"), (12, None, "H3")
    ]  # fmt: skip
    assert (campaigns["2025-01-10"].tip, campaigns["2025-01-10"].operator) == ("soft", "AB")
    places = [str(error).split(": ")[0] for error in errors]
    assert places == [f"t1/campaigns.csv, line {n}, column {c}" for n, c in ((2, 29), (3, 12), (4, 12), (4, 19))]


@pytest.mark.parametrize(
    ("written", "instead", "words"),
    [
        (
            "position: 24.6",
            "position: 24600",
            "position is 24600. Write a number from -10000 to 10000 m (24600 mm are 24.6 m)",
        ),
        ("position: 24.6", "position: 24,6", "unknown key '6'. If it belongs to the number before it, write a point"),
        ("rate: 20000", "rate: 25.6", "rate is 25.6. Write a number from 250 to 10,000,000 Hz (25.6 kHz are 25600 Hz)"),
        ("rate: 20000", "rate: 1e9", "rate is 1000000000.0. Write a number from 250 to 10,000,000 Hz."),
        ("rate: 20000", "rate: -5", "rate is -5. Write a number from 250 to 10,000,000 Hz."),
    ],
)
def test_a_number_in_another_unit_is_recognised(tmp_path, written, instead, words):
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, layout=LAYOUT.replace(written, instead, 1))
    assert words in str(caught.value)


def test_a_share_in_percent_is_recognised(tmp_path):
    with pytest.raises(ConfigErrors, match=r"gate_level is 90. Write a number from 0 to 0.999 \(90 % are 0.9\)"):
        configuration(tmp_path, settings="receptance: {gate_level: 90}")


@pytest.mark.parametrize(
    "key, value, words",
    [
        ("webhook", "chat.example.org/hooks/abc", "an address that begins with https:// (or http://)"),
        ("webhook", "ftp://example.org", "an address that begins with https:// (or http://)"),
        ("webhook", "https://", "an address that begins with https:// (or http://)"),
        ("recipients", "a@b.c; d@e.f", "name@host, several with commas between"),
        ("sender", "a@b.c, d@e.f", "name@host or Name <name@host>"),
    ],
)
def test_an_address_to_which_the_nightly_run_cannot_send_is_an_error(key, value, words, tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, settings=f"alerts: {{{key}: '{value}'}}")
    assert f"{key} is {value!r}. Write {words}" in str(caught.value)


@pytest.mark.parametrize(
    "key, value",
    [
        ("webhook", "https://chat.example.org/hooks/abc?x=1"),
        ("webhook", "http://127.0.0.1:8080/"),
        ("webhook", ""),
        ("recipients", "a@b.c, Track team <d@e.f>"),
        ("recipients", "root"),
        ("sender", "Turnout <a@b.c>"),
    ],
)
def test_an_address_that_the_nightly_run_can_use_is_accepted(key, value, tmp_path):
    assert configuration(tmp_path, settings=f"alerts: {{{key}: '{value}'}}").settings["alerts"] is not None


@pytest.mark.parametrize("kind", WRONG)
def test_each_error_states_its_place_and_the_remedy(tmp_path, kind):
    changes, words = WRONG[kind]
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, **changes)
    assert words in str(caught.value)
    assert len(caught.value.errors) == 1, str(caught.value)


def test_all_errors_are_reported_together(tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        configuration(
            tmp_path, layout=LAYOUT.replace("panel: CP", "panle: CP"), table=TABLE + "t1\tmain\n",
            settings="receptance: {gate: soft}",
        )  # fmt: skip
    files = {error.path for error in caught.value.errors}
    assert files == {"config/layouts/main.yaml", "config/turnouts.tsv", "config/config.yaml"}
    assert len(caught.value.errors) == 2 + 1 + 1  # the layout's two sections, the row, the setting


def test_a_correct_configuration_is_accepted(tmp_path):
    assert configuration(tmp_path).ids == ("t1", "t2")


def test_a_tag_that_would_make_an_object_is_an_error_with_its_place(tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        configuration(tmp_path, layout=LAYOUT.replace("position: 26.4", "position: !!python/object:os.system 1"))
    assert "line 6, column 15" in str(caught.value) and "without a tag" in str(caught.value)


def test_a_folder_in_place_of_an_override_is_an_error(tmp_path):
    (tmp_path / "config/overrides/t1.yaml").mkdir(parents=True)
    with pytest.raises(ConfigErrors) as caught:
        (tmp_path / "config/layouts").mkdir()
        (tmp_path / "config/layouts/main.yaml").write_text(LAYOUT)
        (tmp_path / "config/turnouts.tsv").write_text(TABLE)
        load_configuration(tmp_path / "config", FORMATS, to_si)
    assert "config/overrides/t1.yaml, line 1: cannot be read: Is a directory" in str(caught.value)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["demo", "--campaigns", "0"], "--campaigns, number: 0"),
        (["check", "--raw", "nothere"], "nothere, --raw: no such folder"),
    ],
)
def test_a_wrong_option_is_reported(repository, monkeypatch, capsys, command, words):
    from turnout.cli.main import main

    monkeypatch.chdir(repository)
    assert main(command) == 2 and words in capsys.readouterr().err


@pytest.mark.parametrize("parts", [("config.yml",), ("layouts", "other.yml"), ("layouts", "other.YAML")])
def test_a_file_that_would_not_be_read_is_an_error(tmp_path, parts):
    configuration(tmp_path)
    tmp_path.joinpath("config", *parts).write_text(LAYOUT)
    with pytest.raises(ConfigErrors, match=rf"config/{'/'.join(parts)}, line 1, column 1: it ends in \.[yY]"):
        load_configuration(tmp_path / "config", FORMATS, to_si)


def test_the_schema_of_a_layout_has_no_settings_of_the_whole_fleet(repository):
    import json

    schema = json.loads((repository / "config/schema/override.json").read_text())
    settings = schema["properties"]["settings"]["properties"]
    assert "receptance" in settings and not {"alerts", "trend", "fleet"} & set(settings)
    assert "cluster_seed" not in settings["passage"]["properties"]
