"""Diagnose a turnout on request, and save its result until it is accepted or computed again."""

import time
from pathlib import Path

from turnout.config import load_configuration, with_raw
from turnout.errors import SimulationError
from turnout.files import write_text
from turnout.fingerprint import fingerprint
from turnout.registry.database import open_registry
from turnout.stages.accepted_effects_case import Watch
from turnout.stages.mismatch import Options, diagnose_visit
from turnout.stages.mismatch_groups import unit_of, visits
from turnout.stages.mismatch_inputs import mismatch_context
from turnout.workflow.batches import decode, encode
from turnout.workflow.scan import scan

ALL = "all"  # every visit in one case: effects of temperature or time need several


def diagnose_turnout(
    turnout_id, config="config", raw_root="raw", work="work", visit=None, track=None, sections=(), budget=None, bar=None
):
    """Rows by table of one visit of a turnout, by default the newest; "all" takes every visit as one.

    Parameters
    ----------
    budget : float or None
        Seconds after which BudgetSpentError is raised; finished fits are stored.
    bar : object with ``group`` and ``simulations``, or None
        Called with the progress.

    Raises
    ------
    SimulationError
        The turnout has no recordings at all, no such visit or section, or no track file.
    """
    turnout = with_raw(load_configuration(config).turnout(turnout_id), Path(raw_root))
    if unknown := sorted(set(sections) - {s.label for s in turnout.sections}):
        raise SimulationError(f"{turnout_id} has no section {', '.join(unknown)}.")
    label, units = _visit(turnout_id, visits(scan(turnout, Path(raw_root)).units), visit, raw_root)
    unit = unit_of(turnout_id, label, units, turnout.hashes["mismatch"])
    _, told = mismatch_context(turnout_id, work=work)
    watch = Watch(None if budget is None else time.monotonic() + budget, bar.simulations if bar else None)
    options = Options(track, tuple(sections), str(Path(work) / "mismatch-fits"), watch, bar.group if bar else None)
    return diagnose_visit(unit, turnout, raw_root, told, fingerprint("turnout.stages.mismatch"), options)


def _visit(turnout_id, found, wanted, raw_root):
    if not found:
        raise SimulationError(f"{turnout_id}: no hammer test and no passage below {raw_root}; nothing can be said.")
    if wanted is None:
        return list(found.items())[-1]
    if wanted == ALL:
        return list(found)[-1], [unit for members in found.values() for unit in members]
    if wanted not in found:
        raise SimulationError(f"{turnout_id} has no visit {wanted!r}; there are {', '.join(list(found)[-12:])}.")
    return wanted, found[wanted]


class Results:
    """The last result of a turnout, below ``work`` or in the ``registry``."""

    def __init__(self, work, turnout_id, registry=None):
        self.turnout_id, self.registry = turnout_id, registry
        self.path = Path(work) / "mismatch-fits" / f"{turnout_id}.json"

    def keep(self, tables):
        """Write the result below ``work``."""
        write_text(self.path, encode(tables))

    def finding(self, finding_id=None):
        """The finding with this id, or the only one with a term; SimulationError if that is ambiguous."""
        rows = self._rows()
        if finding_id:
            chosen = [r for r in rows if r["finding_id"].startswith(finding_id)]
        else:
            chosen = [r for r in rows if r["term_json"]]
        if len(chosen) == 1:
            return chosen[0]
        there = "; ".join(
            f"{r['finding_id'][:12]} {r['sections']}: {r['verdict']} {r['term'] or ''}".strip() for r in rows
        )
        wrong = "several findings carry a term" if chosen else "no such finding carries a term"
        raise SimulationError(f"{self.turnout_id}: {wrong}; say which with --finding. There are {there or 'none'}.")

    def _rows(self):
        """Rows saved below ``work`` or those of the registry, whichever are of newer recordings."""
        kept, registered = self._kept(), self._registered()
        if not kept and not registered:
            said = f"{self.turnout_id} has no result below {self.path.parent}, nor in the registry"
            raise SimulationError(f"{said}: run turnout diagnose --turnout {self.turnout_id} first.")
        return registered if _newest(registered) > _newest(kept) else kept

    def _kept(self):
        try:
            return decode(self.path.read_text(encoding="utf-8"))["mismatch_findings"]
        except FileNotFoundError:
            return []

    def _registered(self):
        """Newest findings of the turnout in the registry, [] without a registry."""
        if self.registry is None or not (Path(self.registry) / "registry.duckdb").exists():
            return []
        with open_registry(self.registry) as connection:
            cursor = connection.execute("from findings_newest where turnout_id = ?", [self.turnout_id])
            names = [d[0] for d in cursor.description]
            return [dict(zip(names, row)) for row in cursor.fetchall()]


def _newest(rows):
    """Time of the newest finding as sortable text, "" without any."""
    return max((str(r["found_at_utc"]).replace("T", " ")[:19] for r in rows), default="")
