"""An error in the configuration of one turnout leaves that turnout out of the nightly run, and no other."""

import pytest
from tests.unit.config.one_section import LAYOUT

from turnout.config import load_configuration
from turnout.errors import ConfigError, ConfigErrors
from turnout.readers.formats import FORMATS
from turnout.units import to_si

TABLE = "turnout\tlayout\tkm\thammer_rate_hz\nt1\tmain\t1.5\t\nt2\tmain\t2\t\nt3\tother\t3\t\n"
EVENTS = "turnout,section,date,kind,resets\nt1,A7,2026-04-02,tamping,\n"


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "config"
    for name in ("layouts", "overrides", "tracks"):
        (folder / name).mkdir(parents=True)
    for name in ("main", "other"):
        (folder / "layouts" / f"{name}.yaml").write_text(LAYOUT)
    (folder / "turnouts.tsv").write_text(TABLE)
    (folder / "events.csv").write_text(EVENTS)
    return folder


def usable(folder):
    return load_configuration(folder, FORMATS, to_si, leave_out=True)


LEFT_OUT = {
    "an override": ("overrides/t2.yaml", "hammer:\n  rat: 20000\n", ["t2"]),
    "an override that is no YAML": ("overrides/t2.yaml", "hammer: [\n", ["t2"]),
    "an override that would not be read": ("overrides/t2.yml", "", ["t2"]),
    "a layout": ("layouts/main.yaml", LAYOUT.replace("24.6", "24,6"), ["t1", "t2"]),
    "a layout that would not be read": ("layouts/other.yml", "", ["t3"]),
    "a reference to no layout": ("turnouts.tsv", TABLE.replace("other", "another"), ["t3"]),
    "a number": ("turnouts.tsv", TABLE.replace("\t2\t", "\t2,5\t"), ["t2"]),
    "a technical column of two turnouts": (
        "turnouts.tsv",
        TABLE.replace("hammer_rate_hz", "hammer_format")
        .replace("main\t1.5\t", "main\t1.5\tuf")
        .replace("2\t", "2\tuf"),
        ["t1", "t2"],
    ),
    "a row for the second time": ("turnouts.tsv", TABLE + "t3\tmain\n", ["t3"]),
    "the raw folder of a turnout below": (
        "turnouts.tsv",
        "turnout\tlayout\traw\nt3\tmain\tt1\nt1\tmain\nt2\tmain\n",
        ["t1", "t3"],
    ),
    "an id in other capitals": ("turnouts.tsv", TABLE + "T3\tmain\n", ["T3", "t3"]),
    "a track that would not be read": ("tracks/t2.yml", "", ["t2"]),
    "a track of a layout that would not be read": ("tracks/main.yml", "", ["t1", "t2"]),
    "an id": ("turnouts.tsv", TABLE.replace("t3\t", "t 3\t"), [""]),
    "an event": ("events.csv", EVENTS + "t2,A7,2.4.2026,tamping,\n", ["t2"]),
    "events that contradict each other": ("events.csv", EVENTS + "t1,A7,2026-04-02,tamping,none\n", ["t1"]),
    "an event without a turnout": ("events.csv", EVENTS + ",A7,2026-04-02,tamping,\n", [""]),
}


@pytest.mark.parametrize(("name", "text", "turnouts"), LEFT_OUT.values(), ids=LEFT_OUT)
def test_an_error_leaves_out_only_the_turnouts_that_it_concerns(folder, name, text, turnouts):
    (folder / name).write_text(text)
    with pytest.raises(ConfigErrors) as stopped:
        load_configuration(folder, FORMATS, to_si)
    configuration = usable(folder)
    assert sorted(configuration.faulty) == turnouts
    assert {str(e) for e in configuration.errors} == {str(e) for e in stopped.value.errors}
    assert set(configuration.ids) == {"t1", "t2", "t3"} - set(turnouts) - ({"t3"} if "t 3" in text else set())
    for turnout in configuration.ids:
        assert configuration.turnout(turnout).config_hash
    for turnout in set(turnouts) - {""}:
        with pytest.raises(ConfigError, match=name.split("/")[-1].split(".")[0]):
            configuration.turnout(turnout)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("config.yaml", "receptance:\n  gate_levl: 0.9\n"),
        ("turnouts.tsv", TABLE.replace("km", "kmm")),
        ("events.csv", EVENTS.replace("resets", "reset")),
        ("tracks/base.yml", ""),
        ("layouts/main.yaml", "sections: ["),
    ],
)
def test_an_error_that_concerns_the_whole_fleet_stops_the_run(folder, name, text):
    if name.startswith("layouts"):
        (folder / "turnouts.tsv").write_text(TABLE.replace("other", "main"))
    (folder / name).write_text(text)
    with pytest.raises(ConfigErrors, match=name):
        usable(folder)


@pytest.mark.parametrize(
    ("name", "text"), [("overrides/t4.yaml", "{}"), ("overrides/t4.yml", ""), ("layouts/x.yml", "")]
)
def test_a_file_of_no_turnout_is_reported_and_leaves_out_none(folder, name, text):
    (folder / name).write_text(text)
    configuration = usable(folder)
    assert not configuration.faulty and len(configuration.ids) == 3
    (warning,) = configuration.warnings
    assert name in warning.path


def test_a_turnout_without_a_row_may_be_the_one_whose_id_is_wrong(folder):
    (folder / "turnouts.tsv").write_text(TABLE.replace("t3\t", "t 3\t"))
    configuration = usable(folder)
    assert configuration.is_left_out("t3") and not configuration.is_left_out("t1")
    (folder / "turnouts.tsv").write_text(TABLE.replace("t3\tother\t3\t\n", ""))
    assert not usable(folder).is_left_out("t3")
