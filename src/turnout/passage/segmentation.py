"""Cut passages out of a continuous record, block by block, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy import signal

BAND = (120.0, 400.0)  # Hz, in which wheels are loud on any rail
BIN = 0.05  # s, length of a bin of the level
LOUD = 6.0  # least ratio of a passage's power to the quiet power
MEMORY = 120.0  # s of quiet time from which the quiet power is taken


@dataclass(frozen=True)
class Piece:
    """``samples`` (n_channel, n) from sample ``start`` of the record on.

    ``is_whole`` is False where a passage was longer than allowed and was cut.
    """

    start: int
    samples: np.ndarray
    whole: bool = True


def cut_passages(blocks: Iterable[np.ndarray], rate: float, settings) -> Iterator[Piece]:
    """Pieces of a continuous record, one per passage, each with ``settings.margin`` seconds on either side.

    A passage exceeds six times the quiet power, mean over the channels, without a gap of more than ``settings.gap``
    seconds. The quiet power is the 20 % quantile of the last two minutes without a passage. At any length of the
    record, no more than ``settings.longest`` seconds and a block are in memory, as float32.

    Parameters
    ----------
    blocks : iterable of (n_channel, n) arrays
        Consecutive parts of the record, of any length. [m/s²]
    rate : float
        [Hz]
    """
    state = _Cutter(rate, settings)
    for block in equal_blocks(blocks, max(round(settings.chunk * rate), 1)):
        yield from state.feed(block)
    yield from state.end()


def equal_blocks(blocks, length: int) -> Iterator[np.ndarray]:
    """The same samples in blocks of ``length``, the last one shorter: results must not depend on the blocks.

    >>> [b.tolist() for b in equal_blocks([np.array([[1, 2]]), np.array([[3, 4, 5]])], 3)]
    [[[1, 2, 3]], [[4, 5]]]
    """
    parts, n = [], 0
    for block in blocks:
        block = np.atleast_2d(block)
        while block.shape[1]:
            take = min(length - n, block.shape[1])
            parts.append(block[:, :take])
            block, n = block[:, take:], n + take
            if n == length:
                yield np.concatenate(parts, axis=1)
                parts, n = [], 0
    if parts:
        yield np.concatenate(parts, axis=1)


@dataclass
class _Cutter:
    """Cut passages from successive blocks; holds the state between them."""

    rate: float
    settings: object
    sections: np.ndarray = None
    memory: np.ndarray = None
    kept: deque = field(default_factory=deque)
    kept_from: int = 0
    seen: int = 0
    rest: np.ndarray = None
    quiet: deque = field(default_factory=lambda: deque(maxlen=int(MEMORY / BIN)))
    passing: list = field(default_factory=list)
    first: int | None = None
    last: int = 0

    def feed(self, block):
        """Excerpts that end in this block."""
        if self.sections is None:
            self.sections = signal.butter(2, BAND, btype="bandpass", fs=self.rate, output="sos")
            # as if the channels had always had their first value: an offset is no impact
            rest = np.median(block, axis=1)[None, :, None]
            self.memory = signal.sosfilt_zi(self.sections)[:, None, :] * rest
            self.rest = np.zeros((block.shape[0], 0))
        passed, self.memory = signal.sosfilt(self.sections, block, axis=1, zi=self.memory)
        self.kept.append(block.astype(np.float32))
        self.seen += block.shape[1]
        per_bin = int(BIN * self.rate)
        passed = np.concatenate([self.rest, passed], axis=1)
        n = passed.shape[1] // per_bin
        begin = self.seen - passed.shape[1]
        self.rest = passed[:, n * per_bin :].copy()
        powers = np.square(passed[:, : n * per_bin]).reshape(passed.shape[0], n, per_bin).mean(axis=2)
        levels = np.log(np.maximum(powers, 1e-30)).mean(axis=0)
        known = self.quiet if self.quiet else levels
        loud = levels > np.quantile(known, 0.2) + np.log(LOUD) if n else ()
        for k in range(n):
            self.passing.append(levels[k])
            yield from self._step(begin + k * per_bin, per_bin, bool(loud[k]))
            if self.first is None:
                self.quiet.extend(self.passing)
                self.passing.clear()
        self._forget()

    def end(self):
        """The excerpt that the end of the record cuts off, if there is one."""
        if self.first is not None:
            yield self._piece(self.first, self.seen, True)

    def _step(self, place, per_bin, loud):
        margin = int(self.settings.margin * self.rate)
        if loud:
            if self.first is None:
                self.first = max(place - margin, 0)
            self.last = place + per_bin
        if self.first is None:
            return
        if loud and self.last - self.first > self.settings.longest * self.rate:
            yield self._piece(self.first, self.last, False)
            self.first = None
        elif not loud and place - self.last > self.settings.gap * self.rate:
            yield self._piece(self.first, self.last + margin, True)
            self.first = None
            self.passing.clear()  # a train as long as the memory would be taken as quiet

    def _piece(self, start, stop, whole):
        start, parts, place = max(start, self.kept_from), [], self.kept_from
        for block in self.kept:
            inside = slice(max(start - place, 0), max(min(stop - place, block.shape[1]), 0))
            parts.append(block[:, inside])
            place += block.shape[1]
        return Piece(start, np.concatenate(parts, axis=1), whole)

    def _forget(self):
        """Remove blocks that no later excerpt can need."""
        margin = int((self.settings.margin + BIN) * self.rate)
        needed = self.first if self.first is not None else self.seen - margin - self.rest.shape[1]
        while self.kept and self.kept_from + self.kept[0].shape[1] <= needed:
            self.kept_from += self.kept.popleft().shape[1]
