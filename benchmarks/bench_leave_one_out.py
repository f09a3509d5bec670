"""Calibrated model, open world: each effect is taken out of its library, and sites with that effect are diagnosed.

Sites are those of the generator of the blind proof, with two visits. The answer must be "unknown" at its position,
or a declared relative; another name is wrong. TURNOUT_LEFT_OUT_SITES sets the sites of each effect (2).
TURNOUT_LEFT_OUT_PAGE is a page whose block "leave_one_out" is replaced by the result, such as docs/mismatch.md.
"""

import os
import re
import tempfile
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from turnout.stages.calibrated_model import answer_rows, calibrate_turnout
from turnout_blind.effect import load_effects
from turnout_blind.history import START, STEP, HistoryPlan, make_history
from turnout_blind.score.histories import QUESTION
from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.matching import MAX_POSITION_ERROR, MIN_CLEAR_GAIN, gain_of
from turnout_blind.score.names import right_names

SEED, N_VISITS = 20261125, 2
OUTCOMES = {
    "unknown": "at its position", "right": "a relative, at its position", "elsewhere": "at another position",
    "none": "not seen", "other": "another name",
}  # fmt: skip
# Name of the tool -> (kinds of the generator, relatives: effects that soften or stiffen the same support)
LIBRARY = {
    "local_ballast": (("ballast",), ("hanging_sleeper",)),
    "hanging_sleeper": (("void",), ("local_ballast",)),
    "local_pad": (("pad",), ()),
    "sensor_gain": (("gain",), ()),
    "sensor_position": (("position",), ()),
    "surface_dip": (("dip", "nose"), ()),
}


def bars():
    """Yield every bar."""
    n_sites = int(os.environ.get("TURNOUT_LEFT_OUT_SITES", "2"))
    with stopwatch() as watch, tempfile.TemporaryDirectory() as folder:
        present, missing = [], []
        for name, (kinds, relatives) in LIBRARY.items():
            for k in range(n_sites):
                kind = kinds[k % len(kinds)]
                truth = _make(Path(folder), name, kind, k)
                if max(map(gain_of, truth["visible"])) < MIN_CLEAR_GAIN:
                    continue
                present.append((name, kind, _judge(folder, truth, (), right_names(kind))))
                missing.append((name, kind, _judge(folder, truth, (name,), relatives)))
    n = len(missing)
    other = [m for m in missing if m[2][0] == "other"]
    at_place = [m for m in missing if m[2][0] in ("unknown", "right")]
    yield _bar("effect left out: another name", other, n, 3.0, "<=")
    yield _bar("effect left out: unknown at its position, or a relative", at_place, n, 80.0, ">=")
    yield _bar("effect left out: called intact", [m for m in missing if m[2][0] == "none"], n, None, "<=")
    yield _bar(
        "effect in the library: its name at its position", [m for m in present if m[2][0] == "right"], n, None, ""
    )
    yield Bar("CPU time of all sites", watch.cpu, None, "s")
    if page := os.environ.get("TURNOUT_LEFT_OUT_PAGE"):
        replace_block(Path(page), _table(present, missing, watch.cpu))


def replace_block(page, text):
    """Replace what stands in ``page`` between the two comments of this benchmark."""
    begin, end = "<!-- begin leave_one_out -->", "<!-- end leave_one_out -->"
    old = page.read_text()
    if begin not in old or end not in old:
        raise ValueError(f"{page}: no block between {begin} and {end}")
    page.write_text(re.sub(f"{begin}.*{end}", lambda _: f"{begin}\n{text}\n{end}", old, flags=re.DOTALL))


def _table(present, missing, cpu):
    """Sites by effect: what the answer is with the effect in the library, and without it."""
    lines = ["| concealed | left out | answer with it | answer without it |", "|---|---|---|---|"]
    for (name, kind, (_, words)), (_, _, (outcome, other_words)) in zip(present, missing):
        lines.append(f"| {kind} | `{name}` | {words} | {other_words} ({OUTCOMES[outcome]}) |")
    counts = {o: sum(m[2][0] == o for m in missing) for o in OUTCOMES}
    n = len(missing)
    low, high = clopper_pearson(counts["other"], n)
    lines += ["", f"Another name: {counts['other']} of {n} (95 %: {100 * low:.0f} to {100 * high:.0f} %; bar 3 %)."]
    low, high = clopper_pearson(counts["unknown"] + counts["right"], n)
    located = f"{counts['unknown'] + counts['right']} of {n} (95 %: {100 * low:.0f} to {100 * high:.0f} %; bar 80 %)"
    lines += [f"At its position: {located}. {cpu:.0f} CPU s for all sites."]
    return "\n".join(lines)


def _bar(title, chosen, n, bar, sense):
    low, high = clopper_pearson(len(chosen), n)
    words = "; ".join(f"{kind} without {name}: {said}" for name, kind, (_, said) in chosen if sense == "<=")
    note = f"{100 * low:.0f} to {100 * high:.0f} %" + (f"; {words}" if words else "")
    return Bar(title, 100.0 * len(chosen) / n, bar, "%", sense, f"n = {n}", note)


def _make(folder, name, kind, k):
    """Truth of a site with an effect from the upper half of its ladder, every second one in a crossing panel."""
    effects = load_effects()
    n = len(effects[kind].ladder)
    panel = effects[kind].site.get("panel", ("plain", "crossing")[k % 2])
    plan = HistoryPlan((START, STEP)[k % 2], (kind, n // 2 + 1 + k % (n // 2)), (SEED, k, len(name)), panel, N_VISITS)
    return make_history(folder, f"{name}_{k}", plan, effects)


def _judge(folder, truth, without, names):
    """(outcome, words) of the last answer to the question that asks for the effect.

    "right" with one of these names, "unknown" at the position of the effect, "elsewhere", "other" name, or "none".
    """
    case, (effect,) = Path(folder) / truth["case"], truth["effects"]
    model = calibrate_turnout(truth["case"], case / "config", case / "raw", case / "work", without=without)
    (row,) = (r for r in answer_rows(model) if r["question"] == QUESTION[truth["pattern"]])
    stated = [name for name in (row["term"], row["rival_term"]) if name]
    words = f"{' or '.join(stated) or row['verdict']} at {row['parameter'] or 'no position'}"
    if row["verdict"] == "none":
        return "none", words
    if set(stated) - set(names):
        return "other", words
    position = effect["where"].get("position", truth["sensors"].get(effect["where"].get("sensor")))
    if row["position_m"] is None or abs(row["position_m"] - position) > MAX_POSITION_ERROR:
        return "elsewhere", words
    return ("right" if stated else "unknown"), words
