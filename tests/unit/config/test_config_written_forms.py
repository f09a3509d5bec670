"""What people and spreadsheets write: other forms of a right value are read, and what only Python reads is an error."""

import pytest

from turnout.cli.option_types import finite_number, whole_number
from turnout.config import load_configuration
from turnout.config.campaign_notes import read_campaigns
from turnout.config.parameter_files import read_parameters
from turnout.config.settings_schema import settings_keys
from turnout.config.table_edits import added_row
from turnout.config.turnouts_table import ROW, read_table
from turnout.errors import ConfigError, ConfigErrors
from turnout.units import parameter_unit

LAYOUT = """\
sections:
  A7: {panel: CP, track: main, position: 24.6}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  rate: 20000
  records: 10
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: N}
    rail: {source: rail, quantity: acceleration, unit: m/s², sign: -1, serial: "007"}
"""
TABLE = "turnout\tlayout\tname\tkm\nt1\tmain\tSwitch 1\t12.5\nt2\tmain\t\t\n"
EVENTS = "turnout,section,date,kind\nt1,A7,2025-03-01T10:30,tamping\n"


def project(folder, layout=LAYOUT, table=TABLE, events=EVENTS, settings="", overrides=()):
    for name, content in (("layouts/main.yaml", layout), ("turnouts.tsv", table), ("events.csv", events),
                          ("config.yaml", settings), *overrides):  # fmt: skip
        path = folder / "config" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / "config"


def plain(configuration):
    """Everything that a run uses of a configuration."""
    turnouts = [configuration.turnout(name) for name in configuration.ids]
    hammer = [(t.id, t.hammer.descriptions["A7"], t.sections, t.settings) for t in turnouts]
    rows = [dict(row.values) for row in configuration.rows.values()]
    return repr((hammer, rows, configuration.events))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("24.6", '"24.6"'),
        ("24.6", "2.46e1"),
        ("24.6", "'+24.60'"),
        ("rate: 20000", "rate: 2e4"),
        ("rate: 20000", 'rate: "20000"'),
        ("records: 10", "records: 10.0"),
        ("records: 10", "records: 1e1"),
        ("records: 10", "records: '10'"),
        ("sign: -1", 'sign: "-1"'),
        ("sign: -1", "sign: -1.0"),
        ('"007"', "007"),
    ],
)
def test_another_form_of_a_right_value_is_read(tmp_path, old, new):
    assert old in LAYOUT
    expected = plain(load_configuration(project(tmp_path / "a")))
    assert plain(load_configuration(project(tmp_path / "b", LAYOUT.replace(old, new)))) == expected


@pytest.mark.parametrize("text", ["24_6", "0x18", "0o30", "'24_6'", "'٢٤'", "24:6", "true", ".nan"])
def test_a_notation_that_only_programs_know_is_no_number(tmp_path, text):
    with pytest.raises(ConfigErrors, match=r"main.yaml, line 2, column 42: position is .*Write a number from -10000"):
        load_configuration(project(tmp_path, LAYOUT.replace("24.6", text)))


def test_a_quoted_setting_is_a_number_and_a_whole_one_stays_whole(tmp_path):
    settings = 'identify: {duration: "0.04", order_maximum: 12.0}\n'
    identify = load_configuration(project(tmp_path, settings=settings)).turnout("t1").settings["identify"]
    assert (identify.duration, identify.order_maximum) == (0.04, 12) and isinstance(identify.order_maximum, int)
    with pytest.raises(ConfigErrors, match=r"order_maximum is 12.5. Write a whole number"):
        load_configuration(project(tmp_path / "b", settings="identify: {order_maximum: 12.5}\n"))
    assert settings_keys()["identify"].spec["hum_sources"].minimum == 1.0


FORMS_OF_TABLES = {
    "comments": lambda t: "# first\n" + t.replace("\n", "\n  # between\n", 1) + "# last\n",
    "empty rows of a spreadsheet": lambda t: t + "\n\t\t\t\n" + '""\t""\n',
    "CR LF": lambda t: t.replace("\n", "\r\n"),
    "CR": lambda t: t.replace("\n", "\r"),
    "byte-order mark": lambda t: "\ufeff" + t,
    "empty columns on the right": lambda t: t.replace("\n", "\t\t\n"),
    "all cells in quotes": lambda t: "".join(
        "\t".join(f'"{cell}"' for cell in line.split("\t")) + "\n" for line in t.splitlines()
    ),
}


@pytest.mark.parametrize("form", FORMS_OF_TABLES)
def test_a_table_as_spreadsheets_write_it_has_the_same_rows(tmp_path, form):
    change = FORMS_OF_TABLES[form]
    expected = plain(load_configuration(project(tmp_path / "a")))
    events = change(EVENTS.replace(",", "\t")).replace("\t", ",")
    found = load_configuration(project(tmp_path / "b", table=change(TABLE), events=events))
    assert plain(found) == expected


@pytest.mark.parametrize(
    ("cell", "name"),
    [('"Tommerup, switch 3"', "Tommerup, switch 3"), ('"Switch ""old"" 1"', 'Switch "old" 1'), ('"N" 3', '"N" 3'),
     ("12", "12"), ("Süd\u20281", "Süd\u20281")],
)  # fmt: skip
def test_quotes_of_a_spreadsheet_are_no_part_of_a_name(tmp_path, cell, name):
    rows, errors = read_table(project(tmp_path, table=TABLE.replace("Switch 1", cell)) / "turnouts.tsv", "t.tsv")
    assert (rows[0].values["name"], len(rows), errors) == (name, 2, [])
    assert str(rows[0].place("km")) == f"line 2, column {10 + len(cell)}"


def test_a_row_can_be_added_to_a_table_with_comments_and_quotes(tmp_path):
    folder = project(tmp_path, table='# of 2026\n"turnout"\t"layout"\t"name"\t"km"\t\t\n"t1"\t"main"\t\t\n')
    with added_row(folder / "turnouts.tsv", {"turnout": "t3", "layout": "main", "km": "3"}, tuple(ROW)) as tables:
        load_configuration(folder, tables=tables)
    assert [(r.id, r.values.get("km")) for r in read_table(folder / "turnouts.tsv", "t")[0]] == [
        ("t1", None),
        ("t3", 3),
    ]


@pytest.mark.parametrize("cell", ["1_2.5", "١٢", "0x1", "inf", "12,5"])
def test_a_cell_with_another_notation_is_no_number(tmp_path, cell):
    rows, (error,) = read_table(project(tmp_path, table=TABLE.replace("12.5", cell)) / "turnouts.tsv", "t.tsv")
    assert [row.id for row in rows] == ["t2"] and "km is" in str(error) and "line 2, column 18" in str(error)
    (tmp_path / "c.csv").write_text(
        f'campaign,started_at_utc,rail_temperature_c\n2026-05-13,2026-05-13,"{cell}"\n2026-06-13,2026-06-13,15\n'
    )
    campaigns, (error,) = read_campaigns(tmp_path / "c.csv", "c.csv")
    temperatures = {date: campaign.rail_temperature for date, campaign in campaigns.items()}
    assert temperatures == {"2026-05-13": None, "2026-06-13": 15.0} and "rail_temperature_c is" in str(error)


def test_an_option_with_another_notation_is_no_number():
    for convert, texts in ((finite_number, ("1_5", "١٥", "0x1")), (whole_number, ("1_0", "٣", "1.0"))):
        for text in texts:
            with pytest.raises(Exception, match="is not a"):
                convert(text)
    assert (finite_number("-1.5e1"), whole_number("+3")) == (-15.0, 3)


def test_the_time_of_greenwich_is_utc(tmp_path):
    expected = plain(load_configuration(project(tmp_path / "a")))
    for n, time in enumerate(("2025-03-01T10:30Z", "2025-03-01T10:30+00:00")):
        events = EVENTS.replace("2025-03-01T10:30", time)
        assert plain(load_configuration(project(tmp_path / str(n), events=events))) == expected
    with pytest.raises(ConfigErrors, match="with a time zone"):
        load_configuration(project(tmp_path / "c", events=EVENTS.replace("10:30", "10:30+01:00")))


def test_an_error_of_the_table_leads_to_no_error_of_the_overrides(tmp_path):
    overrides = [("overrides/t1.yaml", "hammer: {rate: 10000}\n")]
    for n, table in enumerate(("Turnout\tlayout\nt1\tmain\n", TABLE.replace("12.5", "12,5"), "t1\tmain\n")):
        with pytest.raises(ConfigErrors) as caught:
            load_configuration(project(tmp_path / str(n), table=table, overrides=overrides, events=""))
        assert "override" not in str(caught.value)
    with pytest.raises(ConfigErrors, match=r"an override without a turnout 't9'"):
        load_configuration(project(tmp_path / "b", overrides=[("overrides/t9.yaml", "hammer: {rate: 10000}\n")]))


def test_a_table_without_its_header_has_one_error(tmp_path):
    rows, (error,) = read_table(project(tmp_path, table="t1\tmain\t\t12.5\n") / "turnouts.tsv", "t.tsv")
    assert rows == [] and "line 1, column 1: a header without a known column: 't1', 'main'" in str(error)


# Unit as people type it -> SI unit and factor, from the definition of the prefixes.
UNITS = {
    "kN/mm": ("N/m", 1e6), "kN/m": ("N/m", 1e3), "MPa": ("Pa", 1e6), "N/mm²": ("Pa", 1e6), "N/mm2": ("Pa", 1e6),
    "cm": ("m", 1e-2), "mm^4": ("m⁴", 1e-12), "cm4": ("m⁴", 1e-8), "mm2": ("m²", 1e-6), "kg/m^3": ("kg/m³", 1.0),
    "kNs/m": ("N s/m", 1e3), "kN·s/m": ("N s/m", 1e3), "kN*s/m": ("N s/m", 1e3), "kg m2": ("kg m²", 1.0),
    "GN/m^1.5": ("N/m^1.5", 1e9),
}  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
def test_units_of_parameter_files_may_be_typed(tmp_path, unit):
    assert parameter_unit(unit) == UNITS[unit]
    (tmp_path / "p.yaml").write_text(f'a: {{value: 3e0, unit: "{unit}", source: x}}\n')
    assert read_parameters(tmp_path / "p.yaml").number("a", UNITS[unit][0]) == pytest.approx(3.0 * UNITS[unit][1])


@pytest.mark.parametrize("unit", ["mN/m", "m^5", "m22", "kNm", "Ns"])
def test_another_unit_stays_unknown(unit):
    assert parameter_unit(unit) is None


@pytest.mark.parametrize("value", ["true", "1_0.6", '"1_0.6"', "0x10", ".nan", "null", "[1]"])
def test_a_parameter_in_another_notation_is_no_number(tmp_path, value):
    (tmp_path / "p.yaml").write_text(f"a:\n  {{value: {value}, unit: m, source: x}}\n")
    with pytest.raises(ConfigError, match=r"line 1, a: .* is not (a number|finite)"):
        read_parameters(tmp_path / "p.yaml")
