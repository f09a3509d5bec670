"""What no turnout uses is checked all the same: it will be used one day, and its fault should not wait for that day."""

import shutil

import pytest

from turnout.cli import main
from turnout.errors import ConfigError
from turnout.simulate import load_track


@pytest.fixture
def folder(repository, tmp_path, monkeypatch):
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "config"


def spoilt(folder, kind, old, new):
    """A copy of the sound file of this kind that no turnout uses, with one fault."""
    sound = (folder / kind / "tommerup.yaml").read_text()
    assert sound.count(old) >= 1
    (folder / kind / "spare.yaml").write_text(sound.replace(old, new, 1))


def checked(capsys):
    code = main(["check"])
    return code, capsys.readouterr().out


def test_sound_files_that_nobody_uses_say_nothing(folder, capsys):
    for kind in ("layouts", "tracks"):
        shutil.copy(folder / kind / "tommerup.yaml", folder / kind / "spare.yaml")
    code, said = checked(capsys)
    assert code == 0 and "sound." in said and "spare" not in said


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sections:", "section:", "column 1: unknown key 'section'. Did you mean 'sections'?"),
        ("hammer:", "hammer: [", "Correct the YAML syntax there"),
        ("sections:", "sections: \x00", r"'\x00', which no YAML file may hold"),
    ],
)
def test_a_layout_that_no_turnout_uses_is_checked(folder, capsys, old, new, words):
    spoilt(folder, "layouts", old, new)
    code, said = checked(capsys)
    assert code == 1 and "with faults" in said
    (line,) = [line for line in said.splitlines() if "layouts/spare.yaml" in line]
    assert line.startswith("  used by no turnout: config/layouts/spare.yaml, ") and words in line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("spacing:", "spacin:", "unknown key 'spacin'"),
        ("unit: m,", "unit: furlong,", "furlong"),
        ("spacing:", "spacing: [", "Correct the YAML"),
        ("spacing:", "extends: nobody\nspacing:", "no file config/tracks/nobody.yaml"),
    ],
)
def test_a_track_that_no_turnout_uses_is_checked(folder, capsys, old, new, words):
    spoilt(folder, "tracks", old, new)
    code, said = checked(capsys)
    assert code == 1 and "with faults" in said
    (line,) = [line for line in said.splitlines() if "no simulation" in line]
    assert line.startswith("  no simulation: config/tracks/spare.yaml") and words in line


@pytest.mark.parametrize("content", [b"name: \xff\n", b"name: \x00\n"])
def test_a_track_file_that_is_no_text_is_said_by_name(tmp_path, content):
    path = tmp_path / "spare.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"spare\.yaml, "):
        load_track(str(path))
