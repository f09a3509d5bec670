"""Write the scores of the trains of the demonstration: how often the null explains them, Table 4, load and speed.

``python -m benchmarks.passage_demonstration . docs/passages.md`` writes them between the marks in the page. The first
folder is that in which ``turnout demo`` was run.
"""

import sys
from pathlib import Path

from benchmarks.trend_demonstration import write
from turnout.registry.database import open_registry
from turnout.report.paper_tables import paper_tables

TURNOUT = "tommerup_s2"
STATUS_SQL = "select status, count(*) as n from passage_scores where turnout_id = '{}' group by all order by n desc"
EFFECTS_SQL = "select section_id, factor, change_pct, low_pct, high_pct from fit_effects where score = 'fit'"
CAMPAIGN_SQL = "select campaign_id from campaigns where turnout_id = ? order by started_at_utc desc limit 1"
FACTORS = "speed", "axle load"


def registry_rows(registry):
    """(counts by status, rows of Table 4, rows of the effects) of the demonstration."""
    with open_registry(registry) as con:
        counts = dict(con.execute(STATUS_SQL.format(TURNOUT)).fetchall())
        campaign = con.execute(CAMPAIGN_SQL, [TURNOUT]).fetchone()[0]
        table = paper_tables(con, TURNOUT, campaign)[3]
        main = [(row[0], str(row[5]), *(row[k].value for k in (7, 9, 11)), row[6]) for row in table.rows if row[6]]
        effects = con.execute(EFFECTS_SQL).fetchall()
    by_section: dict[str, dict] = {}
    for section, factor, *interval in effects:
        by_section.setdefault(section.split("/")[1], {})[factor] = tuple(interval)
    return counts, main, sorted((section, *(of[f] for f in FACTORS)) for section, of in by_section.items())


def text(counts, fits, effects) -> str:
    """The block of the page: ``counts`` by status, ``fits`` of Table 4, ``effects`` of speed and load per section."""
    n = sum(counts.values())
    intervals = [interval for row in effects for interval in row[1:]]
    n_clear = sum(low > 0.0 or high < 0.0 for _, low, high in intervals)
    lines = [
        f"Of {n} scores at the sensors of `{TURNOUT}` the null explains {counts['null_explains']}; "
        f"{counts.get('not_an_impulse', 0)} are `not_an_impulse` and {counts.get('accepted', 0)} `accepted`",
        f"(`{STATUS_SQL.format(TURNOUT)}`).",
        "",
        "IC3 trains at 160 km/h on the main track, mean ± standard deviation over the trains [%] "
        f"(`turnout paper {TURNOUT} --table 4`):",
        "",
        "| section | fit | random models, 95 % | forecast | random models, 95 % | n |",
        "|---|---|---|---|---|---|",
        *(f"| {s} | {fit} | {null:.1f} | {ahead:.1f} | {limit:.1f} | {k} |" for s, fit, null, ahead, limit, k in fits),
        "",
        f"Change of the fit with the other factors held fixed, in points with its 95 % interval (`{EFFECTS_SQL}`):",
        "",
        "| section | per 10 km/h | per tonne |",
        "|---|---|---|",
        *(f"| {s} | {' | '.join('{:+.2f} ({:+.2f} to {:+.2f})'.format(*i) for i in row)} |" for s, *row in effects),
        "",
        f"{n_clear} of these {len(intervals)} intervals do not contain 0.",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    output = text(*registry_rows(Path(sys.argv[1]) / "results" / "registry"))
    print(output)
    if len(sys.argv) > 2:
        write(Path(sys.argv[2]), output)
