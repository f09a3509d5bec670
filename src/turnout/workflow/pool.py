"""Call a function for many tasks, in one process or several; a process that dies does not end the others.

The processes end with their parent, because nothing would use their results.
"""

import multiprocessing
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

_CALL: Callable | None = None


@dataclass(frozen=True)
class Died:
    """A ``task`` without a result because a process of the pool died; it may have caused that or not."""

    thing: Any


def in_order(call: Callable, things: Sequence, threads: int) -> Iterator:
    """``function(task)`` for each of ``tasks``, in their order; in this process if one is enough."""
    if threads <= 1 or len(things) <= 1:
        yield from map(call, things)
    else:
        yield from in_processes(call, things, threads)


def in_processes(call: Callable, things: Sequence, threads: int) -> Iterator:
    """``function(task)`` for each of ``tasks``, in their order, in child processes.

    If one of them dies, ``LostTask`` takes the place of the results in progress, and new processes continue with the
    remaining tasks. Processes are forked before the first result, so ``function`` need not be picklable; it must not
    have started threads by then.
    """
    global _CALL
    _CALL, left = call, list(things)
    try:
        while left:
            lost: list = []
            yield from _until_one_dies(left, threads, lost)
            # tasks are started in their order: the first lost ones were in progress
            yield from map(Died, lost[:threads])
            left = lost[threads:]
    finally:
        _CALL = None


def _until_one_dies(things: Sequence, threads: int, lost: list) -> Iterator:
    """Results of the processes of one pool until one dies; tasks without a result are appended to ``lost``."""
    n = min(threads, len(things))
    with ProcessPoolExecutor(n, multiprocessing.get_context("fork"), _end_with_parent) as pool:
        futures = deque(_asked(pool, thing) for thing in things)
        try:
            for thing in things:
                try:
                    found = futures.popleft().result()
                except BrokenProcessPool:
                    lost.append(thing)
                    continue
                yield found
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _end_with_parent() -> None:
    """End this process with its parent; otherwise it would wait for tasks for ever and keep its memory."""

    parent = multiprocessing.parent_process()
    assert parent is not None, "it is called in the processes of a pool"

    def watch(join=parent.join):
        join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _asked(pool: ProcessPoolExecutor, thing) -> Future:
    """Future of a task; it holds an exception if the pool is broken already."""
    try:
        return pool.submit(_call, thing)
    except BrokenProcessPool as error:
        future: Future = Future()
        future.set_exception(error)
        return future


def _call(thing):
    assert _CALL is not None, "in_processes has set it before the processes were forked"
    return _CALL(thing)
