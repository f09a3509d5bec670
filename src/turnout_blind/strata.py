"""Plan the cases of a set: controls, single effects, doubles, outside the library, not identifiable."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.site import PLAIN

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from turnout_blind.effect import Effect

FULL_COUNTS = {"control": 60, "single": 1, "double": 20, "outside": 20, "unidentifiable": 16}
FAST_COUNTS = {"control": 10, "single": 17, "double": 3, "outside": 5, "unidentifiable": 5}
# A double has two of these effects that do not mask one another, from the upper half of their ladders.
PAIR_EFFECTS = ("void", "ballast", "pad", "pad_temperature", "rail_shear", "dip", "flat", "unsprung_mass", "gain",
         "time_offset", "mount_resonance", "position")  # fmt: skip
MASKING_PAIRS = ({"void", "ballast"}, {"time_offset", "position"}, {"time_offset", "mount_resonance"})


@dataclass(frozen=True)
class CasePlan:
    """``stratum`` and ``effects`` ((kind, rung), ...) of one case, ``seed`` of its random generator, and ``panel``."""

    stratum: str
    effects: tuple[tuple[str, int], ...]
    seed: tuple[int, ...]
    panel: str = PLAIN


def plan_cases(
    seed: int, effects: Mapping[str, Effect], full: bool = True, only: Collection[str] | None = None, panel: str = PLAIN
) -> list[CasePlan]:
    """Plans of a whole set in shuffled order.

    A full set has every single effect at each rung of its ladder; the fast tier has one rung each.

    Parameters
    ----------
    seed : int
        Seed of the set.
    effects : mapping
        Effects by kind.
    full : bool
        All strata, or the fast tier.
    only : collection of str or None
        Kinds beside the controls, which are at most as many as the other cases; None: all.
    panel : str
        Panel of all cases.

    Returns
    -------
    list of CasePlan
        The plans.

    Examples
    --------
    >>> from turnout_blind.effect import load_effects
    >>> plans = plan_cases(7, load_effects(), full=False)
    >>> len(plans), sum(p.stratum == "control" for p in plans)
    (40, 10)
    """
    rng = np.random.default_rng([seed, 11])
    effect_types = {
        s: [k for k, e in sorted(effects.items()) if e.stratum == s] for s in ("single", "outside", "unidentifiable")
    }
    if panel != PLAIN:  # effects that exist in such a panel alone
        effect_types["single"] += [k for k, e in sorted(effects.items()) if e.site.get("panel") == panel]
    counts = FULL_COUNTS if full else FAST_COUNTS
    cases: list[tuple[str, tuple[tuple[str, int], ...]]] = [("control", ())] * counts["control"]
    if full:
        cases += [("single", ((k, r),)) for k in effect_types["single"] for r in range(len(effects[k].ladder))]
    else:
        singles = [(k, int(rng.integers(2, len(effects[k].ladder)))) for k in effect_types["single"]]
        cases += [("single", (e,)) for e in singles]
    for stratum in ("outside", "unidentifiable"):
        for i in range(counts[stratum]):
            effect_type = effect_types[stratum][i % len(effect_types[stratum])]
            n = len(effects[effect_type].ladder)
            cases.append(
                (stratum, ((effect_type, (i // len(effect_types[stratum]) if full else int(rng.integers(n))) % n),))
            )
    cases += [("double", _draw_pair(rng, effects)) for _ in range(counts["double"])]
    if only is not None:
        with_effects = [m for m in cases if m[1] and all(k in only for k, _ in m[1])]
        cases = cases[: min(counts["control"], len(with_effects))] + with_effects
    order = rng.permutation(len(cases))
    shuffled = (cases[i] for i in order.tolist())
    return [CasePlan(stratum, kinds, (seed, 23, k), panel) for k, (stratum, kinds) in enumerate(shuffled)]


def _draw_pair(rng: np.random.Generator, effects: Mapping[str, Effect]) -> tuple[tuple[str, int], ...]:
    available = [k for k in PAIR_EFFECTS if k in effects]
    while True:
        pair = rng.choice(available, 2, replace=False).tolist()
        if set(pair) not in MASKING_PAIRS:
            return tuple((k, int(rng.integers(len(effects[k].ladder) // 2 + 1, len(effects[k].ladder)))) for k in pair)


def case_id(seed: int, k: int) -> str:
    """Name of a case.

    Parameters
    ----------
    seed : int
        Seed of the set.
    k : int
        Number of the case in the set.

    Returns
    -------
    str
        "T" and eight hexadecimal digits that tell nothing of the content.

    Examples
    --------
    >>> len(case_id(1, 0))
    9
    """
    return "T" + hashlib.sha256(f"turnout-blind {seed} {k}".encode()).hexdigest()[:8]
