"""Layouts and tracks that no turnout uses are run_check, too, so that a fault is found before a turnout uses them."""

import shutil

import pytest

from turnout.cli.main import main
from turnout.errors import ConfigError
from turnout.simulate import load_track


@pytest.fixture
def folder(repository, tmp_path, monkeypatch):
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "config"


def write_faulty_copy(folder, kind, old, new):
    """Write a copy, with one fault, of the correct file of this kind. No turnout uses the copy."""
    original = (folder / kind / "tommerup.yaml").read_text()
    assert original.count(old) >= 1
    (folder / kind / "spare.yaml").write_text(original.replace(old, new, 1))


def run_check(capsys):
    code = main(["check"])
    return code, capsys.readouterr().out


def test_correct_files_that_no_turnout_uses_are_not_mentioned(folder, capsys):
    for kind in ("layouts", "tracks"):
        shutil.copy(folder / kind / "tommerup.yaml", folder / kind / "spare.yaml")
    code, printed = run_check(capsys)
    assert code == 0 and "no fault." in printed and "spare" not in printed


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sections:", "section:", "column 1: unknown key 'section'. Did you mean 'sections'?"),
        ("hammer:", "hammer: [", "Correct the YAML syntax there"),
        ("sections:", "sections: \x00", r"'\x00', which no YAML file may hold"),
    ],
)
def test_a_layout_that_no_turnout_uses_is_checked(folder, capsys, old, new, words):
    write_faulty_copy(folder, "layouts", old, new)
    code, printed = run_check(capsys)
    assert code == 1 and "with faults" in printed
    (line,) = [line for line in printed.splitlines() if "layouts/spare.yaml" in line]
    assert line.startswith("  used by no turnout: config/layouts/spare.yaml, ") and words in line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("spacing:", "spacin:", "unknown key 'spacin'. Did you mean 'spacing'?"),
        ("spacing:", "layers: 2\nspacing:", "a name for the second time. Keep one of them"),
        ("value: 0.6, unit: m", "value: 0,6, unit: m", "unknown key '6'. If it belongs to the number before it"),
        ("unit: m,", "unit: M,", "unknown unit 'M'. Did you mean 'm'?"),
        ("unit: m,", "unit: furlong,", "furlong"),
        ("spacing:", "spacing: [", "Correct the YAML"),
        ("spacing:", "extends: nobody\nspacing:", "no file config/tracks/nobody.yaml"),
    ],
)
def test_a_track_that_no_turnout_uses_is_checked(folder, capsys, old, new, words):
    write_faulty_copy(folder, "tracks", old, new)
    code, printed = run_check(capsys)
    assert code == 1 and "with faults" in printed
    (line,) = [line for line in printed.splitlines() if "no simulation" in line]
    assert line.startswith("  no simulation: config/tracks/spare.yaml") and words in line


def replace_once(folder, kind, old, new):
    """Replace a text in the file that all turnouts use, and return the number of its line."""
    path = folder / kind / "tommerup.yaml"
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return 1 + text[: text.index(old)].count("\n")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("A8: {place: {value: 26.4", "A8: {place: {value: 264", "locations.A8.place: 264 m is off the track"),
        ("A9: {place: {value: 28.2", "A9: {place: {value: -50", "locations.A9.place: -50 m is off the track"),
        ("cosine, place: {value: 4.5", "cosine, place: {value: 450", "routes.main[0].place: 450 m is off the track"),
        ("kink, place: {value: 3.9", "kink, place: {value: 390", "routes.diverging[1].place: 390 m is off the track"),
    ],
)
def test_a_position_off_the_track_of_its_own_file_is_reported_with_its_line(folder, capsys, old, new, words):
    line = replace_once(folder, "tracks", old, new)
    code, printed = run_check(capsys)
    start = f"  not on the track: config/tracks/tommerup.yaml, line {line}, {words} from -45 m to 57 m. Correct it"
    assert code == 1 and [x for x in printed.splitlines() if x.startswith(start)], printed


def test_a_stretch_of_supports_beyond_the_track_is_reported_with_its_line(folder, capsys):
    path = folder / "tracks/tommerup.yaml"
    text = path.read_text()
    near = "    from: {value: -46, unit: m, source: guess, prior: 0.1}\n    to: {value: -1.5,"
    path.write_text(text.replace(near, near.replace("-46", "-96").replace("-1.5", "-61.5")))
    line = 1 + text[: text.index("  - label: OT")].count("\n")
    code, printed = run_check(capsys)
    assert (
        code == 1 and f"line {line}, sections[0]: from -96 m to -61.5 m lies nothing of the track from -45 m" in printed
    )


def test_an_inherited_position_beyond_a_shorter_track_is_not_reported(folder, capsys):
    """A shorter track that extends another file may leave out what it does not reach."""
    extent = "extent: {from: {value: -45, unit: m, source: x}, to: {value: 45, unit: m, source: x}}\n"
    (folder / "tracks/short.yaml").write_text(
        "extends: tommerup\nname: short\n" + extent.replace("45, unit: m, source: x}}", "30, unit: m, source: x}}")
    )
    assert run_check(capsys)[0] == 0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("main, position: 26.4", "main, position: 264",
         "section A8: 264.0 m in the layout, the track goes from -45 to 57 m. Its track is config/tracks"),
        ("main, position: 26.4", "main, position: 27.4",
         "section A8: 27.4 m in the layout, 26.4 m in the track's file; correct one of them. Its track is config"),
        ("web, section: A9}", "web, section: A9, offset: 24}",
         "sensor A9 at 52.2 m: wheels are wholly on the track of config/tracks/tommerup.yaml only from -36.0 m to 48"),
    ],
)  # fmt: skip
def test_a_position_of_the_layout_off_the_track_is_reported_once_with_its_line(folder, capsys, old, new, words):
    """All three turnouts use this layout and its track."""
    line = replace_once(folder, "layouts", old, new)
    code, printed = run_check(capsys)
    (found,) = [x for x in printed.splitlines() if "tommerup.yaml" in x]
    assert code == 1 and words in found
    assert found.startswith(f"  not on the track: config/layouts/tommerup.yaml, line {line}, column ")


def test_a_position_of_an_override_is_compared_with_the_track_of_its_turnout(folder, capsys):
    (folder / "overrides").mkdir(exist_ok=True)
    (folder / "overrides/tommerup_s2.yaml").write_text("sections:\n  A7: {position: 25.4}\n")
    code, printed = run_check(capsys)
    assert (
        code == 1
        and "config/overrides/tommerup_s2.yaml, line 2, column 18: section A7: 25.4 m in the layout" in printed
    )
    text = (folder / "tracks/tommerup.yaml").read_text()
    (folder / "tracks/tommerup_s2.yaml").write_text(
        text.replace("A7: {place: {value: 24.6", "A7: {place: {value: 25.4")
    )
    assert run_check(capsys)[0] == 0


@pytest.mark.parametrize("content", [b"name: \xff\n", b"name: \x00\n"])
def test_the_error_of_a_track_file_that_is_no_text_states_the_file(tmp_path, content):
    path = tmp_path / "spare.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"spare\.yaml, "):
        load_track(str(path))


def replace_section_a8(folder, line):
    """Replace the line of section A8 in the layout of the example; A7 is at 24.6 m of the main track."""
    path = folder / "layouts" / "tommerup.yaml"
    text = path.read_text()
    old = "A8:   {panel: CP,  track: main, position: 26.4}"
    assert text.count(old) == 1
    path.write_text(text.replace(old, line))


def test_two_sections_at_one_position_of_a_track_are_reported_once(folder, capsys):
    replace_section_a8(folder, "A8:   {panel: CP,  track: main, position: 24.60}")
    code, text = run_check(capsys)
    (line,) = [line for line in text.splitlines() if "two sections at one position" in line]
    assert code == 1 and "config/layouts/tommerup.yaml, line 13" in line
    assert "sections A7 and A8 are both at 24.6 m, track main" in line


def test_two_sections_at_one_position_of_two_tracks_are_no_fault(folder, capsys):
    replace_section_a8(folder, "A8:   {panel: CP,  track: diverging, position: 24.6}")
    assert "two sections at one position" not in run_check(capsys)[1]


def test_two_sections_farther_apart_than_a_turnout_is_long_are_reported(folder, capsys):
    replace_section_a8(folder, "A8:   {panel: CP,  track: main, position: 2640}")
    code, text = run_check(capsys)
    (line,) = [line for line in text.splitlines() if "too far apart" in line]
    assert code == 1 and "config/layouts/tommerup.yaml, line 13" in line
    assert "sections OT and A8 are 2652 m apart. No turnout is longer than 500 m" in line
