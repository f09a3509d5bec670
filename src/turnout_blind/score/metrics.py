"""Compute the figures of the proof, each with its number of cases, interval and target (bar)."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.matching import CLEAR

POINT = 1.0  # loss of held-out fit that counts if the row gives no standard error [points]
FEWEST = 5  # smallest group of stated probabilities that is compared with its bar [cases]


@dataclass(frozen=True)
class Share:
    """``k`` of ``n`` cases; ``bar`` [%] with ``sense`` ">=" or "<=", None if the figure is only printed."""

    name: str
    k: int
    n: int
    bar: float | None = None
    sense: str = ">="

    @property
    def share(self):
        """Share in percent, nan for n = 0."""
        return 100.0 * self.k / self.n if self.n else float("nan")

    @property
    def interval(self):
        """Two-sided 95 % interval of Clopper and Pearson [%]."""
        return tuple(100.0 * x for x in clopper_pearson(self.k, self.n))

    @property
    def met(self):
        """Whether the bar is met, None without bar or cases."""
        if self.bar is None or self.n == 0:
            return None
        return self.share >= self.bar if self.sense == ">=" else self.share <= self.bar


@dataclass(frozen=True)
class Value:
    """A figure other than a share: ``value`` from ``n`` cases, nan if nothing was measured."""

    name: str
    value: float
    n: int
    bar: float | None = None
    sense: str = "<="
    unit: str = ""

    @property
    def met(self):
        """Whether the bar is met, None without bar or cases."""
        if self.bar is None or self.n == 0:
            return None
        return self.value <= self.bar if self.sense == "<=" else self.value >= self.bar


def figures(judged, oracle=None):
    """All figures of the ``results`` of cases; ``oracle`` is that of ``read_oracle``, {} if there is none."""
    of = {
        s: [j for j in judged if j.stratum == s] for s in ("control", "single", "double", "outside", "unidentifiable")
    }
    clear = [j for j in of["single"] if j.clear]
    oracle = oracle or {}
    asked = [j for j in of["single"] if j.case in oracle]
    gained = [j for j in asked if _gained(j, oracle) > CLEAR]
    seen = [j for j in of["outside"] if j.clear]
    blurred = of["unidentifiable"]
    found = [_share("controls: false alarms", of["control"], lambda j: j.alarm, 100.0 * 2 / 60, "<=")]
    found += [
        _share("not identifiable: 'a or b' with the truth, or none", blurred, as_it_should, 100.0),
        _share("not identifiable: a wrong name", blurred, lambda j: bool(j.wrong), 0.0, "<="),
    ]
    found += _where_and_what(clear, "clear singles")
    if oracle:
        found += _where_and_what(gained, "singles whose oracle gains over 3 points")
        found += [_share("the oracle itself falls by over a point", asked, lambda j: _gained(j, oracle) < -1.0)]
    found += [
        _share("what: a wrong name (clear singles)", clear, lambda j: bool(j.wrong)),
        _share("what: a wrong name (all singles)", of["single"], lambda j: bool(j.wrong)),
        _share("outside the library: detected (clear)", seen, lambda j: j.alarm),
        _share("outside the library: located (clear)", seen, lambda j: all(j.located.values())),
        _share("outside the library: located (all)", of["outside"], lambda j: all(j.located.values()), 90.0),
        _share("outside the library: named wrongly", of["outside"], lambda j: bool(j.wrong), 10.0, "<="),
        _share("two effects: both right", of["double"], _both_right, 60.0),
        _share("two effects: one right and none wrong", of["double"], _one_right, 90.0),
        _share("cases without an answer", judged, lambda j: not j.answered, 0.0, "<="),
    ]
    return [*found, *_parameters(judged), *_held_out(judged, gained, oracle), _calibration(judged)]


def _share(name, cases, test, bar=None, sense=">="):
    return Share(name, sum(bool(test(j)) for j in cases), len(cases), bar, sense)


def _where_and_what(cases, which):
    for what in ("lock", "place", "axle", "sensor"):
        there = [j for j in cases if what in j.located]
        yield _share(f"where: {what} right ({which})", there, lambda j, w=what: j.located[w], 95.0)
    yield _share(f"what: top-1 ({which})", cases, lambda j: j.first, 85.0)
    yield _share(f"what: top-2 ({which})", cases, lambda j: bool(j.hits[0]), 95.0)


def _gained(j, oracle):
    """Points of held-out fit that the true effect gains in the same engine, nan if it was not computed."""
    before, after = oracle.get(j.case, (float("nan"), float("nan")))
    return after - before


def as_it_should(j):
    """Whether an unidentifiable effect got the right kind of answer: none, or "a or b" with the truth among them."""
    return j.answered and not j.wrong and (not j.alarm or j.hits[0] == "a_or_b")


def _both_right(j):
    return all(h == "named" and there for h, there in zip(j.hits, j.placed))


def _one_right(j):
    return any(h == "named" and there for h, there in zip(j.hits, j.placed)) and not j.wrong


def _parameters(judged):
    compared = [p for j in judged for p in j.parameters]
    covered = [c for _, c in compared if c is not None]
    errors = [100.0 * e for e, _ in compared]
    yield Share("parameters: inside the 95 % interval", sum(covered), len(covered), 85.0)
    yield Value("parameters: median error", _median(errors), len(errors), 20.0, "<=", "%")


def _held_out(judged, gained, oracle):
    """Figures of the fit gained by names on held-out recordings.

    No answer closes no gap. A named model without a fit counts as worse. Without a standard error of the gain, one
    point is used.
    """
    closed = {j.case: _closed(j, *oracle[j.case]) for j in gained}
    named = [closed[j.case] for j in gained if j.fits[1] is not None]
    yield Value(
        "held-out fit: gap to the oracle closed, median", _median(closed.values()), len(closed), 80.0, ">=", "%"
    )
    yield Value("held-out fit: the same where the tool gave a fit", _median(named), len(named), unit="%")
    told = [j for j in judged if "named" in j.hits or j.wrong or j.fits[1] is not None]
    told = [j for j in told if j.fits[0] is not None]
    yield _share("held-out fit: fell by more than its standard error", told, _fell, 0.0, "<=")
    yield _share("held-out fit: fell by over a point", told, lambda j: _fell(replace(j, gain_error=POINT)))


def _closed(j, before, best):
    after = j.fits[1] if j.fits[1] is not None else j.fits[0] if j.fits[0] is not None else before
    return 100.0 * (after - before) / (best - before)


def _fell(j):
    before, after = j.fits
    return after is None or after < before - (POINT if j.gain_error is None else j.gain_error)


def _calibration(judged):
    worst = [abs(stated - share) for stated, share, n in reliability(judged) if n >= FEWEST]
    n = sum(j.probability is not None for j in judged)
    name = "probability: worst fifth, stated from seen"
    return Value(name, max(worst, default=float("nan")), n if worst else 0, 0.1)


def _median(values):
    return float(np.median(list(values))) if values else float("nan")


def reliability(judged):
    """(mean stated probability, share right, n) of five groups of equal size, except that ties stay together."""
    stated = sorted((j.probability, j.probably_right) for j in judged if j.probability is not None)
    if not stated:
        return []
    p, right = np.array(stated, dtype=float).T
    edges = np.unique(np.quantile(p, np.arange(1, 5) / 5.0, method="inverted_cdf"))
    group = np.searchsorted(edges, p)
    return [
        (float(p[group == g].mean()), float(right[group == g].mean()), int((group == g).sum()))
        for g in np.unique(group)
    ]


def confusion(judged):
    """{row: Counter of first answers}; a double counts under both its kinds, joined."""
    table = {}
    for j in judged:
        table.setdefault(" + ".join(sorted(j.kinds)) or "control", Counter())[j.said] += 1
    return table


def severity(judged):
    """{kind: [(rung, visibility [points], first answer, whether it is right)]} of single effects, by rung."""
    table = {}
    for j in judged:
        if j.stratum in ("single", "outside"):
            table.setdefault(j.kinds[0], []).append((j.rungs[0], j.gain, j.said, bool(j.hits[0])))
    return {kind: sorted(rows) for kind, rows in sorted(table.items())}
