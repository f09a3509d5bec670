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


def outcome(judged):
    """Outcome of a case, a key of ``COLOURS``. A wrong name outweighs a right one beside it."""
    if judged.wrong:
        return "wrong"
    if all(h == "named" for h in judged.hits) and judged.hits:
        return "right"
    if any(judged.hits):
        return "among two"
    return "unknown" if judged.alarm else "none"


def draw_severity(judged, path):
    """Draw a cell per kind and rung, from hidden to obvious, with the outcome; framed: visibility above 3 points."""
    plt = pyplot()
    mine = [j for j in judged if j.stratum in ("single", "outside", "unidentifiable")]
    kinds = sorted({(("single", "outside", "unidentifiable").index(j.stratum), j.kinds[0]) for j in mine})
    figure, axis = plt.subplots(figsize=(7.5, 1.2 + 0.27 * len(kinds)), layout="constrained")
    rows = {kind: len(kinds) - 1 - i for i, (_, kind) in enumerate(kinds)}
    for rank, j in _side_by_side(mine):
        word, y, x = outcome(j), rows[j.kinds[0]], j.rungs[0] + rank
        edge = {"edgecolor": "black", "lw": 1.2} if j.clear else {"edgecolor": "white", "lw": 0.5}
        axis.add_patch(plt.Rectangle((x - 0.48, y - 0.45), 0.96, 0.9, facecolor=COLOURS[word], **edge))
        axis.text(x, y, LETTERS[word], ha="center", va="center", fontsize=8)
    axis.set_yticks([rows[k] for _, k in kinds], [k.replace("_", " ") for _, k in kinds])
    axis.set_xticks(range(7), [f"rung {r}" for r in range(7)])
    axis.set_xlim(-0.6, 6.6)
    axis.set_ylim(-0.6, len(kinds) - 0.4)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=c) for c in COLOURS.values()]
    figure.legend(handles, list(COLOURS), ncols=5, loc="outside lower center", frameon=False)
    axis.set_title("what was said, from hidden to obvious; framed: visibility above 3 points", fontsize=9)
    return save(figure, path)


def _side_by_side(judged):
    """(offset, case): cases of one kind and rung side by side, each a quarter of a cell further right."""
    seen = {}
    for j in judged:
        key = j.kinds[0], j.rungs[0]
        yield 0.25 * seen.get(key, 0), j
        seen[key] = seen.get(key, 0) + 1


def draw_reliability(judged, path):
    """Draw the share right against the stated probability, by fifths of the cases, with 95 % intervals."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(4.2, 3.8), layout="constrained")
    axis.plot([0, 1], [0, 1], color="0.6", lw=1)
    axis.fill_between([0, 1], [-0.1, 0.9], [0.1, 1.1], color="0.92", lw=0, label="within 0.1")
    for stated, share, n in reliability(judged):
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


def changes(before, after):
    """(n_sensor,) relative change of each row."""
    return np.linalg.norm(after - before, axis=1) / np.linalg.norm(before, axis=1)


def furthest(before, after):
    """Index of the row with the largest relative change."""
    return int(np.argmax(changes(before, after)))
