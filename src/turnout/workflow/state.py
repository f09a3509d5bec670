"""Read and write the state of a shard: for each unit the key of its result and the batch that contains it."""

import json
import logging
import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from filelock import FileLock

from turnout.errors import TurnoutError
from turnout.files import is_truncated, write_text
from turnout.workflow.batches import is_readable, read_column

LOG = logging.getLogger("turnout.workflow")

# Status of units whose rows count, and of a unit whose files are gone and which has no rows.
WITH_ROWS, VANISHED = ("ok", "partly"), "vanished"
ELSEWHERE_MARK = "-"  # before the content of a file that counts in another unit
STATE_END = "\n}}\n"


@dataclass(frozen=True)
class UnitState:
    """State of one unit.

    ``stamp`` is the digest of configuration, notes, and names, sizes and times of its files; ``key`` the same with
    their contents; ``batch`` the file name. ``contents`` are hashes of its files in their order, with "-" before those
    that count in other units; "" in states of earlier versions.
    """

    stamp: str
    key: str
    algo: str
    status: str
    batch: str
    contents: str = ""

    @property
    def all_contents(self) -> list[str]:
        """Content hashes of all its files, in their order."""
        return [content.removeprefix(ELSEWHERE_MARK) for content in self.contents.split()]

    @property
    def contents_elsewhere(self) -> list[str]:
        """Content hashes of the files that count in other units."""
        return [c.removeprefix(ELSEWHERE_MARK) for c in self.contents.split() if c.startswith(ELSEWHERE_MARK)]

    @property
    def own_contents(self) -> list[str]:
        """Content hashes of the files that its rows come from."""
        return [content for content in self.contents.split() if not content.startswith(ELSEWHERE_MARK)]


@dataclass
class State:
    """State of one shard: its units by name, and its ``batches`` in the order of writing."""

    units: dict[str, UnitState] = field(default_factory=dict)
    batches: list[str] = field(default_factory=list)

    def drop_batches(self, batches: Collection[str]) -> int:
        """Remove batches and their units, which then count as new.

        Parameters
        ----------
        batches : collection of str
            Names of the files.

        Returns
        -------
        int
            Number of removed units.
        """
        before = len(self.units)
        self.units = {unit: entry for unit, entry in self.units.items() if entry.batch not in batches}
        self.batches = [b for b in self.batches if b not in batches]
        return before - len(self.units)

    def save(self, path: Path) -> None:
        """Write the state in one step; from then on the results of its batches count.

        Parameters
        ----------
        path : Path
            The state file.
        """
        units = {u: [k.stamp, k.key, k.algo, k.status, k.batch, k.contents] for u, k in sorted(self.units.items())}
        lines = ",\n".join(f"{json.dumps(u, ensure_ascii=False)}:{json.dumps(v)}" for u, v in units.items())
        write_text(path, f'{{"batches":{json.dumps(self.batches)},"units":{{\n{lines}{STATE_END}')


def load_state(path: Path) -> State:
    """State of a shard; empty without a file, and rebuilt from the batches if the file is truncated.

    Parameters
    ----------
    path : Path
        The state file.

    Returns
    -------
    State
        The state.

    Raises
    ------
    TurnoutError
        If the file has other content.
    """
    if is_cut_state(path):
        LOG.warning("%s is cut: it is made again from its batches", path)
        return _from_batches(batch_folder(path))
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        units = {unit: UnitState(*values) for unit, values in content["units"].items()}
        return State(units, list(content["batches"]))
    except FileNotFoundError:
        return State()
    except (ValueError, KeyError, TypeError) as error:
        remedy = f"Delete it and {mark_of(path)}: its shard is then recomputed."
        raise TurnoutError(f"{path}: not a state file ({error}). {remedy}") from None


def is_cut_state(path: Path) -> bool:
    """Whether a state file exists and is truncated.

    Parameters
    ----------
    path : Path
        The state file.

    Returns
    -------
    bool
        False if there is no such file.
    """
    return is_truncated(path, STATE_END)


def _from_batches(folder: Path) -> State:
    """State rebuilt from the batches of a shard; of a unit in two of them the last one counts.

    Stamps and contents are not in batches. The job of the shard reads the raw files, and computes only units with
    another key.
    """
    written = sorted(folder.glob("batch-*.parquet"), key=lambda path: (path.stat().st_mtime_ns, path.name))
    state = State(batches=[path.name for path in written])
    for path in filter(is_readable, written):
        rows = read_column(path, "unit", "key", "algo", "status")
        state.units |= {unit: UnitState("", key, algo, status, path.name) for unit, key, algo, status in rows}
    return state


def state_lock(state: Path) -> FileLock:
    """Lock for writing a state.

    Parameters
    ----------
    state : Path
        The state file.

    Returns
    -------
    FileLock
        Lock that other processes respect; it is not yet acquired.
    """
    state.parent.mkdir(parents=True, exist_ok=True)
    return FileLock(state.parent / f".{state.stem}.lock")


def mark_of(state: Path) -> Path:
    """Mark file, the output that Snakemake knows: work/hammer/00of01.json -> work/hammer/00of01.done.

    The state itself is no output, because Snakemake deletes the output of a failed job.

    Parameters
    ----------
    state : Path
        The state file.

    Returns
    -------
    Path
        File beside the state.
    """
    return Path(state).with_suffix(".done")


def states_below(work: Path) -> list[Path]:
    """State files of all stages and shards, including those of earlier numbers of shards.

    Parameters
    ----------
    work : Path
        Folder ``work`` of the workflow.

    Returns
    -------
    list of Path
        Sorted paths.
    """
    return sorted(p for p in work.glob("*/*of*.json") if p.parent.name != "plan")


def state_of_mark(mark: os.PathLike | str) -> Path:
    """State file of a mark: work/hammer/00of01.done -> work/hammer/00of01.json.

    Parameters
    ----------
    mark : path-like
        Mark file, as Snakemake gives it.

    Returns
    -------
    Path
        File beside the mark.
    """
    return Path(mark).with_suffix(".json")


def batch_folder(state: Path) -> Path:
    """Folder of the batches of a state file: work/hammer/00of01.json -> work/hammer/00of01.

    Parameters
    ----------
    state : Path
        The state file.

    Returns
    -------
    Path
        Folder beside the state.
    """
    return Path(state).with_suffix("")


def state_of(batch: Path) -> Path:
    """State file of the shard that a batch belongs to.

    Parameters
    ----------
    batch : Path
        File of a batch.

    Returns
    -------
    Path
        The state file; it need not exist.
    """
    return batch.parent.with_name(f"{batch.parent.name}.json")


def batch_paths(states: Iterable[Path]) -> list[Path]:
    """Batch files that the ``states`` name, shard by shard in the order of writing.

    Parameters
    ----------
    states : iterable of Path
        State files.

    Returns
    -------
    list of Path
        Files, some of which may be damaged.
    """
    return [batch_folder(Path(s)) / name for s in states for name in load_state(Path(s)).batches]


def remove_orphans(state: State, folder: Path) -> int:
    """Delete batches that a state does not name, and temporary files, left by a killed job.

    Parameters
    ----------
    state : State
        State of the shard.
    folder : Path
        Folder of its batches.

    Returns
    -------
    int
        Number of deleted files.
    """
    named, count = set(state.batches), 0
    for path in [*folder.glob("batch-*.parquet"), *folder.glob(".*.tmp")]:
        if path.name not in named:
            path.unlink(missing_ok=True)
            count += 1
    return count
