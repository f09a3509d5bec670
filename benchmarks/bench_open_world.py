"""Open world: each law is taken out of the library, and its own case is diagnosed. Another name would be wrong.

The answer must be "unknown", or a declared relative: a law of the same kind. TURNOUT_OPEN_WORLD_SEEDS sets the number
of seeds (1).
"""

import os

import numpy as np
from examples import oscillator_case as oscillator
from examples.oscillator_case import LAWS, OscillatorCase

from benchmarks.bar import Bar, stopwatch
from turnout.mismatch import diagnose

RATE, N, OMEGA = 500.0, 1500, 2.0 * np.pi * 20.0
LEVELS = (1.0, 1.0, 1.0, 1.3)  # the last record is held out
# Law -> (amount in its own case, relatives: laws of the same kind)
ODD = ("cubic_spring", "quintic_spring", "absolute_quadratic_spring", "saturating_spring")
DAMPING = ("quadratic_drag", "cubic_damping", "state_damping", "dry_friction")
CASES = {
    "cubic_spring": (0.3, ODD), "quintic_spring": (0.3, ODD), "quadratic_spring": (0.3, ()),
    "absolute_quadratic_spring": (0.2, ODD), "saturating_spring": (0.05, ODD), "play": (0.3, ODD),
    "dry_friction": (0.3, DAMPING), "quadratic_drag": (1.0, DAMPING), "cubic_damping": (2.0, DAMPING),
    "state_damping": (2.0, DAMPING),
}  # fmt: skip


def bars():
    """Yield every bar."""
    seeds = range(1, 1 + int(os.environ.get("TURNOUT_OPEN_WORLD_SEEDS", "1")))
    with stopwatch() as watch:
        removed = [(law, _answer(law, seed, (law,))) for law in CASES for seed in seeds]
        present = [(law, _answer(law, seed)) for law in CASES for seed in seeds]
    named = [(law, a[1], set(a[1]) <= set(CASES[law][1])) for law, a in removed if a[0] in ("named", "a_or_b")]
    n, share = f"n = {len(removed)}", 100.0 / len(removed)
    other = [(law, names) for law, names, is_relative in named if not is_relative]
    relative = [(law, names) for law, names, is_relative in named if is_relative]
    unknown = sum(a[0] == "unknown" for _, a in removed)
    yield Bar("law removed: another name", share * len(other), 3.0, "%", n=n, note=_words(other))
    yield Bar("law removed: a relative", share * len(relative), None, "%", n=n, note=_words(relative))
    yield Bar("law removed: unknown", share * unknown, None, "%", n=n)
    wrong = [(law, a[1] or (a[0],)) for law, a in present if a != ("named", (law,))]
    yield Bar("law present: its name", 100.0 - share * len(wrong), None, "%", n=n, note=_words(wrong))
    yield Bar("CPU time of all cases", watch.cpu, None, "s")


def _words(answers):
    return "; ".join(f"{law}: {' or '.join(names)}" for law, names in answers)


def _answer(law, seed, without=()):
    """(answer, names) of the case of a law."""
    rng, amount = np.random.default_rng(seed), CASES[law][0]
    records = []
    for k, level in enumerate(LEVELS):
        t, lines = np.arange(N) / RATE, np.arange(2.0, 50.0, 0.5)
        phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
        u = np.sum(np.cos(2.0 * np.pi * lines[:, None] * t + phases[:, None]), axis=0)
        u *= level / u.std()
        steps, index = oscillator._step_inputs(u), np.array([LAWS[law][0]])
        y = oscillator._simulate(steps, 1.0 / RATE, OMEGA, 0.02, 1.0, index, np.array([amount]), 12.0 / OMEGA**2)
        records.append((f"r{k}", f"level {k}", u, y + 0.002 * y.std() * rng.normal(size=N)))
    gain = 1.0 / OMEGA**2
    case = OscillatorCase(
        records[:3], records[3:], RATE, (18.0, 4.0), (0.03, 0.03), (gain, 0.3 * gain), tolerance=0.02, without=without
    )
    found = diagnose(case)
    return found.verdict.answer, found.names if found.verdict.answer == "named" else found.verdict.names
