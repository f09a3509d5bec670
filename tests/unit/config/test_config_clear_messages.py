"""A message quotes what a person has written, and says what to write instead."""

import os

import pytest
from tests.unit.config.one_section import LAYOUT

from turnout.cli.main import main
from turnout.config import load_configuration
from turnout.config.document import load
from turnout.config.schema import Key, suggestion, value_problem
from turnout.errors import ConfigError, ConfigErrors


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "config/layouts").mkdir(parents=True)
    (tmp_path / "config/layouts/main.yaml").write_text(LAYOUT)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\n")
    return tmp_path / "config"


def message(folder, settings="", layout=LAYOUT):
    (folder / "config.yaml").write_text(settings)
    (folder / "layouts/main.yaml").write_text(layout)
    with pytest.raises(ConfigErrors) as stopped:
        load_configuration(folder)
    (error,) = stopped.value.errors
    return f"{error.place}: {error.problem}. {error.remedy}"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("identify:\n  duration: 0.04 s\n", "Write a number from 0.004 to 1 s, without the unit: 0.04"),
        ("identify:\n  duration: 40 ms\n", "duration is '40 ms'. Write a number from 0.004 to 1 s, without the"),
        ("identify:\n  duration: 40ms\n", "without the unit: 0.04"),
        ("identify:\n  ballast_high: 0.3 kHz\n", "without the unit: 300"),
        ("receptance:\n  gate_level: 90 %\n", "Write a number from 0 to 0.999, without the unit: 0.9"),
        ("receptance:\n  gate_level: [0.9]\n", "gate_level is [0.9]. Write a number"),
        ("receptance:\n  gate_level:\n", "gate_level is empty. Write a number"),
        ("receptance:\n  gate_level: true\n", "gate_level is true. Write a number"),
        ("identify:\n  gate_level: 0.9\n", "'gate_level'. It belongs below 'receptance': move it there"),
        ("gate_level: 0.9\n", "line 1, column 1: unknown key 'gate_level'. It belongs below 'receptance'"),
        ("receptance: &a\n  gate_level: 0.9\nidentify:\n  <<: *a\n", "line 4, column 3: the merge key '<<'"),
        ("? [a, b]\n: 1\n", "line 1, column 3: a list in place of a name. Write 'name: value'"),
        ("? {a: b}\n: 1\n", "line 1, column 3: a mapping in place of a name"),
        ("receptance:\n  window: 'abc\nidentify:\n", "line 2, column 11: a quote that is not closed"),
        ("receptance: {gate_level: 0.9\n", "line 1, column 13: expected ',' or '}'"),
    ],
)  # fmt: skip
def test_an_error_of_a_setting_states_what_to_write(folder, text, expected):
    assert expected in message(folder, text)


@pytest.mark.parametrize(
    "text", ["identify:\n  duration: 90 %\n", "identify:\n  duration: 40 min\n", "identify:\n  duration: 4000 s\n"]
)
def test_a_unit_that_makes_no_allowed_value_has_no_hint(folder, text):
    assert message(folder, text).endswith("to 1 s")


def test_a_share_has_no_hint_where_a_whole_number_is_expected():
    assert value_problem(Key("integer", "shards", minimum=0), "90 %") == (
        "'90 %'",
        "Write a whole number of at least 0",
    )
    assert value_problem(Key("integer", "rate", unit="Hz", minimum=1), "20 kHz")[1].endswith("without the unit: 20000")


def test_a_setting_in_a_layout_that_is_not_below_settings_is_directed_there(folder):
    assert "It belongs below 'settings': move it" in message(folder, layout=LAYOUT + "receptance:\n  gate_level: 0.9\n")
    inner = LAYOUT.replace("  force: force\n", "  force: force\n  gate_level: 0.9\n", 1)
    assert "It belongs below 'settings.receptance'" in message(folder, layout=inner)


@pytest.mark.parametrize(
    ("name", "close"),
    [("cp", "CP"), ("TAMPING", "tamping"), ("Pad Exchange", "pad_exchange"), ("pad-exchange", "pad_exchange")],
)
def test_a_name_in_other_capitals_or_with_a_dash_is_recognised(name, close):
    assert suggestion(name, ["CP", "AS", "tamping", "pad_exchange"]).startswith(f"Did you mean {close!r}?")


def test_a_file_with_nothing_but_the_mark_of_a_document_is_empty(tmp_path):
    (tmp_path / "a.yaml").write_text("# none yet\n---\n")
    assert load(tmp_path / "a.yaml") == {}
    (tmp_path / "a.yaml").write_text("null\n")
    with pytest.raises(ConfigError, match="None where names"):
        load(tmp_path / "a.yaml")


def test_locks_of_editors_and_hidden_copies_of_the_system_are_no_files_of_the_configuration(
    folder, monkeypatch, capsys
):
    """Emacs makes a link to nothing beside an open file, a Mac a companion of each file on a foreign disk."""
    monkeypatch.chdir(folder.parent)
    (folder / "config.yaml").write_text("")
    for name in ("overrides", "tracks", "vehicles"):
        (folder / name).mkdir()
    for name in ("overrides", "layouts", "tracks", "vehicles"):
        (folder / name / "._t1.yaml").write_bytes(b"\0\5\x16\7")
        os.symlink("somebody@host.1234:1", folder / name / ".#t1.yaml")
        (folder / name / ".t1.yml").write_text("x")
    configuration = load_configuration(folder)
    assert configuration.ids == ("t1",) and not configuration.warnings
    main(["check"])
    printed = capsys.readouterr()
    assert "no fault" in printed.out and ".#" not in printed.out + printed.err and "._" not in printed.out + printed.err
