"""Call a function for many tasks, in one process or several; a process that dies does not end the others.

The processes end with their parent, because nothing would use their results.
"""

import gc
import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from turnout.child_processes import end_with_parent

_CALL: Callable | None = None


@dataclass(frozen=True)
class LostTask:
    """A ``task`` without a result because a process of the pool died; it may have caused that or not."""

    task: Any


def map_in_order(function: Callable, tasks: Sequence, threads: int) -> Iterator:
    """Call a function for each task; in this process if one is enough.

    Parameters
    ----------
    function : callable
        Called with one task.
    tasks : sequence
        The tasks.
    threads : int
        Processes at a time.

    Yields
    ------
    any
        Results in the order of the tasks; ``LostTask`` for one whose process died.
    """
    if threads <= 1 or len(tasks) <= 1:
        yield from map(function, tasks)
    else:
        yield from map_in_processes(function, tasks, threads)


def map_in_processes(function: Callable, tasks: Sequence, threads: int) -> Iterator:
    """Call a function for each task in child processes.

    If one of them dies, ``LostTask`` takes the place of the results in progress, and new processes continue with the
    remaining tasks. Processes are forked before the first result, so ``function`` need not be picklable; it must not
    have started threads by then.

    Parameters
    ----------
    function : callable
        Called with one task.
    tasks : sequence
        The tasks.
    threads : int
        Processes at a time.

    Yields
    ------
    any
        Results in the order of the tasks; ``LostTask`` for one without a result.
    """
    global _CALL
    _CALL, remaining = function, list(tasks)
    try:
        while remaining:
            lost: list = []
            yield from _run_until_death(remaining, threads, lost)
            # tasks are started in their order: the first lost ones were in progress
            yield from map(LostTask, lost[:threads])
            remaining = lost[threads:]
    finally:
        _CALL = None


def _run_until_death(tasks: Sequence, threads: int, lost: list) -> Iterator:
    """Results of the processes of one pool until one dies; tasks without a result are appended to ``lost``."""
    n = min(threads, len(tasks))
    with ProcessPoolExecutor(n, multiprocessing.get_context("fork"), _begin) as pool:
        futures = deque(_submit(pool, task) for task in tasks)
        try:
            for task in tasks:
                try:
                    result = futures.popleft().result()
                except BrokenProcessPool:
                    lost.append(task)
                    continue
                yield result
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _begin() -> None:
    """Keep inherited objects: a database connection that is closed without the threads of its parent crashes."""
    gc.freeze()
    end_with_parent()


def _submit(pool: ProcessPoolExecutor, task: Any) -> Future:
    """Future of a task; it holds an exception if the pool is broken already."""
    try:
        return pool.submit(_call_task, task)
    except BrokenProcessPool as error:
        future: Future = Future()
        future.set_exception(error)
        return future


def _call_task(task: Any) -> Any:
    assert _CALL is not None, "in_processes has set it before the processes were forked"
    return _CALL(task)
