"""Show how many units of a shard are done."""

import sys
import time
from typing import TextIO

# Seconds between two lines of progress in a log.
LOG_INTERVAL = 30.0


class Progress:
    """Shows how many units are done: a bar on a terminal, else a line every ``LOG_INTERVAL`` seconds.

    Parameters
    ----------
    name : str
        Name of the work, before the numbers.
    total : int
        Number of units.
    stream : TextIO or None
        Where to write; None: standard error.
    """

    def __init__(self, name: str, total: int, stream: TextIO | None = None) -> None:
        self.name, self.total, self.n_done, self.quarantined = name, total, 0, 0
        self.stream = stream or sys.stderr
        self.next_line = time.monotonic() + LOG_INTERVAL
        self.bar = None
        if total and self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(total=total, desc=name, unit="unit", file=self.stream)

    def step(self, quarantined: bool) -> None:
        """One more unit is done.

        Parameters
        ----------
        quarantined : bool
            Whether the unit has rows in quarantine.
        """
        self.n_done += 1
        self.quarantined += quarantined
        if self.bar:
            self.bar.update()
            self.bar.set_postfix(quarantined=self.quarantined)
        elif time.monotonic() >= self.next_line:
            self.next_line = time.monotonic() + LOG_INTERVAL
            print(f"{self.name}: {self.n_done} of {self.total} units", file=self.stream, flush=True)

    def close(self) -> None:
        """Close the bar if there is one."""
        if self.bar:
            self.bar.close()
