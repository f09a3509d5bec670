"""The blind proof: cost of a case, and every figure of a revealed set in the folder ``TURNOUT_BLIND_SET`` (proof/)."""

import os
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from turnout_blind.campaign import make_case
from turnout_blind.effect import load_effects
from turnout_blind.score.metrics import Share, figures
from turnout_blind.score.report import read_oracle, score_set
from turnout_blind.strata import case_id, plan_cases


def bars():
    """Size of a full set, CPU time per case, and the figures of the revealed set."""
    effects = load_effects()
    plans = plan_cases(1, effects)
    strata = Counter(p.stratum for p in plans)
    yield Bar("cases of a full set", len(plans), 200, "cases", ">=")
    yield Bar("controls of a full set", strata["control"], 60, "cases", ">=")
    singles = Counter(p.effects[0][0] for p in plans if p.stratum == "single")
    yield Bar("cases per single effect, fewest", min(singles.values()), 7, "cases", ">=", n=f"{len(singles)} effects")
    yield from _cost_bars(plans, effects)
    yield from _proof_bars(Path(os.environ.get("TURNOUT_BLIND_SET", "proof")))


def _cost_bars(plans, effects):
    chosen = [next(p for p in plans if p.stratum == s) for s in ("control", "single", "double")]
    cpu_times = []
    with tempfile.TemporaryDirectory() as folder:
        make_case(folder, "warm", chosen[0], effects)  # compiles
        for k, plan in enumerate(chosen):
            with stopwatch() as watch:
                make_case(folder, case_id(1, k), plan, effects)
            cpu_times.append(watch.cpu)
    yield Bar("a case made, most of three", max(cpu_times), 15.0, "CPU s", n=f"n={len(cpu_times)}")
    yield Bar(
        "a full set made", sum(cpu_times) / len(cpu_times) * len(plans) / 60.0, 90.0, "CPU min", note="from three cases"
    )


def _proof_bars(out):
    if not (out / "revealed").exists():
        yield Bar("scores of the proof", float("nan"), note=f"no revealed set in {out}/: see docs/blind_method.md")
        return
    results, diagnosis = score_set(out)
    cpu = [run["cpu_s"] for run in diagnosis["cases"].values()]
    yield Bar("a case diagnosed, most", max(cpu), 60.0, "CPU s", n=f"n={len(cpu)}")
    hours = sum(cpu) / len(cpu) * len(plan_cases(1, load_effects())) / 2.0 / 3600.0
    yield Bar("a full set diagnosed on two cores", hours, 3.0, "h", note="CPU time of the cases run, scaled")
    for f in figures(results, read_oracle(out)):
        if isinstance(f, Share):
            low, high = f.interval
            yield Bar(f.name, f.share, f.bar, "%", f.sense, n=f"{f.k}/{f.n}", note=f"95 %: {low:.1f} to {high:.1f}")
        else:
            yield Bar(f.name, f.value, f.bar, f.unit, f.sense, n=f"n={f.n}")
