"""Cost of the calibrated model: of a month with 200 trains, of a whole turnout, and of 3,500 turnouts.

One intact site of the blind generator (four sensors, one group of sections) is visited twice, with three and with
``TURNOUT_TWIN_PASSAGES`` passages (default 6) at each visit. The difference is the cost of one more passage. What is
printed for more trains, or more groups, is computed from both costs and not run. A visit uses at most
``MAX_PASSAGES_AND_AXLES`` passages of a group.
"""

import os
import shutil
import tempfile
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from turnout.stages.calibrated_model import calibrate_turnout
from turnout.stages.visit_fits import MAX_PASSAGES_AND_AXLES
from turnout_blind.effect import load_effects
from turnout_blind.history import NONE, HistoryPlan, make_history

CASE, SEED, N_VISITS, FEW = "T1", (4103, 37, 0), 2, 3
TRAINS_A_MONTH = 200
N_GROUPS = 4  # of sections of a whole turnout: 16 sensors
N_CORES = 2
N_TURNOUTS = 3500


def bars():
    """Yield every bar."""
    n_passages = max(int(os.environ.get("TURNOUT_TWIN_PASSAGES", "6")), FEW + 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_history(
            folder, CASE, HistoryPlan(NONE, None, SEED, n_passages=n_passages, n_visits=N_VISITS), load_effects()
        )
        shutil.copytree(folder / CASE / "raw", folder / "few")
        remove_passages(folder / "few" / CASE / "passages", n_passages)
        cpu_seconds(folder, folder / "few", "warm")  # loads the compiled kernels
        many, few = (cpu_seconds(folder, raw, raw.name) for raw in (folder / CASE / "raw", folder / "few"))
    further = (many - few) / (N_VISITS * (n_passages - FEW))
    visit = few / N_VISITS
    used = MAX_PASSAGES_AND_AXLES[0]
    n = f"n={N_VISITS} visits of {FEW} and {n_passages} passages"
    yield Bar(f"twin: a visit of {FEW} passages", visit, unit="CPU s", n=n)
    yield Bar("twin: each further passage", further, unit="CPU s", n=n)
    yield Bar(
        f"twin: {TRAINS_A_MONTH} trains a month, all used",
        visit + (TRAINS_A_MONTH - FEW) * further,
        300.0,
        "CPU s",
        n=n,
    )
    month = visit + (used - FEW) * further
    yield Bar(f"twin: the same with the {used} that a visit uses", month, 300.0, "CPU s", n=n)
    whole = N_GROUPS * month / N_CORES
    yield Bar(f"twin: whole turnout, {N_GROUPS} groups on {N_CORES} cores", whole, 300.0, "s", n=n)
    yield Bar(f"twin: {N_TURNOUTS} turnouts a month", N_TURNOUTS * N_GROUPS * month / 3600.0, unit="core hours", n=n)


def cpu_seconds(folder, raw, name):
    """CPU time of the fits of all visits and the answer after the newest, in a work folder of this name."""
    with stopwatch() as watch:
        model = calibrate_turnout(CASE, folder / CASE / "config", raw, folder / f"work-{name}")
    assert len(model.computed) == N_VISITS and not model.notes
    return watch.cpu


def remove_passages(passages, n_passages):
    """Leave the first few passages of each visit."""
    files = sorted(passages.iterdir())
    for k, path in enumerate(files):
        if k % n_passages >= FEW:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
