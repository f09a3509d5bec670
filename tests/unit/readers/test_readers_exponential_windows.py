"""A stated exponential window is reported for a hammer test, as the samples do not show it."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE, RAIL = np.random.default_rng(20261128).normal(size=(2, 60)).round(6)
CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))


def remarks(tmp_path, name, value, kind="hammer", checked=()):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, **{name: value})
    result = read("a.npz", tmp_path, RawDescription(CHANNELS, rate=1000.0, kind=kind, checked_entries=checked))
    assert len(result.recordings) == 1
    return [error for error in result.errors if "exponential window" in error.problem.partition(" may say ")[2]]


STATED = [
    ("Response window", "Exponential"),
    ("WindowType", "Exp. 10 %"),
    ("Exponential window", "on"),
    ("Fenster Antwort", "Exponentialfenster, exponentiell"),
    ("Windows", np.array(["force", "exponential"])),
    ("text", "response: exponential window, decay 20 ms"),
    ("Window", "Expon."),
    ("Windows", np.array(["none", "exponential"])),
    ("Windows", "force: none; response: exponential"),
    ("Exponential window decay", "0.5 %"),
]


@pytest.mark.parametrize(("name", "value"), STATED)
def test_a_stated_exponential_window_is_reported_for_a_hammer_test(name, value, tmp_path):
    (error,) = remarks(tmp_path, name, value)
    assert error.reason == "entry_unknown" and "damping" in error.problem
    assert not remarks(tmp_path, name, value, "passage")
    assert not remarks(tmp_path, name, value, checked=(name,))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Response window", "Uniform"),
        ("Exponential window", "off"),
        ("Exponential window", 0),
        ("Averaging", "exponential"),
        ("Window", "Hanning"),
        ("Window of averaging", "exponential averaging"),
        ("FFT window", "exponential"),
        ("Comment", "no exponential window"),
        ("Exponential window", "disabled"),
        ("Exponential window", "inactive"),
        ("Exponential window", "n/a"),
        ("Exponential window", ""),
        ("Exponential decay", "0 %"),
        ("Exponential window", "off, 10 %"),
        ("Window", "exponential, not used"),
        ("Time weighting", "exponential"),
        ("Window", "experimental"),
    ],
)
def test_another_window_or_a_window_that_is_off_is_not_reported(name, value, tmp_path):
    assert not remarks(tmp_path, name, value)


@pytest.mark.parametrize(
    "line", ["Window;rectangular;exponential", "Window;none;exponential", "Response window: exponential"]
)
def test_a_window_in_the_head_of_a_text_is_reported(line, tmp_path):
    rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([line, "force;rail", *rows, ""]), encoding="utf-8")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=1000.0))
    assert len(result.recordings) == 1 and ["exponential window" in error.problem for error in result.errors] == [True]
