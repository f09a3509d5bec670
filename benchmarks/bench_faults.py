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
    """Number of seeds after which a night is broken, hangs, or gives other rows than the undisturbed fleet."""
    wrong, hangs, identical, kinds = 0, 0, 0, Counter()
    for result in run_seeds(FIRST_SEED, N_SEED):
        kinds[result["kind"]] += 1
        identical += result["is_identical"]
        hangs += "hangs" in result["problem"]
        if result["problem"]:
            wrong += 1
            print(
                f"  seed {result['seed']}, {result['kind']}, {result['scenario']}: {result['problem']}; "
                f"the night of the fault: {result['said']}",
                flush=True,
            )
    drawn = ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
    yield Bar(
        "seeds after which a night is broken or a row differs without a word", wrong, 0, "", n=f"of {N_SEED}: {drawn}"
    )
    yield Bar("nights that hang", hangs, 0, "")
    yield Bar("seeds after which every file is byte identical (others: same rows, and a message)", identical, None, "")
