"""Store the results of a shard while it computes: they are written in batches, which the state file then names."""

import logging
import time
from pathlib import Path

from turnout.config.settings.fleet import FleetSettings
from turnout.workflow.batches import UnitResult, is_readable, write_batch
from turnout.workflow.state import UnitState, batch_folder, load_state, remove_orphans

LOG = logging.getLogger("turnout.workflow")


class Ledger:
    """State of one shard, written to ``path`` at every checkpoint.

    A kill or a fault at any time loses only the results that are not yet in a batch.

    Parameters
    ----------
    path : Path
        State file of the shard.
    limits : FleetSettings
        Settings of the checkpoints.
    """

    def __init__(self, path: Path, limits: FleetSettings) -> None:
        self.path, self.folder, self.limits = path, batch_folder(path), limits
        self.state = load_state(path)
        self._drop_damaged()
        self._waiting: list[tuple[UnitResult, str, str]] = []
        self._saved_at = time.monotonic()
        remove_orphans(self.state, self.folder)

    def _drop_damaged(self) -> None:
        damaged = {name for name in self.state.batches if not is_readable(self.folder / name)}
        if damaged:
            n_unit = self.state.drop_batches(damaged)
            names = ", ".join(str(self.folder / name) for name in sorted(damaged))
            LOG.warning("%s cannot be read: %d units are computed again where their files are there", names, n_unit)

    def keep(self, result: UnitResult, stamp: str, contents: str = "") -> None:
        """Add a result; a checkpoint follows when enough time has passed or enough results wait.

        Parameters
        ----------
        result : UnitResult
            Result of a unit.
        stamp : str
            Digest of names, sizes and times of its files.
        contents : str
            Content hashes of its files, as ``short_contents`` writes them.
        """
        self._waiting.append((result, stamp, contents))
        late = time.monotonic() - self._saved_at >= self.limits.checkpoint_time
        if late or len(self._waiting) >= self.limits.checkpoint_units:
            self.checkpoint()

    def checkpoint(self) -> None:
        """Write the waiting results as a batch; from then on they count."""
        if self._waiting:
            batch = write_batch(self.folder, [result for result, *_ in self._waiting]).name
            self.state.batches = [b for b in self.state.batches if b != batch] + [batch]
            for result, stamp, contents in self._waiting:
                entry = UnitState(stamp, result.key, result.algo, result.status, batch, contents)
                self.state.units[result.unit] = entry
            self._waiting.clear()
        self.state.save(self.path)
        self._saved_at = time.monotonic()
