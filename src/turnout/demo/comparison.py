"""Compare what the workflow found in the demonstration fleet with what is true of it, row by row.

The truth is read here for the first time: the workflow has no access to it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.constants import DAYS_PER_YEAR

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    import duckdb

REASON_OF_FAULT = {
    "cut_off": "truncated",
    "dead_channel": "dead_channel",
    "swapped_sign": "sign_reversed",
    "not_a_number": "not_finite",
}
IMPACT_FAULTS = {"double_hit": "double impacts", "overload": "overloaded impacts"}
FILES_QUERY = """
    select count(*), string_agg(distinct reason_code, ', ') from quarantine_open
    where regexp_matches(path, ?)"""
REJECTED_QUERY = """
    select status, coalesce(reason, '') from impacts_current i join recordings_current r using (recording_id)
    where regexp_matches(r.path, ?) and i.record = ?"""
ALARM_QUERY = """
    select change_pct, since_at_utc, state from whole where turnout_id = ? and section_id = ? and band = ?"""
WORK_QUERY = """
    select gain_pct, gain_low_pct, gain_high_pct from maintenance_effect
    where section_id = ? and band = ? and event_at_utc::date = ?"""
FINDING_QUERY = """
    select sentence from findings_newest where turnout_id = ? and verdict = 'named' and sections like '%' || ? || '%'"""

CHANGE_QUERY = """
    select split_part(sentence, '; ', 1) from change_findings
    where turnout_id = ? and list_contains(string_split(sections, ', '), ?)"""


@dataclass(frozen=True)
class Comparison:
    """One fault or change of the fleet: where, what is true, and what was found."""

    where: str
    truth: str
    found: str


def compare(connection: duckdb.DuckDBPyConnection, truth: Path, worklist: str) -> list[Comparison]:
    """A row per change, hanging sleeper and fault of a file, and one for each kind of faulty impact.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
        An open registry.
    truth : Path
        Folder of the truth.
    worklist : str
        SQL of the whole worklist of the day, such as ``whole_list(day)``.

    Returns
    -------
    list of Comparison
        Changes with their diagnoses first, then files, then impacts, then alarms where nothing changed.
    """
    connection.execute(f"create or replace temp table whole as select * from {worklist}")
    turnouts = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(truth.glob("*.json"))]
    turnouts = [content for content in turnouts if "changes" in content]
    rows, changed = [], set()
    for content in turnouts:
        for change in _changes(content):
            rows.append(_change_row(connection, content, *change))
            if not change[-1]:  # of what nobody has noted, the diagnosis of its alarm
                rows.append(_diagnosis_row(connection, content["turnout"], *change[:3]))
            changed.add((content["turnout"], *change[:2]))
        if weld := content.get("weld"):
            rows.append(_weld_row(connection, content, weld))
            changed.add((content["turnout"], weld["section"], "amplitude"))
    for content in turnouts:
        rows += [_file_row(connection, content["days"], *fault) for fault in content["file_faults"]]
    rows += _impact_rows(connection, truth)
    query = "select turnout_id, section_id, band from whole where state = 'inspect this week'"
    alarms = [(turnout, _label(section), band) for turnout, section, band in connection.execute(query).fetchall()]
    further = [alarm for alarm in alarms if alarm not in changed]
    sections = _with_neighbours(connection, {chart[:2] for chart in changed})
    beside, elsewhere = ([a for a in further if (a[:2] in sections) is inside] for inside in (True, False))
    return [
        *rows,
        Comparison("other charts there and beside", "may follow from these changes", _alarms_text(beside)),
        Comparison("all other sections", "no change", _alarms_text(elsewhere)),
    ]


def _with_neighbours(connection: duckdb.DuckDBPyConnection, sections: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """(turnout, label) of these sections and of those that are diagnosed with them."""
    groups = connection.execute("select turnout_id, string_split(sections, ', ') from change_findings").fetchall()
    near = [{(turnout, label) for label in labels} for turnout, labels in groups]
    return sections.union(*(group for group in near if group & sections))


def _alarms_text(alarms: Sequence[tuple[str, str, str]]) -> str:
    names = ", ".join(f"{turnout}/{section} {band.replace('_', ' ')}" for turnout, section, band in alarms)
    return f"{len(alarms)} alarm{'' if len(alarms) == 1 else 's'}{names and ': '}{names}"


def comparison_table(rows: Sequence[Comparison]) -> str:
    """The rows as text in three columns.

    Parameters
    ----------
    rows : sequence of Comparison
        From ``compare``.

    Returns
    -------
    str
        A head and a line per row.

    Examples
    --------
    >>> print(comparison_table([Comparison("W1 A8", "dead channel", "dead_channel")]))
    where  true          found
    W1 A8  dead channel  dead_channel
    """
    cells = [("where", "true", "found"), *((row.where, row.truth, row.found) for row in rows)]
    widths = [max(len(row[column]) for row in cells) for column in (0, 1)]
    return "\n".join(f"{a:<{widths[0]}}  {b:<{widths[1]}}  {c}".rstrip() for a, b, c in cells)


def _label(section_id: str | None) -> str:
    return (section_id or "").rpartition("/")[2]


def _changes(content: dict[str, Any]) -> Iterator[tuple[str, str, str, str]]:
    """(section, band, words, day of the maintenance or "") of each change of one turnout."""
    last = date.fromisoformat(content["days"][-1])
    for change in content["changes"]:
        years = (last - date.fromisoformat(change["since"])).days / DAYS_PER_YEAR
        stiffness = 100.0 * (change["step"] * (1.0 + change["per_year"]) ** years - 1.0)
        cause = f", {change['event'].replace('_', ' ')}" if change["event"] else ""
        words = f"stiffness {stiffness:+z.0f} % by {last}, from {change['since']}{cause}"
        yield change["section"], change["component"], words, change["since"] if change["event"] else ""
    for section, gaps in content["gaps_m"].items():
        since = next((day for day, gap in zip(content["days"], gaps) if gap > 0.0), None)
        if since:
            yield section, "ballast", f"hanging sleeper, {1e3 * gaps[-1]:.1f} mm by {last}, first on {since}", ""


def _change_row(
    connection: duckdb.DuckDBPyConnection, content: dict[str, Any], section: str, band: str, words: str, work: str
) -> Comparison:
    turnout = content["turnout"]
    where, section_id = f"{turnout} {section} {band}", f"{turnout}/{section}"
    if work:
        effect = connection.execute(WORK_QUERY, [section_id, band, work]).fetchone()
        if effect is None or effect[0] is None:
            return Comparison(where, words, "no campaigns on both sides of the work")
        gain, low, high = effect
        interval = "" if low is None or high is None else f" ({low:+z.1f} to {high:+z.1f})"
        return Comparison(
            where, words, f"frequency {gain:+z.1f} %{interval}, stiffness about {_stiffness(gain):+z.0f} %"
        )
    alarm = connection.execute(ALARM_QUERY, [turnout, section_id, band]).fetchone()
    if alarm is None or alarm[0] is None:
        return Comparison(where, words, "nothing" if alarm is None else alarm[2])
    change, since, state = alarm
    from_day = f", from {since:%Y-%m-%d}" if since else ""
    found = f"{state}: frequency {change:+z.1f} %, stiffness about {_stiffness(change):+z.0f} %{from_day}"
    finding = connection.execute(FINDING_QUERY, [turnout, section]).fetchone()
    return Comparison(where, words, found + (f"; diagnosis: {finding[0]}" if finding else ""))


def _diagnosis_row(connection: duckdb.DuckDBPyConnection, turnout: str, section: str, _: str, words: str) -> Comparison:
    """What the alarm of a section is said to rest on; a diagnosis that names nothing says why."""
    row = connection.execute(CHANGE_QUERY, [turnout, section]).fetchone()
    return Comparison(f"{turnout} {section} diagnosis", words, "no diagnosis" if row is None else row[0])


def _weld_row(connection: duckdb.DuckDBPyConnection, content: dict[str, Any], weld: dict[str, Any]) -> Comparison:
    """A weld that becomes a dip: what the weekly peak accelerations of the trains show of it."""
    depth, last, section = 1e3 * weld["depth_on_last_day"], content["days"][-1], weld["section"]
    words = f"weld at {weld['position']:g} m dips by {depth:.2f} mm by {last}, from {weld['since']}"
    where = f"{content['turnout']} {section} trains"
    alarm = connection.execute(ALARM_QUERY, [content["turnout"], f"{content['turnout']}/{section}", "amplitude"])
    row = alarm.fetchone()
    if row is None or row[0] is None:
        return Comparison(where, words, "nothing" if row is None else row[2])
    change, since, state = row
    from_day = f", from {since:%Y-%m-%d}" if since else ""
    return Comparison(where, words, f"{state}: weekly peak acceleration {change:+z.0f} %{from_day}")


def _stiffness(frequency_pct: float) -> float:
    """Change of stiffness [%] that moves a resonance by so much, for a constant mass."""
    return 100.0 * ((1.0 + frequency_pct / 100.0) ** 2 - 1.0)


def _file_row(
    connection: duckdb.DuckDBPyConnection,
    days: Sequence[str],
    turnout: str,
    campaign: int,
    section: str,
    test: int,
    fault: str,
) -> Comparison:
    path = f"{turnout}/hammer/{days[campaign] if campaign < len(days) else '-'}/{section}_{test}[.]"
    n, reasons = connection.execute(FILES_QUERY, [path]).fetchall()[0]
    if not n:
        reasons = connection.execute(
            "select string_agg(distinct reason, ', ') from impacts_current i join recordings_current r "
            "using (recording_id) where i.status = 'rejected' and regexp_matches(r.path, ?)", [path],
        ).fetchall()[0][0]  # fmt: skip
    where = f"{turnout} {section}, test {test}"
    expected = REASON_OF_FAULT[fault]
    right = expected in (reasons or "").split(", ")
    return Comparison(
        where, fault.replace("_", " "), f"{reasons or 'nothing'}" + ("" if right else " (another reason)")
    )


def _impact_rows(connection: duckdb.DuckDBPyConnection, truth: Path) -> Iterator[Comparison]:
    """How many of the double and overloaded impacts were rejected."""
    for fault, words in IMPACT_FAULTS.items():
        n_true = n_rejected = 0
        for path in sorted((truth / "impacts").glob("*.json")):
            turnout, day, section = path.stem.rsplit("_", 2)
            for impact in json.loads(path.read_text(encoding="utf-8")):
                if impact["fault"] == fault and not impact["file_fault"]:
                    file = f"{turnout}/hammer/{day}/{section}_{impact['test']}[.]"
                    status = connection.execute(REJECTED_QUERY, [file, impact["record"]]).fetchone()
                    n_true += status is not None
                    n_rejected += status is not None and status[0] == "rejected"
        yield Comparison("all turnouts", f"{n_true} {words}", f"{n_rejected} rejected")
