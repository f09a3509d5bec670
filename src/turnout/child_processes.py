"""Child processes that end with the command that started them, also where a signal ends that command."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType, TracebackType
    from typing import Any

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
MAX_TASK_END = 5.0  # time in which a task that is ended may remove its unfinished files [s]
MAX_GROUP_END = 60.0  # time in which Snakemake and its jobs may end [s]
_is_ending = False


@contextmanager
def signals_interrupt(numbers: list[int]) -> Iterator[None]:
    """Context in which SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, so that open contexts are left in order.

    A signal that is ignored, as SIGHUP below ``nohup``, or has a handler of its own keeps its effect.

    Parameters
    ----------
    numbers : list of int
        The number of each signal that arrives is appended.
    """

    def note(number: int, frame: FrameType | None) -> None:
        numbers.append(number)
        raise KeyboardInterrupt

    handlers = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    replaced = [n for n, handler in handlers.items() if handler in (signal.SIG_DFL, signal.default_int_handler)]
    for number in replaced:
        signal.signal(number, note)
    try:
        yield
    finally:
        for number in replaced:
            signal.signal(number, handlers[number])


class ProcessPool(ProcessPoolExecutor):
    """A pool whose processes end when its context is left by an exception, and with their parent.

    The pool of the standard library computes all tasks first. A task that is ended raises SystemExit, so it removes
    its unfinished files.

    Parameters
    ----------
    n_process : int or None
        Processes at a time; None: one per processor.
    method : str, optional
        How processes start, as in ``multiprocessing.get_context``.
    """

    def __init__(self, n_process: int | None, method: str | None = None):
        super().__init__(n_process, multiprocessing.get_context(method), _begin)

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Future of a call.

        Parameters
        ----------
        fn : callable
            Called in a process of the pool.
        *args, **kwargs
            Its arguments.

        Returns
        -------
        Future
            Its future.
        """
        return super().submit(_call, fn, *args, **kwargs)

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error_type is not None:
            processes = list((self._processes or {}).values())
            self.shutdown(wait=False, cancel_futures=True)
            _end_processes(processes)
        self.shutdown()


def _begin() -> None:
    """Prepare a process of a pool. The parent ends it, also where a terminal sends Ctrl-C to both."""

    def end(number: int, frame: FrameType | None) -> None:
        global _is_ending
        _is_ending = True
        raise SystemExit(128 + number)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end)
    end_with_parent()


def _call(function: Callable, *args: Any, **kwargs: Any) -> Any:
    """Call a function in a process of a pool, which ends behind it if it is to end."""
    try:
        return function(*args, **kwargs)
    finally:
        if _is_ending:
            os._exit(1)


def _end_processes(processes: Sequence[Any]) -> None:
    """SIGTERM to each process of a pool, SIGKILL to those that live after ``MAX_TASK_END`` or at another interrupt."""
    try:
        for process in processes:
            process.terminate()
        deadline = time.monotonic() + MAX_TASK_END
        for process in processes:
            process.join(max(0.0, deadline - time.monotonic()))
    finally:
        for process in processes:
            process.kill()


def end_with_parent() -> None:
    """End this process of a pool with its parent; otherwise it would wait for tasks for ever and keep its memory."""
    parent = multiprocessing.parent_process()
    assert parent is not None, "it is called in the processes of a pool"

    def watch(join: Callable[[], None] = parent.join) -> None:
        join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def process_group(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen]:
    """Context of a process in a group of its own, which is ended with all its children by any exception.

    SIGTERM first, SIGKILL after ``MAX_GROUP_END`` or at another interrupt.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    **options
        Options of ``subprocess.Popen``.

    Yields
    ------
    subprocess.Popen
        The process.
    """
    process = subprocess.Popen(command, start_new_session=True, **options)
    try:
        yield process
    except BaseException:
        _end_group(process)
        raise


def _end_group(process: subprocess.Popen) -> None:
    try:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(MAX_GROUP_END)
    except (subprocess.TimeoutExpired, ProcessLookupError):
        pass
    finally:
        with suppress(ProcessLookupError):  # the process and all its children have ended
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
