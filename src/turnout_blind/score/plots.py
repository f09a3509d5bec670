"""Pictures of a scored set: the answers along every ladder, and the reliability of stated probabilities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.score.calibration import reliability
from turnout_blind.score.intervals import clopper_pearson

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path
    from types import ModuleType

    from matplotlib.figure import Figure

    from turnout_blind.score.matching import CaseResult

COLOURS = {"right": "#2a7f3f", "among two": "#8fce9a", "none": "#e8e8e8", "unknown": "#9ab6d8", "wrong": "#c0392b"}
LETTERS = {"right": "✓", "among two": "½", "none": "–", "unknown": "?", "wrong": "✗"}


def pyplot() -> ModuleType:
    """pyplot with SVG output that is the same in every run."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "blind", "font.size": 9})
    import matplotlib.pyplot as plt

    return plt


def save(figure: Figure, path: Path) -> Path:
    """Write an SVG file without a date.

    Parameters
    ----------
    figure : Figure
        Figure that is closed.
    path : Path
        File that is written.

    Returns
    -------
    Path
        The same path.
    """
    figure.savefig(path, metadata={"Date": None})
    pyplot().close(figure)
    return path


def outcome(result: CaseResult) -> str:
    """Outcome of a case, a key of ``COLOURS``. A wrong name outweighs a right one beside it.

    Parameters
    ----------
    result : CaseResult
        Result of the case.

    Returns
    -------
    str
        "right", "among two", "none", "unknown" or "wrong".
    """
    if result.wrong_names:
        return "wrong"
    if all(h == "named" for h in result.matches) and result.matches:
        return "right"
    if any(result.matches):
        return "among two"
    return "unknown" if result.alarm else "none"


def draw_severity(results: Sequence[CaseResult], path: Path) -> Path:
    """Draw a cell per kind and rung, from hidden to obvious, with the outcome; framed: visibility above 3 points.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.
    path : Path
        File that is written.

    Returns
    -------
    Path
        The picture.
    """
    plt = pyplot()
    cells = [j for j in results if j.stratum in ("single", "outside", "unidentifiable")]
    effect_types = sorted({(("single", "outside", "unidentifiable").index(j.stratum), j.kinds[0]) for j in cells})
    figure, axis = plt.subplots(figsize=(7.5, 1.2 + 0.27 * len(effect_types)), layout="constrained")
    rows = {effect_type: len(effect_types) - 1 - i for i, (_, effect_type) in enumerate(effect_types)}
    for rank, j in _offsets_in_cell(cells):
        label, y, x = outcome(j), rows[j.kinds[0]], j.rungs[0] + rank
        edge = {"edgecolor": "black", "lw": 1.2} if j.is_clear else {"edgecolor": "white", "lw": 0.5}
        axis.add_patch(plt.Rectangle((x - 0.48, y - 0.45), 0.96, 0.9, facecolor=COLOURS[label], **edge))
        axis.text(x, y, LETTERS[label], ha="center", va="center", fontsize=8)
    axis.set_yticks([rows[k] for _, k in effect_types], [k.replace("_", " ") for _, k in effect_types])
    axis.set_xticks(range(7), [f"level {r}" for r in range(7)])
    axis.set_xlim(-0.6, 6.6)
    axis.set_ylim(-0.6, len(effect_types) - 0.4)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=c) for c in COLOURS.values()]
    figure.legend(handles, list(COLOURS), ncols=5, loc="outside lower center", frameon=False)
    axis.set_title("answers, from hidden to obvious; framed: visibility above 3 points", fontsize=9)
    return save(figure, path)


def _offsets_in_cell(results: Iterable[CaseResult]) -> Iterator[tuple[float, CaseResult]]:
    """(offset, case): cases of one kind and rung side by side, each a quarter of a cell further right."""
    counts: dict[tuple[str, int], int] = {}
    for j in results:
        key = j.kinds[0], j.rungs[0]
        yield 0.25 * counts.get(key, 0), j
        counts[key] = counts.get(key, 0) + 1


def draw_reliability(results: Sequence[CaseResult], path: Path) -> Path:
    """Draw the share right against the stated probability, by fifths of the cases, with 95 % intervals.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.
    path : Path
        File that is written.

    Returns
    -------
    Path
        The picture.
    """
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(4.2, 3.8), layout="constrained")
    axis.plot([0, 1], [0, 1], color="0.6", lw=1)
    axis.fill_between([0, 1], [-0.1, 0.9], [0.1, 1.1], color="0.92", lw=0, label="within 0.1")
    for stated, share, n in reliability(results):
        low, high = clopper_pearson(round(share * n), n)
        axis.errorbar(stated, share, [[share - low], [high - share]], fmt="o", color="C0", capsize=3)
        axis.annotate(f"n = {n}", (stated, low), xytext=(0, -12), textcoords="offset points", fontsize=8, ha="center")
    axis.set_xlim(0, 1.02)
    axis.set_ylim(-0.08, 1.05)
    axis.set_xlabel("stated probability")
    axis.set_ylabel("share right")
    axis.legend(loc="upper left")
    return save(figure, path)


def spectrum(rows: np.ndarray, rate: float, window: str = "hann") -> tuple[np.ndarray, np.ndarray]:
    """Spectra from windowed segments of 0.25 s that overlap by half.

    Parameters
    ----------
    rows : (n_sensor, n) array of float
        Signals.
    rate : float
        Sampling rate. [Hz]
    window : str
        Window of a segment; for an impact at its start "boxcar", as others suppress it.

    Returns
    -------
    (n_line,) and (n_sensor, n_line) arrays of float
        Frequency [Hz] and power density.
    """
    from scipy import signal

    return signal.welch(rows, rate, window, nperseg=min(rows.shape[1], int(rate / 4.0)), axis=1)


def relative_changes(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Relative change of each row.

    Parameters
    ----------
    before : (n_sensor, n) array of float
        Signals before.
    after : (n_sensor, n) array of float
        Signals after.

    Returns
    -------
    (n_sensor,) array of float
        Change relative to ``before``.
    """
    return np.linalg.norm(after - before, axis=1) / np.linalg.norm(before, axis=1)


def most_changed(before: np.ndarray, after: np.ndarray) -> int:
    """Index of the row with the largest relative change.

    Parameters
    ----------
    before : (n_sensor, n) array of float
        Signals before.
    after : (n_sensor, n) array of float
        Signals after.

    Returns
    -------
    int
        Index of the row.
    """
    return int(np.argmax(relative_changes(before, after)))
