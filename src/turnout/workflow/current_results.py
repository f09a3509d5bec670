"""Read the current results of one turnout, for a stage that uses results of another stage."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from turnout.errors import TurnoutError
from turnout.workflow.batches import UnitResult, read_results
from turnout.workflow.state import batch_folder, load_state


class DamagedBatch(TurnoutError):
    """Results that another stage needs cannot be read; ``batch`` is their file.

    Parameters
    ----------
    batch : Path
        File of the results.
    error : Exception
        Why it cannot be read.
    """

    def __init__(self, batch: Path, error: Exception) -> None:
        super().__init__(f"{batch} cannot be read ({error}). The next run computes its units again.")
        self.batch = batch


def current_results(work: Path | str, stage: str, turnout: str) -> Iterator[UnitResult]:
    """Current results of one turnout: of each unit the one in the batch that the state names.

    Results in earlier batches are out of date. If the number of shards was changed, several states may contain the
    turnout; the one written last counts.

    Parameters
    ----------
    work : Path or str
        Folder ``work`` of the workflow.
    stage : str
        Name of the stage, as in ``work/<stage>``.
    turnout : str
        Id of the turnout.

    Yields
    ------
    UnitResult
        One result per unit.

    Raises
    ------
    DamagedBatch
        If a batch cannot be read.
    """
    states = sorted((Path(work) / stage).glob("*.json"), key=lambda p: (p.stat().st_mtime_ns, p.name), reverse=True)
    for state in states:
        batches = _batches(state, state.stat().st_mtime_ns).get(turnout)
        if not batches:
            continue
        for name in sorted(batches):
            yield from _read(batch_folder(state) / name, batches[name])
        return


def _read(batch: Path, units: frozenset[str]) -> Iterator[UnitResult]:
    import pyarrow as pa

    try:
        yield from read_results(batch, units)
    except (OSError, pa.ArrowException) as error:
        raise DamagedBatch(batch, error) from None


@lru_cache(maxsize=256)
def _batches(state: Path, written: int) -> dict[str, dict[str, frozenset[str]]]:
    """Turnout -> batch -> its current units."""
    by_turnout: dict[str, dict[str, set[str]]] = {}
    for unit, entry in load_state(state).units.items():
        by_turnout.setdefault(unit.split("/", 1)[0], {}).setdefault(entry.batch, set()).add(unit)
    return {t: {b: frozenset(units) for b, units in of.items()} for t, of in by_turnout.items()}
