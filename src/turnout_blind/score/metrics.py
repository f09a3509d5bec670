"""Compute the figures of the proof, each with its number of cases, interval and target (bar)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.score.calibration import worst_difference
from turnout_blind.score.intervals import clopper_pearson, poisson_interval
from turnout_blind.score.matching import MIN_CLEAR_GAIN

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
    from typing import Any

    from turnout_blind.score.matching import CaseResult

MAX_FIT_LOSS = 1.0  # loss of held-out fit that counts if the row gives no standard error [points]


@dataclass(frozen=True)
class Share:
    """``k`` of ``n`` cases; ``bar`` [%] with ``sense`` ">=" or "<=", None if the figure is only printed."""

    name: str
    k: int
    n: int
    bar: float | None = None
    sense: str = ">="

    @property
    def share(self) -> float:
        """Share in percent, nan for n = 0."""
        return 100.0 * self.k / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Two-sided 95 % interval of Clopper and Pearson [%]."""
        low, high = clopper_pearson(self.k, self.n)
        return 100.0 * low, 100.0 * high

    @property
    def is_met(self) -> bool | None:
        """Whether the bar is met, None without bar or cases."""
        if self.bar is None or self.n == 0:
            return None
        return self.share >= self.bar if self.sense == ">=" else self.share <= self.bar


@dataclass(frozen=True)
class Rate:
    """``k`` events in ``years``; ``bar`` is the highest rate [% a year], None if the figure is only printed."""

    name: str
    k: int
    years: float
    bar: float | None = None

    @property
    def rate(self) -> float:
        """Events in a hundred years, nan without exposure."""
        return 100.0 * self.k / self.years if self.years else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Two-sided 95 % interval of a Poisson rate [% a year]."""
        low, high = poisson_interval(self.k, self.years)
        return 100.0 * low, 100.0 * high

    @property
    def is_met(self) -> bool | None:
        """Whether the bar is met, None without bar or exposure."""
        return None if self.bar is None or not self.years else self.rate <= self.bar


@dataclass(frozen=True)
class Value:
    """A figure other than a share: ``value`` from ``n`` cases, nan if nothing was measured.

    ``by_chance`` are the 2.5 and 97.5 % points of the value of a tool without an error, None if they are not known.
    """

    name: str
    value: float
    n: int
    bar: float | None = None
    sense: str = "<="
    unit: str = ""
    by_chance: tuple[float, float] | None = None

    @property
    def is_met(self) -> bool | None:
        """Whether the bar is met, None without bar or cases."""
        if self.bar is None or self.n == 0:
            return None
        return self.value <= self.bar if self.sense == "<=" else self.value >= self.bar


def figures(
    results: Sequence[CaseResult], oracle: Mapping[str, tuple[float, float]] | None = None
) -> list[Share | Value]:
    """All figures of a set.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.
    oracle : mapping or None
        Result of ``read_oracle``.

    Returns
    -------
    list of Share or Value
        The figures.
    """
    by_stratum = {
        s: [j for j in results if j.stratum == s] for s in ("control", "single", "double", "outside", "unidentifiable")
    }
    clear = [j for j in by_stratum["single"] if j.is_clear]
    oracle = oracle or {}
    with_oracle = [j for j in by_stratum["single"] if j.case in oracle]
    with_gain = [j for j in with_oracle if _oracle_gain(j, oracle) > MIN_CLEAR_GAIN]
    clear_outside = [j for j in by_stratum["outside"] if j.is_clear]
    unidentifiable = by_stratum["unidentifiable"]
    shares = [_share("controls: false alarms", by_stratum["control"], lambda j: j.alarm, 100.0 * 2 / 60, "<=")]
    shares += [
        _share("not identifiable: 'a or b' with the truth, or none", unidentifiable, is_handled_right, 100.0),
        _share("not identifiable: a wrong name", unidentifiable, lambda j: bool(j.wrong_names), 0.0, "<="),
    ]
    shares += _location_and_name_figures(clear, "clear singles")
    if oracle:
        shares += _location_and_name_figures(with_gain, "singles whose oracle gains over 3 points")
        shares += [
            _share("the oracle itself falls by over a point", with_oracle, lambda j: _oracle_gain(j, oracle) < -1.0)
        ]
    shares += [
        _share("what: a wrong name (clear singles)", clear, lambda j: bool(j.wrong_names)),
        _share("what: a wrong name (all singles)", by_stratum["single"], lambda j: bool(j.wrong_names)),
        _share("outside the library: detected (clear)", clear_outside, lambda j: j.alarm),
        _share("outside the library: located (clear)", clear_outside, lambda j: all(j.located.values())),
        _share("outside the library: located (all)", by_stratum["outside"], lambda j: all(j.located.values()), 90.0),
        _share("outside the library: named wrongly", by_stratum["outside"], lambda j: bool(j.wrong_names), 10.0, "<="),
        _share("two effects: both right", by_stratum["double"], _has_both_right, 60.0),
        _share("two effects: one right and none wrong", by_stratum["double"], _has_one_right, 90.0),
        _share("cases without an answer", results, lambda j: not j.answered, 0.0, "<="),
    ]
    return [
        *shares,
        *_parameter_figures(results),
        *_held_out_figures(results, with_gain, oracle),
        _calibration_figure(results),
    ]


def _share(
    name: str,
    cases: Sequence[CaseResult],
    test: Callable[[CaseResult], Any],
    bar: float | None = None,
    sense: str = ">=",
) -> Share:
    return Share(name, sum(bool(test(j)) for j in cases), len(cases), bar, sense)


def _is_located(what: str, j: CaseResult) -> bool:
    return j.located[what]


def _location_and_name_figures(cases: Sequence[CaseResult], which: str) -> Iterator[Share]:
    for what in ("lock", "place", "axle", "sensor"):
        cases_with = [j for j in cases if what in j.located]
        yield _share(f"where: {what} right ({which})", cases_with, partial(_is_located, what), 95.0)
    yield _share(f"what: top-1 ({which})", cases, lambda j: j.is_first_right, 85.0)
    yield _share(f"what: top-2 ({which})", cases, lambda j: bool(j.matches[0]), 95.0)


def _oracle_gain(j: CaseResult, oracle: Mapping[str, tuple[float, float]]) -> float:
    """Points of held-out fit that the true effect gains in the same engine, nan if it was not computed."""
    before, after = oracle.get(j.case, (float("nan"), float("nan")))
    return after - before


def is_handled_right(j: CaseResult) -> bool:
    """Whether an unidentifiable effect got the right kind of answer: none, or "a or b" with the truth among them.

    Parameters
    ----------
    j : CaseResult
        Result of the case.

    Returns
    -------
    bool
        False also without an answer.
    """
    return j.answered and not j.wrong_names and (not j.alarm or j.matches[0] == "a_or_b")


def _has_both_right(j: CaseResult) -> bool:
    return all(h == "named" and located for h, located in zip(j.matches, j.is_located))


def _has_one_right(j: CaseResult) -> bool:
    return any(h == "named" and located for h, located in zip(j.matches, j.is_located)) and not j.wrong_names


def _parameter_figures(results: Sequence[CaseResult]) -> Iterator[Share | Value]:
    compared = [p for j in results for p in j.parameters]
    covered = [c for _, c in compared if c is not None]
    errors = [100.0 * e for e, _ in compared]
    yield Share("parameters: inside the 95 % interval", sum(covered), len(covered), 85.0)
    yield Value("parameters: median error", _median(errors), len(errors), 20.0, "<=", "%")


def _held_out_figures(
    results: Sequence[CaseResult], with_gain: Sequence[CaseResult], oracle: Mapping[str, tuple[float, float]]
) -> Iterator[Share | Value]:
    """Figures of the fit gained by names on held-out recordings.

    No answer closes no gap. A named model without a fit counts as worse. Without a standard error of the gain, one
    point is used.
    """
    gaps = {j.case: _gap_closed(j, *oracle[j.case]) for j in with_gain}
    named_gaps = [gaps[j.case] for j in with_gain if j.fits[1] is not None]
    yield Value("held-out fit: gap to the oracle closed, median", _median(gaps.values()), len(gaps), 80.0, ">=", "%")
    yield Value("held-out fit: the same where the tool gave a fit", _median(named_gaps), len(named_gaps), unit="%")
    with_fit = [j for j in results if "named" in j.matches or j.wrong_names or j.fits[1] is not None]
    with_fit = [j for j in with_fit if j.fits[0] is not None]
    yield _share("held-out fit: fell by more than its standard error", with_fit, _has_lost_fit, 0.0, "<=")
    yield _share(
        "held-out fit: fell by over a point", with_fit, lambda j: _has_lost_fit(replace(j, gain_error=MAX_FIT_LOSS))
    )


def _gap_closed(j: CaseResult, before: float, oracle_fit: float) -> float:
    after = j.fits[1] if j.fits[1] is not None else j.fits[0] if j.fits[0] is not None else before
    return 100.0 * (after - before) / (oracle_fit - before)


def _has_lost_fit(j: CaseResult) -> bool:
    before, after = j.fits
    return after is None or after < before - (MAX_FIT_LOSS if j.gain_error is None else j.gain_error)


def _calibration_figure(results: Sequence[CaseResult]) -> Value:
    difference, by_chance = worst_difference(results)
    n = sum(j.probability is not None for j in results) if difference is not None else 0
    name = "probability: worst fifth, stated from seen"
    return Value(name, float("nan") if difference is None else difference, n, 0.1, by_chance=by_chance)


def _median(values: Collection[float]) -> float:
    return float(np.median(list(values))) if values else float("nan")


def confusion(results: Sequence[CaseResult]) -> dict[str, Counter[str]]:
    """First answers by what was concealed; a double counts under both its kinds, joined.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    dict of Counter
        Number of first answers by concealed kind.
    """
    table: dict[str, Counter[str]] = {}
    for j in results:
        table.setdefault(" + ".join(sorted(j.kinds)) or "control", Counter())[j.first_answer] += 1
    return table


def severity(results: Sequence[CaseResult]) -> dict[str, list[tuple[int, float, str, bool]]]:
    """First answers to single effects, by rung.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    dict of list
        Rung, visibility [points], first answer and whether it is right, by kind.
    """
    table: dict[str, list[tuple[int, float, str, bool]]] = {}
    for j in results:
        if j.stratum in ("single", "outside"):
            table.setdefault(j.kinds[0], []).append((j.rungs[0], j.gain, j.first_answer, bool(j.matches[0])))
    return {effect_type: sorted(rows) for effect_type, rows in sorted(table.items())}
