"""The same call for many things, on one processor or several; results come in the order of the things."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor

_CALL: Callable | None = None


def in_order(call: Callable, things: Sequence, threads: int) -> Iterator:
    """``call(thing)`` for each of ``things``.

    Processes are forked before the first result is asked for, so ``call`` may hold anything; it must not
    have started threads by then.
    """
    if threads <= 1 or len(things) <= 1:
        yield from map(call, things)
        return
    global _CALL
    _CALL = call
    try:
        with ProcessPoolExecutor(min(threads, len(things)), multiprocessing.get_context("fork")) as pool:
            yield from pool.map(_call, things)
    finally:
        _CALL = None


def _call(thing):
    assert _CALL is not None, "in_order has set it before the processes were forked"
    return _CALL(thing)
