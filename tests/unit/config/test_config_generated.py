"""The generated files of the repository are up to date with the settings, and the program reads them."""

import json
import re

import jsonschema
import pytest
from ruamel.yaml import YAML

from turnout.cli.main import main
from turnout.config import load_configuration
from turnout.config.generate import generate_files
from turnout.config.settings import parts
from turnout.readers.formats import FORMATS
from turnout.units import to_si


def test_generated_files_are_up_to_date(repository):
    for path, text in generate_files(repository / "config", repository / "docs", defaults=True).items():
        assert path.read_text(encoding="utf-8") == text, f"{path}: run `turnout config generate --defaults`"


def test_the_page_of_settings_lists_every_key_once(repository):
    """The page has one row for each key of the JSON schema, which has the keys of a channel three times."""
    page = (repository / "docs" / "settings.md").read_text(encoding="utf-8")
    layout = page.partition("## Keys of config/layouts")[2].partition("## Settings:")[0]
    rows = re.findall(r"^\| `(\w+)` \| (?:yes)? \| (.+) \|$", layout, re.M)
    assert len(rows) == len(set(rows)) and {name for name, _ in rows} == names_of(
        json.loads((repository / "config/schema/layout.json").read_text(encoding="utf-8"))
    )
    settings = re.findall(r"^\| `(\w+\.\w+)` \|", page, re.M)
    assert settings == [f"{part}.{name}" for part, cls in sorted(parts().items()) for name in vars(cls())]


def names_of(schema):
    """Names of the leaves of a JSON schema, without the settings."""
    names = set()
    for name, rule in schema.get("properties", {}).items():
        if name != "settings":
            names |= names_of(rule) if rule["type"] == "object" else {name}
    for rule in schema.get("patternProperties", {}).values():
        names |= names_of(rule)
    return names


def test_the_configuration_of_the_repository_is_valid(repository):
    configuration = load_configuration(repository / "config", FORMATS, to_si)
    assert {"tommerup_s1", "tommerup_s2", "aarup_n4"} <= set(configuration.ids)
    labels = [s.label for s in configuration.turnout("tommerup_s1").sections]
    assert labels == ["OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD"]


def test_the_defaults_in_the_files_equal_the_built_in_defaults(repository):
    settings = load_configuration(repository / "config").settings
    assert dict(settings) == {name: cls() for name, cls in parts().items()}


def test_the_schemas_accept_what_the_program_accepts(repository):
    yaml = YAML(typ="safe", pure=True)
    for schema, files in (("config", ["config.yaml"]), ("layout", ["layouts/tommerup.yaml"])):
        validator = jsonschema.Draft202012Validator(
            json.loads((repository / f"config/schema/{schema}.json").read_text())
        )
        for name in files:
            found = [e.message for e in validator.iter_errors(yaml.load((repository / "config" / name).read_text()))]
            assert not found


@pytest.mark.parametrize("change", [{"secions": {}}, {"hammer": {"rate": -1}}, {"hammer": {"sections": 3}}])
def test_the_schemas_reject_what_the_program_rejects(repository, change):
    schema = json.loads((repository / "config/schema/override.json").read_text())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(change, schema)


def test_a_changed_value_is_kept(tmp_path, repository):
    (tmp_path / "config.yaml").write_text("fleet: {shards: 64}\n")
    text = generate_files(tmp_path, tmp_path)[tmp_path / "config.yaml"]
    assert "\n  shards: 64\n" in text and "# default 1; 1 to 4096:" in text
    assert "\n  shards: 1\n" in generate_files(tmp_path, tmp_path, defaults=True)[tmp_path / "config.yaml"]


@pytest.fixture
def copy(tmp_path, repository, monkeypatch):
    import shutil

    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_add_writes_one_row(copy, capsys):
    before = (copy / "config/turnouts.tsv").read_text()
    assert (
        main(["add", "odense_v7", "tommerup", "--raw", "line_7/v7", "--km", "3.25", "--name", "Odense\tswitch 7"]) == 0
    )
    after = (copy / "config/turnouts.tsv").read_text()
    assert after.startswith(before) and after.count("\n") == before.count("\n") + 1
    assert load_configuration(copy / "config").turnout("odense_v7").km == 3.25
    assert "line_7/v7/hammer/{campaign}/{section}_{test}.{ext}" in capsys.readouterr().out


@pytest.mark.parametrize("row", [("tommerup_s1", "tommerup"), ("new", "tomerup"), ("new", "tommerup", "--km", "far")])
def test_add_does_not_change_the_table_if_the_row_is_wrong(copy, row, capsys):
    before = (copy / "config/turnouts.tsv").read_bytes()
    assert main(["add", *row]) == 2
    assert (copy / "config/turnouts.tsv").read_bytes() == before
    assert "config/turnouts.tsv, " in capsys.readouterr().err


def test_check_reports_files_that_match_no_pattern(copy, capsys):
    folder = copy / "raw/tommerup_s1/hammer/2024-05-13"
    folder.mkdir(parents=True)
    for name in ("A7_1.uff", "A77_1.uff", ".hidden.uff", "A8_1.uff.part"):
        (folder / name).write_bytes(b"")
    (copy / "raw/tommerup_s2").mkdir()
    assert main(["check"]) == 1
    printed = capsys.readouterr().out
    assert "1 file in 1 unit, 3 problems" in printed
    assert "tommerup_s1/hammer/2024-05-13/A77_1.uff, file name: its name follows no pattern of the layout" in printed
    assert "tommerup_s2, folder: no file matches a pattern of the layout" in printed


def test_check_reports_tables_that_no_command_reads(copy, capsys):
    for name in ("turnouts.csv", "config (1).yaml", "README.md", ".lock"):
        (copy / "config" / name).write_bytes(b"")
    main(["check"])
    printed = capsys.readouterr().out
    assert printed.count("no command reads a file of this name") == 2
    assert "config/turnouts.csv: no command" in printed and "config/config (1).yaml: no command" in printed


def test_check_reports_folders_that_no_turnout_reads(copy, capsys):
    for name in ("raw/tommerup_s1", "raw/line_7/v7", "raw/W 12"):
        (copy / name).mkdir(parents=True)
    main(["check"])
    printed = capsys.readouterr().out
    assert "raw/W 12: no turnout reads this folder" in printed and "raw/line_7: no turnout reads this folder" in printed
    assert "raw/tommerup_s1: no turnout" not in printed
    assert main(["add", "odense_v7", "tommerup", "--raw", "line_7/v7"]) == 0
    main(["check"])
    assert "raw/line_7: no turnout" not in capsys.readouterr().out


def test_show_plan_and_formats_print_their_results(copy, capsys):
    assert main(["config", "show", "aarup_n4", "--only", "sections.A9"]) == 0
    assert "config/layouts/tommerup.yaml, line" in capsys.readouterr().out
    assert main(["plan"]) == 1 and main(["check", "--formats"]) == 0  # the copy has no recordings
    assert "uff58" in capsys.readouterr().out
