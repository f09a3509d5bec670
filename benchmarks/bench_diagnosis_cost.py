"""CPU time of the diagnosis of a single visit, by panel and answer, in processes of their own.

By default, cases of the blind generator are made: per panel one control and the first single effects that are clear.
TURNOUT_COST_PANELS names the panels ("plain,crossing"), TURNOUT_COST_EFFECTS the number of effects per panel (1).
TURNOUT_COST_SET is a folder of existing cases, as ``turnout blind make`` writes them; TURNOUT_COST_CASES chooses some.
TURNOUT_COST_BEFORE is the ``src`` folder of another version: each case is diagnosed by both in turn, and the ratio of
their CPU times is printed.
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
SOURCES = Path(__file__).parents[1] / "src"


def bars():
    """Cost of each case, the median of each panel and answer, and the ratio to the version before."""
    before = os.environ.get("TURNOUT_COST_BEFORE")
    with tempfile.TemporaryDirectory() as work:
        cpu, ratios = {}, []
        for panel, folder in _cases(Path(work)):
            if not cpu:  # compiled code is cached per version
                for sources in filter(None, (before, SOURCES)):
                    _diagnose(folder, Path(work), sources)
            pair = [_diagnose(folder, Path(work), sources) for sources in filter(None, (before, SOURCES))]
            answer, seconds = pair[-1]
            kind = KINDS.get(answer, "with another answer")
            cpu.setdefault((panel, kind), []).append(seconds)
            note = answer
            if before:
                ratios.append(seconds / pair[0][1])
                note += f"; before: {pair[0][0]}, {pair[0][1]:.1f} CPU s"
            yield Bar(f"{panel}, {folder.name}, {kind}", seconds, LIMITS[kind], "CPU s", note=note)
    for (panel, kind), seconds in sorted(cpu.items()):
        middle, n = statistics.median(seconds), f"n={len(seconds)}"
        yield Bar(f"{panel}, {kind}, median", middle, LIMITS[kind], "CPU s", n=n, note=f"at most {max(seconds):.1f}")
    if ratios:
        yield Bar("CPU time over that of the version before, geometric mean", statistics.geometric_mean(ratios),
                  sense="", n=f"n={len(ratios)}", note=f"{min(ratios):.2f} to {max(ratios):.2f}")  # fmt: skip


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
    """Answer and CPU seconds of a diagnosis of a case by the tool in ``sources``, in a copy of its folder."""
    with tempfile.TemporaryDirectory(dir=work) as copy:
        subprocess.run(["cp", "-r", f"{folder}/.", copy], check=True)
        command = [sys.executable, "-m", "turnout.cli.main", "diagnose", "--turnout", folder.name, "--visit", "all"]
        with stopwatch() as watch:
            done = subprocess.run(
                [*command, "--work", f"{copy}/work", "--json"], cwd=copy, capture_output=True, text=True, check=False,
                env=os.environ | {"PYTHONPATH": str(sources)},
            )  # fmt: skip
        rows = json.loads(done.stdout)["result"]
    return (rows[0]["verdict"] if rows else "no answer"), watch.cpu
