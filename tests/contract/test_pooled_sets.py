"""Pooled figures of README and docs are sums over docs/sealed, which agrees with the sections of the sealed sets."""

import re
from itertools import dropwhile, pairwise, takewhile
from pathlib import Path

import pytest
from benchmarks.pooled_sets import (
    FIRST_RIGHT_DERIVATIVES,
    FRACTION,
    INTERVAL,
    STATEMENTS,
    Sum,
    is_rounded,
    read_sets,
    size_of,
    updated,
)

from turnout_blind.score.intervals import clopper_pearson

ROOT = Path(__file__).parents[2]
LINES = [(page, heading, beginning, sums) for page, heading, rows in STATEMENTS for beginning, sums in rows.items()]
TABLES = [s for s in STATEMENTS if any(beginning.startswith("| ") for beginning in s[2])]
# (file, beginning of a row in the section of a set, figure, which fraction of the row)
ROWS = [
    (("plain", "crossing"), r"controls that raised|false alarms in controls", "alarms", 0),
    (("plain", "crossing"), r"clear (single )?effects(:| named)", "clear_named", 0),
    (("plain", "crossing"), r"(pairs|two effects): both named", "pairs_named", 0),
    (
        ("plain", "crossing"),
        r"effects outside the library.* located",
        "located",
        -1,
    ),
    (("plain", "crossing"), r"effects that cannot be identified: ", "unidentifiable", 0),
    (("plain", "crossing"), r"sizes inside|names whose sizes", "sizes_inside", 0),
    (("plain", "crossing"), r"held-out fit that fell", "falls", 0),
    (("plain", "crossing"), r"wrong names, of|cases with a wrong name; of", "wrong_names", -1),
    (("crossing",), r"cases with a wrong name", "wrong_cases", 0),
    (("crossing",), r"effects outside the library: called", "outside_misnamed", 0),
    (
        ("crossing",),
        r"clear single effects.*; (named, )?or ",
        "clear_named_or_half",
        1,
    ),
    (("histories",), r"clear effects named", "clear_named", 0),
    (("histories",), r"\.\.\. named, or half", "clear_named_or_half", 0),
    (("histories",), r"position or sensor", "position_right", 0),
    (("histories",), r"onset inside", "onsets_inside", 0),
    (("histories",), r"present size inside", "sizes_inside", 0),
    (("histories",), r"false alarms of a change", "change_alarms", 0),
    (("histories",), r"recorded maintenance", "maintenance_alarms", 0),
    (("histories",), r"sites with a wrong name", "wrong_names", 0),
    (("histories",), r"sites that falsely differ", "file_alarms", 0),
    (("histories",), r"sites without an answer", "no_answer", 0),
    (("histories",), r"naming efficiency, a gap", "enough_named", 0),
]
ORDINALS = (
    "seventh eighth ninth tenth eleventh twelfth thirteenth fourteenth fifteenth sixteenth seventeenth eighteenth "
    "nineteenth twentieth twenty-first twenty-second twenty-third twenty-fourth twenty-fifth twenty-sixth "
    "twenty-seventh twenty-eighth twenty-ninth thirtieth thirty-first thirty-second thirty-third thirty-fourth "
    "thirty-fifth"
).split()


def text_of(page):
    """Text of a page without marks of bold type."""
    return (ROOT / page).read_text(encoding="utf-8").replace("**", "")


def fractions(line):
    """(number, number of all) of each "a of b" and "a in b"."""
    return [(int(k), float(n)) for k, _, n in FRACTION.findall(line)]


def unexplained_intervals(line, sums):
    """Stated intervals that are none of the sums, which have the same order."""
    remaining, unexplained = list(sums), []
    for low, high in INTERVAL.findall(line):
        while remaining:
            exact = remaining.pop(0).interval()
            if is_rounded(high, exact[1]) and (not low or is_rounded(low, exact[0])):
                break
        else:
            unexplained.append((low, high))
    return unexplained


def section_of(kind, row):
    """Text of the section of a set, "" if it shares one with others."""
    page = {"plain": "docs/blind_sets.md", "crossing": "docs/blind_crossing.md"}.get(kind, "docs/blind_histories.md")
    sections = re.split(r"^## ", text_of(page), flags=re.M)
    number = int(row["number"])
    if kind == "histories":
        title = f"The {ORDINALS[number - 7]} set\n"
        return next(s for s in sections if s.startswith(title)) if number >= 7 and row["cases"] else ""
    return next(s for s in sections if re.search(rf"`{row['set']}\w{{20}}", s))


@pytest.mark.parametrize(("page", "heading", "beginning", "sums"), LINES, ids=[f"{p}: {b}" for p, _, b, _ in LINES])
def test_each_pooled_fraction_and_interval_is_that_of_the_sealed_sets(page, heading, beginning, sums):
    lines = text_of(page).partition(heading.replace("**", ""))[2].splitlines()
    line = next(line for line in lines if line.startswith(beginning.replace("**", "")))
    assert fractions(line) == [(k, round(n)) for k, n in (s.counts() for s in sums)]
    assert unexplained_intervals(line, sums) == []


@pytest.mark.parametrize(("page", "heading", "rows"), TABLES, ids=[f"{page}: {heading}" for page, heading, _ in TABLES])
def test_no_row_of_a_pooled_table_is_without_a_sum(page, heading, rows):
    lines = text_of(page).partition(heading.replace("**", ""))[2].splitlines()
    table = list(takewhile(lambda x: x.startswith("|"), dropwhile(lambda x: not x.startswith("|"), lines)))
    assert len(table) > 2
    assert [line for line in table if fractions(line) and not line.startswith(tuple(rows))] == []


def test_the_numbers_of_sets_and_cases_are_those_of_the_files():
    blind, crossing, histories = (text_of(f"docs/{n}.md") for n in ("blind", "blind_crossing", "blind_histories"))
    plain_sets, plain_cases = size_of(("plain",))
    crossing_text = "{} sealed sets of {} cases".format(*size_of(("crossing",)))
    histories_text = "{} sealed sets of {} sites".format(*size_of(("histories",)))
    assert f"{plain_sets} sealed sets with {plain_cases} answers" in blind
    assert crossing_text in blind and crossing_text in crossing
    assert histories_text in blind and histories_text in histories
    assert f"two years, {size_of(('histories',))[1]} sites" in text_of("README.md")
    newer_sets, newer_cases = size_of(tuple(FIRST_RIGHT_DERIVATIVES), FIRST_RIGHT_DERIVATIVES)
    assert f"The {newer_sets} sets since the derivatives of passages are right have {newer_cases} cases" in blind
    n_sixty = size_of(("histories",), passages=15)[1]
    assert f"{n_sixty} have 60 passages" in blind and f"are {n_sixty} such sites" in histories


def test_the_table_of_the_naming_efficiency_has_the_rows_of_the_files():
    names = {"plain": "plain track", "crossing": "crossing panels"}
    expected = {
        f"{row['tool']}, {names[kind]}": [int(row[c]) for c in ("enough_of", "enough", "enough_named")]
        for kind in names
        for row in read_sets(kind)
        if row["enough"]
    }
    table = text_of("docs/blind.md").partition("## The naming efficiency")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (\w+, [a-z ]+) \| (\d+) \| (\d+) \| (\d+) \|$", table, re.M)
    assert {name: [int(n) for n in numbers] for name, *numbers in rows} == expected
    assert f"effects of the {len(expected)} sets of this table" in table


@pytest.mark.parametrize("kind", ["plain", "crossing", "histories"])
def test_a_row_of_the_files_has_the_figures_of_the_section_of_its_set(kind):
    differences = []
    for row in read_sets(kind):
        for line in re.findall(r"^\| (.*)", section_of(kind, row), re.M):
            for kinds, beginning, figure, which in ROWS:
                stated = fractions(line)
                if kind not in kinds or not stated or not re.match(beginning, line):
                    continue
                of_file = (row[figure], row[f"{figure}_of"])
                if "" in of_file or (int(of_file[0]), float(of_file[1])) != stated[which]:
                    differences.append((row["set"], line, figure, of_file))
    assert differences == []


@pytest.mark.parametrize("kind", ["plain", "crossing", "histories"])
def test_the_files_hold_possible_numbers_in_the_order_of_the_sets(kind):
    rows = read_sets(kind)
    assert all(int(a["number"]) <= int(b["number"]) for a, b in pairwise(rows))
    for row in rows:
        figures = [c for c in row if f"{c}_of" in row]
        assert all((row[c] == "") == (row[f"{c}_of"] == "") for c in figures)
        assert all(float(row[c]) <= float(row[f"{c}_of"]) for c in figures if row[c])


def test_intervals_are_compared_at_their_stated_decimals_and_in_order():
    sums = (Sum("alarms", ("plain",)), Sum("alarms", ("crossing",)))
    assert sums[0].interval() == tuple(100.0 * x for x in clopper_pearson(*sums[0].counts()))
    (low, high), other = (s.interval() for s in sums)
    first, second = f"({low:.1f} to {high:.1f} %)", f"({other[0]:.1f} to {other[1]:.0f} %)"
    assert unexplained_intervals(f"a {first}, b {second}", sums) == []
    assert unexplained_intervals(f"a (to {high:.1f} %)", sums) == []
    assert unexplained_intervals(f"a ({low + 0.1:.1f} to {high:.1f} %)", sums) == [(f"{low + 0.1:.1f}", f"{high:.1f}")]
    assert unexplained_intervals(f"b {second}, a {first}", sums) == [(f"{low:.1f}", f"{high:.1f}")]


def test_a_statement_of_other_sets_is_updated_and_one_of_these_sets_stays():
    sums = (Sum("alarms", ("plain",)), Sum("change_alarms", ("histories",)))
    before = [(2, 100), (3, 50.0)]
    (low, high), (rate_low, rate_high) = (s.interval(c) for s, c in zip(sums, before))
    old = (
        f"| **2 of 100** ({low:.1f} to {high:.1f} %); 4 names | "
        f"3 in 50 site-years ({rate_low:.2f} to {rate_high:.0f} % a year) |"
    )
    (k, n), (events, years) = (s.counts() for s in sums)
    (low, high), (rate_low, rate_high) = (s.interval() for s in sums)
    new = (
        f"| **{k} of {n:.0f}** ({low:.1f} to {high:.1f} %); 4 names | "
        f"{events} in {years:.0f} site-years ({rate_low:.2f} to {rate_high:.0f} % a year) |"
    )
    assert updated(old, sums) == new == updated(new, sums)
