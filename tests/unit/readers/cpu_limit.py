"""A limit of CPU time for work that might not end. It is no measure of speed."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ended_after(seconds: float) -> Iterator[None]:
    """Raise AssertionError in the block after ``seconds`` of CPU time of this process."""

    def end(*_):
        raise AssertionError(f"not finished after {seconds:g} s of CPU time")

    former = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, former)
