"""Find pages that are out of date, by one hash per turnout of everything that its page shows."""

from __future__ import annotations

import re
from hashlib import md5
from typing import TYPE_CHECKING

from turnout.fingerprint import fingerprint
from turnout.registry.as_of import whole_list

if TYPE_CHECKING:
    from pathlib import Path

    from turnout.report.source import FleetSource

# Rows that a page shows. The id of a result represents its models, modes, impacts, receptances and passages: it is a
# hash of the raw files, the configuration and the code that they were computed from.
PAGE_CONTENT = {
    "turnouts": "turnouts",
    "sections": "sections",
    "events": "events",
    "results": "(select turnout_id, result_id from results_current)",
    "quarantine": "quarantine_open",
    "charts": """(
        select turnout_id, section_id, band, measured_at_utc, expected_low_hz, expected_high_hz, state, deviation_pct,
            case source when 'passage' then residual_pct end as train_residual_pct
        from charts)""",
    "damping_charts": """(
        select turnout_id, section_id, band, measured_at_utc, expected_low_damping, expected_high_damping
        from damping_charts where source = 'hammer')""",
    "chart_states": "chart_states_on(:today)",
    "worklist": f"(select * exclude (rank, n_in_all) from {whole_list(':today')})",
}
HASH_MARK = '<meta name="turnout-content" content="{}">'
HASH_PATTERN = re.compile(re.escape(HASH_MARK).replace(r"\{\}", "([0-9a-f]+)"))
HEAD_LENGTH = 2000  # characters of a page that contain its hash


def page_hashes(source: FleetSource) -> dict[str, str]:
    """Hash of what the page of each turnout shows, including the code that draws it.

    Parameters
    ----------
    source : FleetSource
        The open registry.

    Returns
    -------
    dict of str
        32 hexadecimal digits by turnout. The order of rows does not matter, their number does.
    """
    totals: dict[str, list[str]] = {}
    for table, rows in sorted(PAGE_CONTENT.items()):  # one query each: all at once would take a multiple of the memory
        if not source.has(table):
            continue
        sql = f"""
            select turnout_id, count(*), sum(hash(r)::hugeint) from {rows} r semi join turnouts using (turnout_id)
            group by turnout_id"""
        for turnout, n, total in source.connection.execute(sql.replace(":today", source.day)).fetchall():
            totals.setdefault(turnout, []).append(f"{table} {n} {total}")
    code = fingerprint("turnout.report.job", "turnout.reasons")
    return {turnout: md5(f"{code}{','.join(texts)}".encode()).hexdigest() for turnout, texts in totals.items()}


def page_hash(path: str | Path) -> str | None:
    """Hash stored in a page.

    Parameters
    ----------
    path : str or Path
        File of the page.

    Returns
    -------
    str or None
        Hash; None if there is no page, or it is not from this program.
    """
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            match = HASH_PATTERN.search(file.read(HEAD_LENGTH))
    except FileNotFoundError:
        return None
    return match.group(1) if match else None
