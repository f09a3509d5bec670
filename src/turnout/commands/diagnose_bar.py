"""How far a diagnosis is: a bar on a terminal, a line now and then elsewhere."""

import sys
import time

PAUSE = 20.0  # s between two lines in a log
USUAL = "neighbouring sections together; a group takes a minute to ten, more with many axles"


class DiagnoseBar:
    """Counts joint fits of a group; the number of simulations so far shows that a long fit is alive."""

    def __init__(self, stream=None):
        self.stream = stream or sys.stderr
        self.bar = None
        self.said, self.next_line, self.what = "", time.monotonic() + PAUSE, ""
        self.began = None

    def __enter__(self):
        if self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(total=None, unit="fit", file=self.stream)
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()
        return False

    def group(self, group, number, count):
        """Called when a group begins; returns the callable for its joint fits."""
        self._plan(number, count)
        self.said = f"{'+'.join(group.labels)} ({number + 1} of {count})"
        self.what = "base fit"
        if self.bar is not None:
            self.bar.reset()
        self.simulations(0)

        def fits(done, total, what):
            self.what = f"{done} of {total} joint fits, {what}"
            if self.bar is not None:
                self.bar.total = total
                self.bar.update(done - self.bar.n)

        return fits

    def _plan(self, number, count):
        """How much there is to do, then how far it is: whoever has little time must know before."""
        if self.began is None:
            self.began = time.monotonic()
            text = f"{count} {'group' if count == 1 else 'groups'}: {USUAL}"
        else:
            text = f"{number} of {count} groups done, {(time.monotonic() - self.began) / 60.0:.1f} minutes so far"
        if self.bar is not None:
            self.bar.write(text, file=self.stream)
        else:
            print(text, file=self.stream, flush=True)

    def simulations(self, count):
        """Called at every prediction."""
        text = f"{self.said}: {self.what[:60]}, {count} simulations"
        if self.bar is not None:
            self.bar.set_description(text, refresh=count % 10 == 0)
        elif time.monotonic() >= self.next_line:
            self.next_line = time.monotonic() + PAUSE
            print(text, file=self.stream, flush=True)
