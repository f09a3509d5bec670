"""Compute one unit so that no fault stops the fleet."""

import logging
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from turnout.config import TurnoutConfig
from turnout.errors import (
    REMARK_REASONS,
    InstallationError,
    PartlyComputed,
    ReadError,
    installation_error,
    is_infrastructure,
)
from turnout.records import Unit
from turnout.registry.ids import content_id
from turnout.workflow.batches import UnitResult, encode
from turnout.workflow.scan import unit_id

LOG = logging.getLogger("turnout.workflow")


def compute_guarded(
    compute: Callable,
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: Path,
    key: str,
    algo: str,
    strict: bool,
    **extra: Any,
) -> UnitResult:
    """Compute a unit; a ReadError, and each record named by PartlyComputed, becomes a quarantine row.

    Any other exception is a fault of the program: it becomes a quarantine row with reason internal_error, with the
    traceback in the log.

    Parameters
    ----------
    compute : callable
        Function of the stage: (unit, turnout, raw_root, algo=...) -> tables.
    unit : Unit
        The unit.
    turnout : TurnoutConfig
        Configuration of its turnout.
    raw_root : Path
        The raw root.
    key : str
        Key of the result.
    algo : str
        Version of the code of the stage.
    strict : bool
        Raise faults of the program.
    **extra : any
        Further arguments of ``compute``.

    Returns
    -------
    UnitResult
        Tables with the status of the unit.

    Raises
    ------
    OSError
        For a fault of the machine (bad sector, disk full); MemoryError likewise.
    InstallationError
        If a package is missing or broken: every unit would fail, and none is the cause.
    """
    try:
        tables, faults = _compute(compute, unit, turnout, raw_root, algo=algo, **extra)
        for _, _, error in faults:
            if fault := installation_error(error):
                raise fault from error
            if strict:
                raise error
        rows = [_fault_row(unit, error, path, record) for path, record, error in faults]
        tables = {**tables, "quarantine": [*tables.get("quarantine", ()), *rows]} if rows else tables
        encode(tables)
    except ReadError as error:
        tables = {
            "quarantine": [quarantine_row(unit, error.path, error.reason, error.where, error.problem, error.remedy)]
        }
    except InstallationError:
        raise
    except Exception as error:
        if fault := installation_error(error):
            raise fault from error
        if strict or is_infrastructure(error):
            raise
        tables = {"quarantine": [_fault_row(unit, error)]}
    return UnitResult(unit_id(unit), unit.turnout, unit.kind, key, algo, status_of(tables), tables)


def death_rows(unit: Unit, *_: Any, **__: Any) -> dict[str, list[dict]]:
    """Rows of a unit whose process dies each time it is computed.

    Parameters
    ----------
    unit : Unit
        The unit.
    *_ : any
        Not used: the arguments of a function of a stage.
    **__ : any
        Not used.

    Returns
    -------
    dict of str to list of dict
        One quarantine row.
    """
    finding = "the process died that computed it, and again where it was computed alone"
    remedy = (
        "Look in the log of the machine whether the memory was exhausted, and check that the files are complete; "
        "the unit is tried again when one of its files is touched, or the program changes"
    )
    return {
        "quarantine": [quarantine_row(unit, _first_of(unit), "internal_error", "a process of its own", finding, remedy)]
    }


def memory_rows(unit: Unit, *_: Any, **__: Any) -> dict[str, list[dict]]:
    """Rows of a unit for which the memory did not suffice in two runs.

    Parameters
    ----------
    unit : Unit
        The unit.
    *_ : any
        Not used: the arguments of a function of a stage.
    **__ : any
        Not used.

    Returns
    -------
    dict of str to list of dict
        One quarantine row.
    """
    finding = "its computation needed more memory than the machine gave, in two runs"
    remedy = (
        "Copy its files again if their size is not what the logger writes; else give the job more memory and touch one "
        "of them, so that the unit is tried again"
    )
    return {"quarantine": [quarantine_row(unit, _first_of(unit), "too_large", "the unit", finding, remedy)]}


def unreadable_rows(unit: Unit, faults: Mapping[str, str]) -> list[dict]:
    """Quarantine rows of files that the machine could not read in two runs.

    Parameters
    ----------
    unit : Unit
        The unit.
    faults : mapping of str to str
        Path of a file -> fault; the path "" stands for the unit as a whole.

    Returns
    -------
    list of dict
        One row per fault.
    """
    remedy = (
        "Look after the disk or the network that it lies on, or copy it again to another place there; every run tries "
        "it again"
    )
    return [
        quarantine_row(unit, path or _first_of(unit), "read_fault", "the file" if path else "the unit", fault, remedy)
        for path, fault in sorted(faults.items())
    ]


def _compute(
    compute: Callable, *args: Any, **extra: Any
) -> tuple[dict[str, list[dict]], Sequence[tuple[str, int, Exception]]]:
    """(tables, faults); the faults of single records do not affect the rows of the others."""
    try:
        return compute(*args, **extra), ()
    except PartlyComputed as partial:
        return partial.tables, partial.faults


def status_of(tables: dict[str, list[dict]]) -> str:
    """Status of a unit from its rows: "ok", "partly", "quarantined" or "internal_error"; remarks do not count.

    Parameters
    ----------
    tables : dict of str to list of dict
        Table -> rows of the unit.

    Returns
    -------
    str
        The status.

    Examples
    --------
    >>> status_of({"quarantine": [{"reason_code": "truncated"}], "recordings": [{}]})
    'partly'
    """
    reasons = {row.get("reason_code") for row in tables.get("quarantine", ())} - REMARK_REASONS
    if "internal_error" in reasons:
        return "internal_error"
    if not reasons:
        return "ok"
    return "partly" if any(rows for table, rows in tables.items() if table != "quarantine") else "quarantined"


def quarantine_row(
    unit: Unit, path: str, reason: str, where: str, finding: str, remedy: str, record: int | None = None
) -> dict:
    """Row of ``quarantine`` for a unit as a whole, or for one record of it.

    Parameters
    ----------
    unit : Unit
        The unit.
    path : str
        File, relative to the raw root.
    reason : str
        A key of ``turnout.reasons.REASONS``.
    where : str
        Record, channel or line in the file.
    finding : str
        What is wrong there.
    remedy : str
        What to do.
    record : int or None
        Record from 0; None: the unit as a whole.

    Returns
    -------
    dict
        The row, with its id.
    """
    row = {
        "quarantine_id": content_id("quarantine", path, str(record), unit.kind, reason, finding),
        "turnout_id": unit.turnout,
        "section_id": f"{unit.turnout}/{unit.section}" if unit.section else None,
        "kind": unit.kind,
        "path": path,
        "stage": unit.kind,
        "reason_code": reason,
        "place": where,
        "found": finding,
        "remedy": remedy,
    }
    return row if record is None else row | {"record": record}


def _fault_row(unit: Unit, error: Exception, path: str | None = None, record: int | None = None) -> dict:
    """Quarantine row of a fault of the program; its trace has no machine paths, so it is the same everywhere."""
    LOG.error("%s: internal error\n%s", unit_id(unit), "".join(traceback.format_exception(error)))
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename != __file__]
    trace = " < ".join(f"{Path(f.filename).name}:{f.lineno} {f.name}" for f in reversed(frames[-6:]))
    finding = f"{type(error).__name__}: {error}"[:500]
    remedy = "Report it with the log of the run; the unit is tried again when its files or the program change"
    return quarantine_row(unit, path or _first_of(unit), "internal_error", trace, finding, remedy, record)


def _first_of(unit: Unit) -> str:
    """Path in a row that concerns no single file."""
    return unit.files[0][0] if unit.files else unit.turnout
