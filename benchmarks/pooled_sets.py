"""Sums over the sealed sets that the pages of the blind proof pool, with exact 95 % intervals.

    python -m benchmarks.pooled_sets [--write]

Prints a table for each group of sums in README and docs; ``--write`` puts the sums into these pages. It reads
docs/sealed: ``plain.csv``, ``crossing.csv`` and ``histories.csv`` have a row for each sealed set. A figure has two
columns, for example ``clear_named``, the number of clear effects with the right name, and ``clear_named_of``, the
number of clear effects. An empty cell: the set does not state the figure, and the sum is without it. A test compares
the sums with the pages, and the rows with their sections.
"""

import argparse
import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

from turnout_blind.score.intervals import clopper_pearson, poisson_interval

ROOT = Path(__file__).resolve().parents[1]
SEALED = ROOT / "docs" / "sealed"
FRACTION = re.compile(r"(\d+)( of | in )(\d+(?:\.\d+)?)\b")
INTERVAL = re.compile(r"(?:\b([\d.]+) )?\bto ([\d.]+) %")
RATES = ("change_alarms",)  # events in site-years; all other figures are cases of cases
FIRST_RIGHT_DERIVATIVES = {"plain": 11, "crossing": 10}  # number of the first set with right derivatives of passages
FIRST_OF_LAST_HISTORIES = 13
FIRST_RIGHT_SIZES = 14  # number of the first set of histories whose sizes have the corrected intervals


@dataclass(frozen=True)
class Sum:
    """Sum of a figure over sealed sets.

    Parameters
    ----------
    figure : str
        Its column.
    kinds : tuple of str
        Files: "plain", "crossing", "histories".
    first : dict
        Number of the first set, by file; 1 by default.
    until : int
        Number of the last set.
    newest : int
        Only so many of the last sets that state the figure; 0: all.
    passages : int
        Only sets of histories with so many passages at each visit; 0: all.
    """

    figure: str
    kinds: tuple[str, ...]
    first: dict[str, int] = field(default_factory=dict)
    until: int = 10**6
    newest: int = 0
    passages: int = 0

    def rows(self):
        """Rows of the sets that state the figure."""
        rows = [r for kind in self.kinds for r in read_sets(kind)
                if self.first.get(kind, 1) <= int(r["number"]) <= self.until and r[self.figure] != ""
                and self.passages in (0, int(r.get("passages_a_visit", 0)))]  # fmt: skip
        return rows[-self.newest :]

    def counts(self):
        """(number of successes or events, number of cases or site-years)."""
        rows = self.rows()
        return sum(int(r[self.figure]) for r in rows), sum(float(r[f"{self.figure}_of"]) for r in rows)

    def interval(self, counts=None):
        """95 % interval of the share, or of the rate a year [%]; of ``counts`` if given, else of the sets."""
        interval_of = poisson_interval if self.figure in RATES else clopper_pearson
        return tuple(100.0 * x for x in interval_of(*(counts or self.counts())))

    def __str__(self):
        k, n = self.counts()
        low, high = self.interval()
        if self.figure in RATES:
            return f"{k} in {n:.0f} site-years ({low:.1f} to {high:.1f} % a year)"
        return f"{k} of {n:.0f} ({low:.1f} to {high:.1f} %)"


def read_sets(kind):
    """Rows of a file of docs/sealed, in the order of the sets."""
    with (SEALED / f"{kind}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def size_of(kinds, first=None, passages=0):
    """(number of sets, number of cases or sites)."""
    rows = Sum("cases", kinds, first or {}, passages=passages).rows()
    return len(rows), sum(int(r["cases"]) for r in rows)


def plain(figure):
    """Sum over all sets of plain track."""
    return Sum(figure, ("plain",))


def crossing(figure, first=1, **selection):
    """Sum over sets in crossing panels from the given number on."""
    return Sum(figure, ("crossing",), {"crossing": first}, **selection)


def right_derivatives(figure):
    """Sum over sets of single visits since the derivatives of passages are right."""
    return Sum(figure, ("plain", "crossing"), FIRST_RIGHT_DERIVATIVES)


def histories(figure, first=1, **selection):
    """Sum over sets of histories from the given number on."""
    return Sum(figure, ("histories",), {"histories": first}, **selection)


def all_and_last(figure):
    """Sums over all sets of histories, and over those since the thirteenth."""
    return histories(figure), histories(figure, FIRST_OF_LAST_HISTORIES)


def sixty(figure):
    """Sum over the sets of histories with 60 passages a site."""
    return histories(figure, passages=15)


# (page, text before the rows, {beginning of the line that states the sums: sums in their order})
STATEMENTS = (
    (
        "docs/blind.md",
        "**One visit.**",
        {
            "| false alarms in controls": (
                plain("alarms"),
                crossing("alarms"),
                crossing("alarms", 4),
            ),
            "| wrong names": (plain("wrong_names"), crossing("wrong_cases")),
            "| clear effects: right name first": (plain("clear_named"), crossing("clear_named")),
            "| two effects: both named": (plain("pairs_named"), crossing("pairs_named")),
            "| effects outside the library": (plain("located"), crossing("located"), crossing("located", newest=10)),
            "| naming efficiency": (plain("enough_named"), crossing("enough_named")),
            "| effects that cannot be identified": (plain("unidentifiable"), crossing("unidentifiable")),
            "| sizes inside": (plain("sizes_inside"), crossing("sizes_inside")),
            "| names with which held-out passages": (plain("falls"), crossing("falls")),
        },
    ),
    (
        "docs/blind.md",
        "sets since the derivatives of passages are right",
        {
            "- alarms in controls": (right_derivatives("alarms"), right_derivatives("wrong_names")),
            "- clear effects": tuple(right_derivatives(f) for f in ("clear_named", "pairs_named", "located")),
            "- sizes inside": (right_derivatives("sizes_inside"), right_derivatives("falls")),
        },
    ),
    (
        "docs/blind.md",
        "**Visits over two years**",
        {
            "Of these, [": tuple(
                sixty(f) for f in ("clear_named", "onsets_inside", "sizes_inside", "change_alarms", "wrong_names")
            ),
            "| clear changes named": all_and_last("clear_named"),
            "| position or sensor right": (histories("position_right"),),
            "| onset inside": (histories("onsets_inside"),),
            "| present size inside": (histories("sizes_inside"), histories("sizes_inside", FIRST_RIGHT_SIZES)),
            "| false alarms": (histories("change_alarms"),),
            "| recorded maintenance": (histories("maintenance_alarms"),),
            "| sites with a wrong name": (histories("wrong_names"), histories("wrong_names", 7)),
            "| sites without an answer": (histories("no_answer"),),
        },
    ),
    ("docs/blind.md", "## The naming efficiency", {"The bar of 85 %": (Sum("enough", ("plain", "crossing")),)}),
    (
        "docs/blind_crossing.md",
        "## All sets with right files",
        {
            "| controls that raised an alarm": (crossing("alarms"), crossing("alarms", 4)),
            "| clear single effects": (crossing("clear_named"),),
            "| ... named, or one of the two": (crossing("clear_named_or_half"),),
            "| cases with a wrong name": (crossing("wrong_cases"),),
            "| effects outside the library: located": (crossing("located"), crossing("located", newest=10)),
            "| effects outside the library: called": (crossing("outside_misnamed"),),
            "| effects that cannot be identified": (crossing("unidentifiable"),),
            "| pairs: both named": (crossing("pairs_named"),),
            "| sizes inside": (crossing("sizes_inside"),),
            "| held-out fit": (crossing("falls"),),
        },
    ),
    (
        "docs/blind_histories.md",
        "## All sets with trains of three types",
        {
            "| clear effects named": all_and_last("clear_named"),
            "| ... named, or half": all_and_last("clear_named_or_half"),
            "| position or sensor right": all_and_last("position_right"),
            "| onset inside": all_and_last("onsets_inside"),
            "| present size inside": (
                histories("sizes_inside"),
                histories("sizes_inside", FIRST_OF_LAST_HISTORIES, until=FIRST_RIGHT_SIZES - 1),
                histories("sizes_inside", FIRST_RIGHT_SIZES),
            ),
            "| false alarms": all_and_last("change_alarms"),
            "| recorded maintenance": all_and_last("maintenance_alarms"),
            "| sites with a wrong name": (
                histories("wrong_names"),
                histories("wrong_names", 7),
                histories("wrong_names", FIRST_OF_LAST_HISTORIES),
            ),
            "| sites that falsely differ": all_and_last("file_alarms"),
            "| sites without an answer": all_and_last("no_answer"),
            "| naming efficiency": all_and_last("enough_named"),
        },
    ),
    (
        "docs/blind_histories.md",
        "**Sites with 60 passages.**",
        {
            "| clear effects named": (sixty("clear_named"),),
            "| position or sensor right": (sixty("position_right"),),
            "| onset inside": (sixty("onsets_inside"),),
            "| present size inside": (sixty("sizes_inside"),),
            "| false alarms": (sixty("change_alarms"),),
            "| recorded maintenance": (sixty("maintenance_alarms"),),
            "| sites with a wrong name": (sixty("wrong_names"),),
            "| sites without an answer": (sixty("no_answer"),),
        },
    ),
    (
        "docs/mismatch.md",
        "## Known limits",
        {
            "- **Crossing and switch panels.**": (crossing("alarms"), crossing("wrong_cases")),
            "  Clear effects": (crossing("clear_named"), plain("alarms"), plain("wrong_names"), plain("clear_named")),
        },
    ),
    (
        "docs/decisions/calibrated-model.md",
        "## Evidence",
        {"In the fifth to the": (histories("clear_named"), histories("change_alarms"))},
    ),
    (
        "README.md",
        "## What was tested",
        {
            "| plain track": (plain("alarms"), plain("wrong_names")),
            "| ... clear effects": (plain("clear_named"), plain("pairs_named")),
            "| crossing panels": (crossing("alarms"), crossing("wrong_cases"), crossing("clear_named")),
            "| two years": (histories("clear_named"),),
            "| ... false alarms": (histories("change_alarms"), histories("wrong_names")),
        },
    ),
)


def is_rounded(stated, exact):
    """Whether a number is the exact one, rounded to the stated decimals."""
    decimals = len(stated.partition(".")[2])
    return abs(float(stated) - exact) <= 0.5 * 10**-decimals + 1e-9


def updated(line, sums):
    """The line with the fractions and intervals of ``sums``, which it states in their order.

    An interval belongs to the first sum left whose fraction in the line has it; it keeps its decimals.
    """
    stated = zip(sums, [(int(k), float(n)) for k, _, n in FRACTION.findall(line)])
    counts = iter([s.counts() for s in sums])

    def fraction(m):
        k, n = next(counts)
        return f"{k}{m[2]}{n:.0f}"

    def interval(m):
        for total, before in stated:
            low, high = total.interval(before)
            if is_rounded(m[2], high) and (not m[1] or is_rounded(m[1], low)):
                ends = [_rounded_as(text, x) for text, x in zip((m[1], m[2]), total.interval()) if text]
                return f"{' '.join([*ends[:-1], 'to', ends[-1]])} %"
        return m[0]

    return INTERVAL.sub(interval, FRACTION.sub(fraction, line))


def _rounded_as(text, value):
    return f"{value:.{len(text.partition('.')[2])}f}"


def write():
    """Put the sums into the pages that state them."""
    for page, heading, statements in STATEMENTS:
        head, mark, rest = (ROOT / page).read_text(encoding="utf-8").partition(heading)
        lines = rest.splitlines(keepends=True)
        for beginning, sums in statements.items():
            i = next(i for i, line in enumerate(lines) if line.startswith(beginning))
            lines[i] = updated(lines[i], sums)
        (ROOT / page).write_text(head + mark + "".join(lines), encoding="utf-8")


def main():
    """Print the number of sets and cases, then a table of sums for each group of statements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put the sums into the pages")
    if parser.parse_args().write:
        write()
    for kind in ("plain", "crossing", "histories"):
        n_sets, n_cases = size_of((kind,))
        print(f"{kind}: {n_sets} sealed sets, {n_cases} cases")
    for page, heading, statements in STATEMENTS:
        print(f"\n**{page}**, {heading.strip('#* ')}\n\n| figure | sums (95 %) |\n|---|---|")
        for beginning, sums in statements.items():
            print(f"| {beginning.strip('|- *[')} | {'; '.join(map(str, sums))} |")


if __name__ == "__main__":
    main()
