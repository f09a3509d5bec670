"""Values of the demonstration that pages contain agree with each other and with the text made from them."""

import re

import pytest
from benchmarks.passage_demonstration import text
from benchmarks.trend_demonstration import MARKS

# (page, pattern of its values, page that a run of the demonstration writes, pattern of the same values there)
REPEATED = {
    "spread of a chart": (
        "measuring.md",
        r"It is ([\d.]+) % for the ballast of `tommerup_s2/A8`",
        "trends.md",
        r"With this chart's spread of ([\d.]+) % a campaign",
    ),
    "onset of a dip": (
        "passages.md",
        r"dates the change to ([\d-]+) \(([\d-]+) to ([\d-]+), 95 %\)",
        "demonstration.md",
        r"tommerup_s2/ASM amplitude: .*, since ([\d-]+) \(([\d-]+) to ([\d-]+)\)",
    ),
    "stiffness of a chart": (
        "trends.md",
        r"`aarup_n4/ASM` of the demonstration the row states -(\d+) % \(-(\d+) to -(\d+)\)",
        "demonstration.md",
        r"aarup_n4/ASM ballast: .* the ballast lost (\d+) % of stiffness \((\d+) to (\d+), 95 %\)",
    ),
    "stiffness of a diagnosis": (
        "trends.md",
        r"the diagnosis -(\d+) % \(-(\d+) to -(\d+)\) at one hanging sleeper",
        "demonstration.md",
        r"aarup_n4 ASM: named. .* under impacts -(\d+) % \(-(\d+) to -(\d+), 95 %\)",
    ),
    "size in the list and in the chart": (
        "demonstration.md",
        r"tommerup_s2/A8 ballast: .* fell by ([\d.]+) % \([\d.]+ to [\d.]+, 95 %\), since ([\d-]+)",
        "trends.md",
        r"called a drift since (?=([\d-]+)).* its size -([\d.]+) %",
    ),
}


@pytest.mark.parametrize("what", REPEATED)
def test_a_repeated_value_is_that_of_the_run(what, repository):
    page, pattern, origin, original = REPEATED[what]
    found = re.search(pattern, (repository / "docs" / page).read_text(encoding="utf-8"))
    expected = re.search(original, (repository / "docs" / origin).read_text(encoding="utf-8"))
    assert found and expected, what
    assert sorted(found.groups()) == sorted(expected.groups())


def test_the_scores_of_trains_are_as_their_program_writes_them(repository):
    """Counts in sentences follow from the tables, and no line was edited by hand."""
    page = (repository / "docs" / "passages.md").read_text(encoding="utf-8")
    block = page.split(MARKS[0] + "\n")[1].split("\n" + MARKS[1])[0]
    sentence = re.sub("`.*?`", "", block.split("\n")[0])
    n, explained, no_impulse, accepted = map(int, re.findall(r"\d+", sentence))
    counts = {"null_explains": explained, "not_an_impulse": no_impulse, "accepted": accepted}
    assert sum(counts.values()) == n
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines() if line[0:2] == "| "]
    fits = [(c[0], c[1], *map(float, c[2:5]), int(c[5])) for c in cells if len(c) == 6 and c[0] != "section"]
    number = r"[+-][\d.]+"
    effects = [
        (c[0], *(tuple(map(float, re.findall(number, cell))) for cell in c[1:]))
        for c in cells if len(c) == 3 and c[0] != "section"
    ]  # fmt: skip
    assert len(fits) == len(effects) == 6
    assert text(counts, fits, effects) == block
