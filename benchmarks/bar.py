"""A measured figure with its bar, and a stopwatch."""

import math
import resource
import time
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Bar:
    """Measured ``figure`` and its ``limit``, the bar. ``sense`` is "<=" or ">=", or "" if it is only printed."""

    name: str
    figure: float
    limit: float | None = None
    unit: str = ""
    sense: str = "<="
    n: str = ""
    note: str = ""

    @property
    def is_unmeasured(self) -> bool:
        """Whether there is a bar and no figure, which is NaN where nothing was measured."""
        return self.limit is not None and bool(self.sense) and math.isnan(self.figure)

    @property
    def is_met(self) -> bool | None:
        """Whether the bar is met; None without a bar or a figure."""
        if self.limit is None or not self.sense or self.is_unmeasured:
            return None
        return bool(self.figure <= self.limit if self.sense == "<=" else self.figure >= self.limit)

    def __str__(self) -> str:
        verdict = {True: "met", False: "MISSED", None: "open" if self.is_unmeasured else ""}[self.is_met]
        bar = "" if self.limit is None else f"{self.sense} {self.limit:g}"
        return _line(self.name, f"{self.figure:.4g}", bar, self.unit, verdict, f"{self.n} {self.note}")


def _line(name: str, figure: str, bar: str, unit: str, verdict: str, remarks: str) -> str:
    return f"{name:<64} {figure:>11} {bar:>12} {unit:<10} {verdict:<7}{remarks}".rstrip()


def heading() -> str:
    """The names of the columns in which a ``Bar`` is printed."""
    return _line("figure", "measured", "bar", "unit", "bar is", "number of cases, remarks")


class Stopwatch:
    """CPU seconds (user + system, this process and its finished children) and wall seconds."""

    cpu = 0.0
    wall = 0.0


@contextmanager
def stopwatch():
    """``with stopwatch() as watch: ...`` then ``watch.cpu`` and ``watch.wall``."""

    def cpu():
        usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(u.ru_utime + u.ru_stime for u in usage)

    watch, cpu0, wall0 = Stopwatch(), cpu(), time.perf_counter()
    try:
        yield watch
    finally:
        watch.cpu, watch.wall = cpu() - cpu0, time.perf_counter() - wall0
