"""CPU time of the diagnosis of a single visit, by panel and answer, in processes of their own.

By default, cases of the blind generator are made: per panel one control and the first single effects that are clear.
TURNOUT_COST_PANELS names the panels ("plain,crossing"), TURNOUT_COST_EFFECTS the number of effects per panel (1).
TURNOUT_COST_SET is a folder of existing cases, as ``turnout blind make`` writes them; TURNOUT_COST_CASES chooses some.
TURNOUT_COST_BEFORE is the ``src`` folder of another version: each case is diagnosed by both in turn, and the ratio of
their CPU times is printed. The first case is diagnosed once more before, to compile; not with TURNOUT_COST_WARM=1.
Modules are kept as byte code, as in an installation, whatever PYTHONDONTWRITEBYTECODE says.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from turnout_blind.campaign import make_case
from turnout_blind.effect import load_effects
from turnout_blind.strata import case_id, plan_cases

SEED = 41
KINDS = {"none": "without a finding", "named": "with a named effect", "a_or_b": "with a named effect"}
LIMITS = {"without a finding": 15.0, "with a named effect": 60.0, "with another answer": 60.0}  # CPU s
THRESHOLD = 12.0  # nats, from which evidence matters: a name needs it
SOURCES = Path(__file__).parents[1] / "src"


def bars():
    """Cost of each case, the median of each panel and answer; the ratio to the version before, and other answers."""
    before = os.environ.get("TURNOUT_COST_BEFORE")
    versions = [SOURCES, Path(before)] if before else [SOURCES]
    cpu, pairs = {}, []
    with tempfile.TemporaryDirectory() as work:
        for panel, folder in _cases(Path(work)):
            if not cpu and "TURNOUT_COST_WARM" not in os.environ:
                for sources in versions:
                    _diagnose(folder, Path(work), sources)
            (row, seconds), *others = [_diagnose(folder, Path(work), sources) for sources in versions]
            kind = KINDS.get(row["verdict"], "with another answer")
            cpu.setdefault((panel, kind), []).append(seconds)
            pairs += [(row, seconds, *other) for other in others]
            note = " ".join(str(value) for value in _answer(row) if value)
            note += "".join(f"; before {' '.join(str(v) for v in _answer(r) if v)}, {t:.1f} CPU s" for r, t in others)
            yield Bar(f"{panel}, {folder.name}, {kind}", seconds, LIMITS[kind], "CPU s", note=note)
    for (panel, kind), seconds in sorted(cpu.items()):
        middle, n = statistics.median(seconds), f"n={len(seconds)}"
        yield Bar(f"{panel}, {kind}, median", middle, LIMITS[kind], "CPU s", n=n, note=f"at most {max(seconds):.1f}")
    if pairs:
        yield from _comparison(pairs)


def _comparison(pairs):
    """Bars of the pairs (row, CPU s, row of the version before, its CPU s)."""
    n, ratios = f"n={len(pairs)}", [now / then for _, now, _, then in pairs]
    mean, span = statistics.geometric_mean(ratios), f"{min(ratios):.2f} to {max(ratios):.2f}"
    yield Bar("CPU time over that of the version before, geometric mean", mean, 1.0, n=n, note=span)
    others = sum(_answer(row)[:4] != _answer(old)[:4] for row, _, old, _ in pairs)
    yield Bar("answers with another name, grade, place or channel", float(others), 0.0, n=n)
    changes = [abs(a - b) for row, _, old, _ in pairs for a, b in [(_gain(row), _gain(old))] if max(a, b) > THRESHOLD]
    yield Bar(
        "largest change of the evidence of a leader", max(changes, default=0.0), 1.0, "nats", n=f"n={len(changes)}"
    )


def _answer(row):
    """Verdict and grade, name or names, place, channel, and the evidence of the leader."""
    place = None if row["position_m"] is None else f"{row['position_m']:.1f} m"
    names = " or ".join(filter(None, (row["term"], row["rival_term"] if row["verdict"] == "a_or_b" else None)))
    return f"{row['verdict']} {row['grade'] or ''}".strip(), names, place, row["channel"], f"{_gain(row):.1f} nats"


def _gain(row):
    """Evidence of the leader [nats], 0 without one."""
    ranking = json.loads(row["evidence_json"]).get("ranking") or [{"nats": 0.0}]
    return ranking[0]["nats"]


def _cases(work):
    """Yield (panel, folder) of each case."""
    made = os.environ.get("TURNOUT_COST_SET")
    if made:
        chosen = os.environ.get("TURNOUT_COST_CASES")
        for folder in sorted(Path(made).iterdir()):
            if chosen is None or folder.name in chosen.split(","):
                yield "case", folder
        return
    effects, n_effects = load_effects(), int(os.environ.get("TURNOUT_COST_EFFECTS", "1"))
    for panel in os.environ.get("TURNOUT_COST_PANELS", "plain,crossing").split(","):
        plans = plan_cases(SEED, effects, panel=panel)
        controls = [p for p in plans if p.stratum == "control"][:1]
        singles = [
            p for p in plans if p.stratum == "single" and p.effects[0][1] == len(effects[p.effects[0][0]].ladder) - 1
        ]
        for k, plan in enumerate(controls + singles[:n_effects]):
            case = case_id(SEED, len(panel) * 100 + k)
            make_case(work / panel, case, plan, effects)
            yield panel, work / panel / case


def _diagnose(folder, work, sources):
    """Row of the finding and CPU seconds of a diagnosis by the tool in ``sources``, in a copy of the folder."""
    with tempfile.TemporaryDirectory(dir=work) as copy:
        subprocess.run(["cp", "-r", f"{folder}/.", copy], check=True)
        command = [sys.executable, "-m", "turnout.cli.main", "diagnose", "--turnout", folder.name, "--visit", "all"]
        with stopwatch() as watch:
            done = subprocess.run(
                [*command, "--work", f"{copy}/work", "--json"], cwd=copy, capture_output=True, text=True, check=False,
                env=os.environ | {"PYTHONPATH": str(sources), "PYTHONDONTWRITEBYTECODE": ""},
            )  # fmt: skip
        rows = json.loads(done.stdout)["result"]
    return rows[0], watch.cpu
