"""Pictures of a scored set: the answers along every ladder, and the reliability of stated probabilities."""

import numpy as np

from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.metrics import reliability

COLOURS = {"right": "#2a7f3f", "among two": "#8fce9a", "none": "#e8e8e8", "unknown": "#9ab6d8", "wrong": "#c0392b"}
LETTERS = {"right": "✓", "among two": "½", "none": "–", "unknown": "?", "wrong": "✗"}


def pyplot():
    """pyplot with SVG output that is the same in every run."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "blind", "font.size": 9})
    import matplotlib.pyplot as plt

    return plt


def save(figure, path):
    """Write an SVG file without a date."""
    figure.savefig(path, metadata={"Date": None})
    pyplot().close(figure)
    return path


def outcome(result):
    """Outcome of a case, a key of ``COLOURS``. A wrong name outweighs a right one beside it."""
    if result.wrong_names:
        return "wrong"
    if all(h == "named" for h in result.matches) and result.matches:
        return "right"
    if any(result.matches):
        return "among two"
    return "unknown" if result.alarm else "none"


def draw_severity(results, path):
    """Draw a cell per kind and rung, from hidden to obvious, with the outcome; framed: visibility above 3 points."""
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
    axis.set_xticks(range(7), [f"rung {r}" for r in range(7)])
    axis.set_xlim(-0.6, 6.6)
    axis.set_ylim(-0.6, len(effect_types) - 0.4)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=c) for c in COLOURS.values()]
    figure.legend(handles, list(COLOURS), ncols=5, loc="outside lower center", frameon=False)
    axis.set_title("what was said, from hidden to obvious; framed: visibility above 3 points", fontsize=9)
    return save(figure, path)


def _offsets_in_cell(results):
    """(offset, case): cases of one kind and rung side by side, each a quarter of a cell further right."""
    counts = {}
    for j in results:
        key = j.kinds[0], j.rungs[0]
        yield 0.25 * counts.get(key, 0), j
        counts[key] = counts.get(key, 0) + 1


def draw_reliability(results, path):
    """Draw the share right against the stated probability, by fifths of the cases, with 95 % intervals."""
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


def spectrum(rows, rate, window="hann"):
    """(frequency [Hz], density) of the rows (n_sensor, n), from windowed segments of 0.25 s that overlap by half.

    For an impact at the start of a segment use the window "boxcar": others suppress it.
    """
    from scipy import signal

    return signal.welch(rows, rate, window, nperseg=min(rows.shape[1], int(rate / 4.0)), axis=1)


def relative_changes(before, after):
    """(n_sensor,) relative change of each row."""
    return np.linalg.norm(after - before, axis=1) / np.linalg.norm(before, axis=1)


def most_changed(before, after):
    """Index of the row with the largest relative change."""
    return int(np.argmax(relative_changes(before, after)))
