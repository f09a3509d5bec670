"""The same call for many things, on one processor or several; a process that dies takes none of the others along.

Only the one that began them all does: they end with it, for nobody would ask for what they find.
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
    """``thing`` may be what a process died of: it was computed by that one, or by another beside it."""

    thing: Any


def in_order(call: Callable, things: Sequence, threads: int) -> Iterator:
    """``call(thing)`` for each of ``things``, in their order; in this process where one is enough."""
    if threads <= 1 or len(things) <= 1:
        yield from map(call, things)
    else:
        yield from in_processes(call, things, threads)


def in_processes(call: Callable, things: Sequence, threads: int) -> Iterator:
    """``call(thing)`` for each of ``things``, in their order, in other processes than this one.

    Where one of these dies, ``Died`` stands for what they had at hand, and new ones go on with the rest, later.
    Processes are forked before the first result is asked for, so ``call`` may hold anything; it must not
    have started threads by then.
    """
    global _CALL
    _CALL, left = call, list(things)
    try:
        while left:
            lost: list = []
            yield from _until_one_dies(left, threads, lost)
            # things are handed out in their order: the first that are missing were at hand
            yield from map(Died, lost[:threads])
            left = lost[threads:]
    finally:
        _CALL = None


def _until_one_dies(things: Sequence, threads: int, lost: list) -> Iterator:
    """What the processes of one pool give; the things that were lost with it go into ``lost``."""
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
    """End this process when its parent does: it waits for more to do for ever else, and holds its memory."""

    parent = multiprocessing.parent_process()
    assert parent is not None, "it is called in the processes of a pool"

    def watch(join=parent.join):
        join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _asked(pool: ProcessPoolExecutor, thing) -> Future:
    """The future of a thing, of a pool that has died meanwhile, too."""
    try:
        return pool.submit(_call, thing)
    except BrokenProcessPool as error:
        future: Future = Future()
        future.set_exception(error)
        return future


def _call(thing):
    assert _CALL is not None, "in_processes has set it before the processes were forked"
    return _CALL(thing)
