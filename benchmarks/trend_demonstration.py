"""Write a paragraph on the true drift of the demonstration fleet: what the charts report, and how early they can.

``python -m benchmarks.trend_demonstration . docs/trends.md`` writes it between the marks in the page. The first
folder is that in which ``turnout demo`` was run. results/registry and truth/ are read; no job reads truth/.
"""

import json
import sys
from datetime import date, datetime, timedelta
from pathlib import Path

import numpy as np

from turnout.config.settings.trend import TrendSettings
from turnout.demo.scenario import Change
from turnout.registry.database import open_registry
from turnout.trend.cusum import cusum

MARKS = "<!-- demonstration: generated, do not edit -->", "<!-- end of demonstration -->"
QUESTION = """
select c.measured_at_utc, c.state, b.sd_pct, b.phi, b.guard, b.allowance, b.threshold_down, s.state, s.since_at_utc,
    s.since_earliest_utc, s.since_latest_utc, s.change_kind, s.change_pct, s.change_low_pct, s.change_high_pct,
    (select min(a.raised_at_utc) from alarms a where a.section_id = c.section_id and a.band = c.band
        and a.direction = 'down' and a.raised_at_utc >= ?) as raised,
    (select min(w.rank) from worklist w where w.section_id = c.section_id and w.band = c.band) as place,
    (select count(*) from worklist w where w.state = 'inspect this week') as n_inspect
from charts c
join baselines b using (turnout_id, section_id, band, source, epoch)
join chart_status s using (turnout_id, section_id, band, source)
where c.section_id = ? and c.band = ? and c.source = 'hammer' and c.state <> 'wrong_time'
order by c.measured_at_utc
"""


def true_drifts(truth: Path):
    """(section id, band, change) of every true drift that no event explains."""
    for path in sorted(Path(truth).glob("*.json")):
        content = json.loads(path.read_text(encoding="utf-8"))
        for entry in content.get("changes", []) if isinstance(content, dict) else []:
            if entry["per_year"] and not entry["event"]:
                change = Change(**entry | {"since": date.fromisoformat(entry["since"]), "until": None})
                yield f"{content['turnout']}/{change.section}", change.component, change


def chances(times, change, spread, phi, guard, allowance, threshold, n=20_000, seed=1):
    """(share of simulated charts in alarm by each campaign since the onset, true change of frequency [%]).

    Spread, autocorrelation, guard and threshold are those of the chart. Frequency follows the root of the stiffness.
    """
    share = TrendSettings().single_share
    truth = np.array([100.0 * (np.sqrt(change.factor(t.date())) - 1.0) for t in times])
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((n, len(times)))
    for i in range(1, len(times)):
        noise[:, i] = phi * noise[:, i - 1] + np.sqrt(1 - phi**2) * noise[:, i]
    widening = np.sqrt((1 + phi) / (1 - phi))
    z = (truth[None] + spread * noise) / (spread * guard * widening)
    k = np.full(z.shape, allowance)
    outlier = np.full(z.shape, min(share * threshold + allowance, TrendSettings().outlier_limit))
    chart = (k, np.full(n, threshold), outlier, np.full(n, share * threshold))
    _, opened, _ = cusum(z, *chart, np.ones(z.shape, bool), np.zeros(z.shape, bool))
    return np.maximum.accumulate(opened, axis=1).mean(axis=0), truth


def paragraph(folder) -> str:
    """The paragraph of the page, with figures from the registry or computed from its chart."""
    sentences = []
    with open_registry(Path(folder) / "results" / "registry") as con:
        for section, band, change in true_drifts(Path(folder) / "truth"):
            since = datetime.combine(change.since, datetime.min.time())
            rows = con.execute(QUESTION, [since - timedelta(days=1), section, band]).fetchall()
            if rows:
                sentences.append(_sentences(section, band, change, since, rows))
    return "\n".join(sentences)


def _sentences(section, band, change, since, rows) -> str:
    times = [row[0] for row in rows]
    spread, phi, guard, allowance, threshold, state = rows[-1][2:8]
    first, early, late, shape, size, low, high, raised, rank, n_inspect = rows[-1][8:]
    after = [t for t in times if t >= since]
    alarm_share, truth = chances(after, change, spread, phi, guard, allowance, threshold)
    half, most = (int(np.argmax(alarm_share >= p)) + 1 if alarm_share.max() >= p else None for p in (0.5, 0.95))
    spacing = float(np.median(np.diff(times)) / timedelta(days=1))
    sentences = [
        f"On the demonstration fleet ({len(times)} campaigns of this chart, {spacing:.0f} days apart; raw files "
        f"through the whole workflow) the stiffness of the {band} at `{section}` falls by "
        f"{-100 * change.per_year:.0f} % a year from {change.since}. Its frequency has lost {-truth[-1]:.1f} % by the "
        f"newest campaign, {times[-1]:%Y-%m-%d}.",
        f"It is number {rank} of the list, which asks for {n_inspect} inspection{'s' * (n_inspect != 1)}."
        if rank
        else f"It is not on the list (state {state}).",
    ]
    if raised:
        count = sum(since <= t <= raised for t in times)
        sentences.append(f"The alarm came with campaign number {count} after the onset, on {raised:%Y-%m-%d}.")
    soon = f"half of such charts are in alarm by campaign {half}" if half else "fewer than half are in alarm today"
    sure = f"95 % by campaign {most}" if most else "95 % not yet"
    sentences.append(
        f"With this chart's spread of {spread:.2f} % a campaign ({phi:.2f} memory) {soon} after the onset and {sure}. "
        f"A single campaign raises no alarm."
    )
    if first:
        date_ok = early <= since <= late
        inside = low <= truth[-1] <= high
        sentences.append(
            f"The change is called a {shape} since {first:%Y-%m-%d}, 95 % between {early:%Y-%m-%d} and {late:%Y-%m-%d} "
            f"({'which holds' if date_ok else 'which misses'} the true day), and its size {size:+.1f} % ({low:+.1f} to "
            f"{high:+.1f}), which {'holds' if inside else 'misses'} the true one."
        )
    return " ".join(sentences)


def write(page: Path, text: str) -> None:
    """Put the paragraph between the marks of the page."""
    before, tail = page.read_text(encoding="utf-8").split(MARKS[0])
    after = tail.split(MARKS[1])[1]
    page.write_text(f"{before}{MARKS[0]}\n{text}\n{MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    output = paragraph(sys.argv[1])
    print(output)
    if len(sys.argv) > 2:
        write(Path(sys.argv[2]), output)
