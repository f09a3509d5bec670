"""Choice of the recordings of a case: which passages are fitted, and which recordings are reserved."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any

    from turnout.mismatch.turnout import HammerInput, PassageInput

MAX_PASSAGES = 8  # of a case: each is simulated hundreds of times, and more alike add little
MAX_AXLES = 96  # of all passages of a case: the simulation time is proportional to them
MAX_SWITCH_AXLES = 32  # the same in a switch, where an axle costs three times as much
RESERVED_EVERY = 5  # one of so many recordings is held out from all fits
MIN_TO_RESERVE = 4  # recordings; with fewer none is held out


def split_by_length(passages: Sequence[PassageInput]) -> list[PassageInput]:
    """Passages with a separate train name for each number of axles of one type.

    Parameters
    ----------
    passages : sequence of PassageInput
        The passages.

    Returns
    -------
    list of PassageInput
    """
    axles = {id(p): len(p.vehicle.wheels) for p in passages}
    lengths: dict[str, set] = {}
    for p in passages:
        lengths.setdefault(p.train, set()).add(axles[id(p)])
    several = {train for train, counts in lengths.items() if train and len(counts) > 1}
    return [replace(p, train=f"{p.train}, {axles[id(p)]} axles") if p.train in several else p for p in passages]


def select_passages(
    passages: Sequence[PassageInput], max_passages: int = MAX_PASSAGES, max_axles: int = MAX_AXLES
) -> list[PassageInput]:
    """At most ``max_passages`` passages with ``max_axles`` axles in all.

    One train of each type in turn, short trains first, and in each type the extremes of speed first.

    Parameters
    ----------
    passages : sequence of PassageInput
        The passages.
    max_passages : int
        Of a case.
    max_axles : int
        Of all its passages.

    Returns
    -------
    list of PassageInput
        In the order of ``passages``.
    """
    by_train: dict[str, list] = {}
    for p in sorted(passages, key=lambda p: (len(p.vehicle.wheels), p.train, p.speed)):
        by_train.setdefault(p.train, []).append(p)
    queues = [_extremes_first(members) for members in by_train.values()]
    order = [p for turn in zip_longest(*queues) for p in turn if p is not None]
    chosen: list = []
    for p in order:
        total = sum(len(c.vehicle.wheels) for c in chosen) + len(p.vehicle.wheels)
        if len(chosen) < max_passages and (total <= max_axles or not chosen):
            chosen.append(p)
    return [p for p in passages if any(p is c for c in chosen)]


def _extremes_first(members: Sequence[PassageInput]) -> list[PassageInput]:
    """Slowest, fastest, second slowest, second fastest ... of passages sorted by speed."""
    n = len(members)
    return [members[k // 2 if k % 2 == 0 else n - 1 - k // 2] for k in range(n)]


def reserved_names(passages: Sequence[PassageInput], tests: Sequence[HammerInput]) -> tuple[str, ...]:
    """Names of the held out recordings: every fifth passage in order of speed, else every fifth test.

    The only passage of a train is not held out if another passage, the nearest in speed, can be.

    Parameters
    ----------
    passages : sequence of PassageInput
        The passages.
    tests : sequence of HammerInput
        The hammer tests.

    Returns
    -------
    tuple of str
        () with fewer than ``MIN_TO_RESERVE`` recordings.
    """
    items: list[Any] = [*sorted(passages, key=lambda p: p.speed)] or [*sorted(tests, key=lambda t: t.place)]
    if len(items) < MIN_TO_RESERVE:
        return ()
    remaining, chosen = Counter(_train(item) for item in items), []
    for wanted in range(RESERVED_EVERY // 2, len(items), RESERVED_EVERY):
        nearest = sorted((k for k in range(len(items)) if k not in chosen), key=lambda k: abs(k - wanted))
        chosen.append(next((k for k in nearest if remaining[_train(items[k])] > 1), nearest[0]))
        remaining[_train(items[chosen[-1]])] -= 1
    return tuple(items[k].name for k in sorted(chosen))


def _train(item: PassageInput | HammerInput) -> str:
    """Train type of a passage, "" for all hammer tests."""
    return getattr(item, "train", "")
