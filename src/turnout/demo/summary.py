"""Print the results of a run in a few lines, and queries to try next."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.demo.comparison import compare, comparison_table
from turnout.registry.as_of import list_day, whole_list
from turnout.registry.database import open_registry

if TYPE_CHECKING:
    from collections.abc import Callable

QUESTIONS = (
    (
        "How did a resonance move?",
        "select measured_at_utc, frequency_hz, frequency_se_hz from section_trend('tommerup_s2/A8', 'ballast')",
    ),
    ("Which turnouts need a look tomorrow?", "select * from worklist"),
    ("What was not used, and why?", "select reason, count(*) as n from impacts_current group by all order by n desc"),
)
COUNTS_QUERY = """
    select
        (select count(*) from recordings_current) as recordings,
        (select count(*) from impacts_current) as impacts,
        (select count(*) from impacts_current where status = 'rejected') as rejected,
        (select count(*) from models_current where status <> 'rejected') as models,
        (select count(*) from models_current where status = 'rejected') as models_rejected,
        (select count(*) from quarantine_open) as quarantined,
        (select count(*) from passages_current) as passages
"""
QUARANTINE_QUERY = """
    select path, reason_code, min_by(found, coalesce(record, -1)), count(*) from quarantine_open
    group by all order by path limit 8
"""
DIAGNOSES_QUERY = """
    select turnout_id || ' ' || sections, verdict, sentence from change_findings
    order by list_position(['named', 'a_or_b', 'unknown', 'none', 'no_decision'], verdict), turnout_id, sections
"""
WORKLIST_QUERY = "select coalesce(section_id, turnout_id), band, state, sentence from worklist order by rank limit 5"


def print_summary(
    registry: Path | str,
    pages: Path | str,
    say: Callable[[str], object] = print,
    day: str | None = None,
    truth: Path | str | None = None,
) -> None:
    """Print counts, quarantine, worklist, diagnoses of its alarms, found against true, pages, queries to try.

    Parameters
    ----------
    registry : path
        Folder of the registry.
    pages : path
        Folder of the pages.
    say : callable
        Called with each line of text.
    day : str or None
        Day of the comparison with the truth, YYYY-MM-DD; None: today.
    truth : path or None
        Folder of the truth; None: no comparison.
    """
    with open_registry(registry) as connection:
        counts = dict(zip((d[0] for d in connection.execute(COUNTS_QUERY).description), connection.fetchall()[0]))
        say(
            "   {recordings} recordings, {impacts} impacts of which {rejected} were rejected, {passages} passages\n"
            "   {models} models of a section and campaign, {models_rejected} rejected; "
            "{quarantined} rows in quarantine:".format(**counts)
        )
        for path, reason, observation, n in connection.execute(QUARANTINE_QUERY).fetchall():
            say(f"      {path}: {reason}, {observation}" + (f" ({n} such records)" if n > 1 else ""))
        rows = connection.execute(WORKLIST_QUERY).fetchall()
        diagnoses = connection.execute(DIAGNOSES_QUERY).fetchall()
        table = ""
        if truth is not None and Path(truth).is_dir():
            table = comparison_table(compare(connection, Path(truth), whole_list(list_day(connection, day))))
    say("\n   Worklist, first rows:" if rows else "\n   The worklist is empty.")
    for section, band, state, sentence in rows:
        say(f"      {section} {band}: {state}. {sentence}")
    if diagnoses:
        say("\n   What the open alarms rest on, by all hammer tests and the newest trains:")
    for where, verdict, sentence in diagnoses:
        say(f"      {where}: {verdict.replace('_', ' ')}. {sentence}")
    if table:
        say("\n   Found against true:\n      " + table.replace("\n", "\n      "))
    say(f"\n   Pages: {Path(pages).resolve() / 'index.html'}")
    say(f"   Registry: {registry}/registry.duckdb, for any tool that reads DuckDB. Three questions to try:")
    for question, sql in QUESTIONS:
        say(f'\n   {question}\n      {_command()} query "{sql}"')


def _command() -> str:
    """Command of this program: its name if it is on the path, else its file."""
    program = Path(sys.executable).parent / "turnout"
    on_path = str(program.parent) in os.environ.get("PATH", "").split(os.pathsep)
    return "turnout" if on_path else os.path.relpath(program)
