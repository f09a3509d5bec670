"""Diagnose a turnout on request, and save its result until it is accepted or computed again."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from turnout.config import load_configuration, with_raw
from turnout.counts import first_texts
from turnout.errors import SimulationError
from turnout.files import write_text
from turnout.fingerprint import fingerprint
from turnout.registry.database import open_registry
from turnout.stages.budget import Watch
from turnout.stages.mismatch import Options, diagnose_visit
from turnout.stages.mismatch_groups import Group, unit_of, visits
from turnout.stages.mismatch_inputs import mismatch_context
from turnout.stages.renewals import since_renewal
from turnout.stages.work_days import work_days_of
from turnout.workflow.batches import decode, encode
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout.records import Unit


class ProgressBar(Protocol):
    """What a diagnosis tells of its progress."""

    def group(self, group: Group, number: int, count: int) -> Callable[[int, int, str], object]:
        """Begin a group; returns the callable that reports its joint fits.

        Parameters
        ----------
        group : Group
            Recordings that are judged together.
        number : int
            Number of the group, from 1.
        count : int
            Total number.

        Returns
        -------
        Callable[[int, int, str], object]
            The callable that reports its joint fits.
        """

    def simulations(self, count: int) -> None:
        """Called at every prediction.

        Parameters
        ----------
        count : int
            Total number.
        """


MAX_NAMED_VISITS = 12  # of those that an error lists
ALL_VISITS = "all"  # every visit in one case: effects of temperature or time need several


def diagnose_turnout(
    turnout_id: str,
    config: str | Path = "config",
    raw_root: str | Path = "raw",
    work: str | Path = "work",
    visit: str | None = None,
    track: str | None = None,
    sections: Sequence[str] = (),
    budget: float | None = None,
    bar: ProgressBar | None = None,
) -> dict[str, list[dict[str, Any]]]:
    """Rows by table of one visit of a turnout, by default the newest; "all" takes every visit as one.

    Parameters
    ----------
    turnout_id : str
        Id of the turnout.
    config : path
        Folder of the configuration.
    raw_root : path
        Folder of all recordings.
    work : path
        Folder of intermediate results.
    visit : str or None
        YYYY-MM-DD, YYYY-MM, or "all"; None: the newest.
    track : str or None
        Name or file of a track; None: the turnout's own.
    sections : sequence of str
        Labels of the sections, () for all.
    budget : float or None
        Seconds after which BudgetSpentError is raised; finished fits are stored.
    bar : object with ``group`` and ``simulations``, or None
        Called with the progress.

    Returns
    -------
    dict
        Table -> rows.

    Raises
    ------
    SimulationError
        The turnout has no recordings at all, no such visit or section, or no track file.
    """
    turnout = with_raw(load_configuration(config).turnout(turnout_id), Path(raw_root))
    if unknown := sorted(set(sections) - {s.label for s in turnout.sections}):
        labels = ", ".join(s.label for s in turnout.sections)
        raise SimulationError(f"{turnout_id} has no section {', '.join(unknown)}. Write some of {labels}.")
    by_visit = visits(scan(turnout, Path(raw_root)).units, work_days_of(turnout))
    if visit == ALL_VISITS:
        by_visit = since_renewal(turnout, by_visit)
    label, units = _visit(turnout_id, by_visit, visit, raw_root)
    unit = unit_of(turnout_id, label, units, turnout.hashes["mismatch"])
    _, passage_tables = mismatch_context(turnout_id, work=work)
    watch = Watch(None if budget is None else time.monotonic() + budget, bar.simulations if bar else None)
    options = Options(track, tuple(sections), str(Path(work) / "mismatch-fits"), watch, bar.group if bar else None)
    return diagnose_visit(unit, turnout, raw_root, passage_tables, fingerprint("turnout.stages.mismatch"), options)


def _visit(
    turnout_id: str, by_visit: Mapping[str, list[Unit]], requested: str | None, raw_root: str | Path
) -> tuple[str, list[Unit]]:
    if not by_visit:
        raise SimulationError(f"{turnout_id}: no hammer test and no passage below {raw_root}; one is needed.")
    if requested is None:
        return list(by_visit.items())[-1]
    if requested == ALL_VISITS:
        return list(by_visit)[-1], [unit for members in by_visit.values() for unit in members]
    if requested not in by_visit:
        newest = first_texts(list(by_visit)[::-1], MAX_NAMED_VISITS, others="earlier ones")
        raise SimulationError(f"{turnout_id} has no visit {requested!r}; its visits are, newest first, {newest}.")
    return requested, by_visit[requested]


class Results:
    """The last result of a turnout, below ``work`` or in the ``registry``."""

    def __init__(self, work: str | Path, turnout_id: str, registry: str | Path | None = None):
        self.turnout_id, self.registry = turnout_id, registry
        self.path = Path(work) / "mismatch-fits" / f"{turnout_id}.json"

    def save(self, tables: dict[str, list[dict]]) -> None:
        """Write the result below ``work``, behind a line with its SHA-256 by which an edit is seen.

        Parameters
        ----------
        tables : dict[str, list[dict]]
            Rows of each table by its name.
        """
        rows = encode(tables)
        write_text(self.path, f"{_hash_of(rows)}\n{rows}")

    def finding(self, finding_id: str | None = None) -> dict[str, Any]:
        """The finding with this id, or the only one with a term.

        Parameters
        ----------
        finding_id : str or None
            Id of a finding, or the sections of a change as in the worklist; by default the only one.

        Returns
        -------
        dict[str, Any]
            Row of ``mismatch_findings`` or ``change_findings``.

        Raises
        ------
        SimulationError
            There is none, or several, or the file below ``work`` is not as it was written.
        """
        changes = self._registry_rows("change_findings") if finding_id else []
        for change in changes:
            if change["sections"] == finding_id:
                return change
        rows = self._rows()
        if finding_id:
            chosen = [r for r in rows if r["finding_id"].startswith(finding_id)]
        else:
            chosen = [r for r in rows if r["term_json"]]
        if len(chosen) == 1:
            return chosen[0]
        overview = "; ".join(
            f"{r['finding_id'][:12]} {r['sections']}: {r['verdict']} {r['term'] or ''}".strip() for r in rows
        )
        if chosen:
            problem = (
                "several findings name an effect" if not finding_id else f"several findings begin with {finding_id}"
            )
        else:
            problem = f"there is no finding {finding_id}" if finding_id else "no finding names an effect"
        remedy = "Write one of them after --finding" if chosen or finding_id else "There is nothing to accept"
        raise SimulationError(f"{self.turnout_id}: {problem}. {remedy}. The findings are: {overview or 'none'}.")

    def _rows(self) -> list[dict[str, Any]]:
        """Rows saved below ``work`` or those of the registry, whichever are of newer recordings."""
        saved, registered = self._saved_rows(), self._registry_rows()
        if not saved and not registered:
            message = f"{self.turnout_id} has no result below {self.path.parent}, nor in the registry"
            raise SimulationError(f"{message}: run turnout diagnose --turnout {self.turnout_id} first.")
        return registered if _newest(registered) > _newest(saved) else saved

    def _saved_rows(self) -> list[dict[str, Any]]:
        try:
            seal, _, rows = self.path.read_bytes().decode("utf-8", "replace").partition("\n")
        except FileNotFoundError:
            return []
        if seal != _hash_of(rows):
            problem = "it is damaged, was edited, or is of an earlier version"
            raise SimulationError(f"{self.path}: {problem}. Run turnout diagnose --turnout {self.turnout_id} again.")
        return decode(rows)["mismatch_findings"]

    def _registry_rows(self, table: str = "findings_newest") -> list[dict[str, Any]]:
        """Newest findings of the turnout in the registry, [] without a registry."""
        if self.registry is None or not (Path(self.registry) / "registry.duckdb").exists():
            return []
        with open_registry(self.registry) as connection:
            cursor = connection.execute(f"from {table} where turnout_id = ?", [self.turnout_id])
            names = [d[0] for d in cursor.description]
            return [dict(zip(names, row)) for row in cursor.fetchall()]


def _hash_of(text: str) -> str:
    """SHA-256 of a text in UTF-8."""
    return hashlib.sha256(text.encode()).hexdigest()


def _newest(rows: Sequence[Mapping[str, Any]]) -> str:
    """Time of the newest finding as sortable text, "" without any."""
    return max((str(r["found_at_utc"]).replace("T", " ")[:19] for r in rows), default="")
