"""Seeded faults: one seed is one night with a fault and the nights after it (``benchmarks.faults``).

``python -m benchmarks faults --seeds 3000`` takes seeds 0 to 2999; ``--first 17 --seeds 1`` replays seed 17.
"""

import os
from collections import Counter

from benchmarks.bar import Bar
from benchmarks.faults import run_seeds

N_SEED = int(os.environ.get("TURNOUT_FAULT_SEEDS", "20"))
FIRST_SEED = int(os.environ.get("TURNOUT_FIRST_SEED", "0"))


def bars():
    """Number of seeds after which a night is broken, hangs, or gives other answers than the raw files."""
    wrong, hangs, kinds = 0, 0, Counter()
    for seed, kind, problem, said in run_seeds(range(FIRST_SEED, FIRST_SEED + N_SEED)):
        kinds[kind] += 1
        hangs += said == "hangs" or "hangs" in problem
        if problem:
            wrong += 1
            print(f"  seed {seed}, {kind}: {problem}; the night of the fault: {said}", flush=True)
    drawn = ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
    yield Bar("seeds after which a night is broken or an answer differs", wrong, 0, "", n=f"of {N_SEED}: {drawn}")
    yield Bar("nights that hang", hangs, 0, "")
