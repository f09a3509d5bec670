"""Write the example outputs of docs/recipes.md: each is that of the query above it, on the demonstration registry.

``python -m benchmarks.trend_recipes . docs/recipes.md`` writes them between the marks of the page. The first folder is
that in which ``turnout demo`` was run.
"""

import sys
from pathlib import Path

from turnout.cli.query import format_table
from turnout.registry.database import open_registry

MARKS = "<!-- examples: generated, do not edit -->", "<!-- end of examples -->"
DRIFT = "section_id = 'tommerup_s2/A8' and band = 'ballast'"
QUERIES = {
    "The list, in short": "select rank, turnout_id, sections, band, state, round(change_pct, 1) as change_pct, "
    "strftime(since_at_utc, '%Y-%m-%d') as since from worklist limit 4",
    "Where can we not tell, and why": "select section_id, band, why from cannot_see() where turnout_id = 'aarup_n4' "
    "order by all limit 3",
    "Before and after an exchange of pads, on residuals": "select section_id, band, n_before, n_after, "
    "round(change_pct, 2) as change_pct, round(change_se_pct, 2) as se_pct, changed "
    "from change_since_event('pad_exchange', 200) order by section_id, band",
    "The sums of one chart": "select measured_at_utc::date as day, round(z, 2) as z, round(cusum_down, 2) as sum, "
    f"round(threshold_down, 2) as h, state from cusum(timestamp '2025-06-01') where {DRIFT} order by day",
    "When is the limit reached": "select section_id, band, round(change_pct, 1) as change_pct, words "
    "from time_to_threshold",
}


def examples(registry) -> str:
    """Every query with its output."""
    texts = []
    with open_registry(registry) as con:
        for title, sql in QUERIES.items():
            texts.append(f"{title}:\n\n```sql\n{sql}\n```\n```text\n{format_table(con.sql(sql))}\n```\n")
    return "\n".join(texts)


if __name__ == "__main__":
    page = Path(sys.argv[2])
    before, tail = page.read_text(encoding="utf-8").split(MARKS[0])
    after = tail.split(MARKS[1])[1]
    output = examples(Path(sys.argv[1]) / "results" / "registry")
    page.write_text(f"{before}{MARKS[0]}\n{output}{MARKS[1]}{after}", encoding="utf-8")
