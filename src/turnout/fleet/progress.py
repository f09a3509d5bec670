"""How far a shard is: a bar for a person, lines for a log."""

import sys
import time

# Seconds between two lines in a log.
PAUSE = 30.0


class Progress:
    """Counts units; on a terminal a bar, elsewhere a line now and then."""

    def __init__(self, name: str, total: int, stream=None):
        self.name, self.total, self.done, self.quarantined = name, total, 0, 0
        self.stream = stream or sys.stderr
        self.next_line = time.monotonic() + PAUSE
        self.bar = None
        if total and self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(total=total, desc=name, unit="unit", file=self.stream)

    def step(self, quarantined: bool) -> None:
        """One more unit is done."""
        self.done += 1
        self.quarantined += quarantined
        if self.bar:
            self.bar.update()
            self.bar.set_postfix(quarantined=self.quarantined)
        elif time.monotonic() >= self.next_line:
            self.next_line = time.monotonic() + PAUSE
            print(f"{self.name}: {self.done} of {self.total} units", file=self.stream, flush=True)

    def close(self) -> None:
        """End the bar; a log needs nothing."""
        if self.bar:
            self.bar.close()
