"""Cut passages out of a continuous record, block by block, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from turnout.config.settings.passage import PassageSettings

BAND = (120.0, 400.0)  # Hz, in which wheels are loud on any rail
BIN_LENGTH = 0.05  # s, length of a bin of the level
LOUD_FACTOR = 6.0  # least ratio of a passage's power to the quiet power
MEMORY_TIME = 120.0  # s of quiet time from which the quiet power is taken


@dataclass(frozen=True)
class Excerpt:
    """``samples`` (n_channel, n) from sample ``start`` of the record on.

    ``is_whole`` is False where a passage was longer than allowed and was cut.
    """

    start: int
    samples: np.ndarray
    is_whole: bool = True


def cut_passages(blocks: Iterable[np.ndarray], rate: float, settings: PassageSettings) -> Iterator[Excerpt]:
    """Pieces of a continuous record, one per passage, each with ``settings.margin`` seconds on either side.

    A passage exceeds six times the quiet power, mean over the channels, without a gap of more than ``settings.gap``
    seconds. The quiet power is the 20 % quantile of the last two minutes without a passage. At any length of the
    record, no more than ``settings.longest`` seconds and a block are in memory, as float32.

    Parameters
    ----------
    blocks : iterable of (n_channel, n) arrays
        Consecutive parts of the record, of any length. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : PassageSettings
        Lengths of gap, margin and pieces, and the longest passage.

    Yields
    ------
    Excerpt
        In the order of time.
    """
    cutter = _PassageCutter(rate, settings)
    for block in equal_blocks(blocks, max(round(settings.chunk * rate), 1)):
        yield from cutter.feed(block)
    yield from cutter.end()


def equal_blocks(blocks: Iterable[np.ndarray], length: int) -> Iterator[np.ndarray]:
    """The same samples in blocks of ``length``, the last one shorter: results must not depend on the blocks.

    Parameters
    ----------
    blocks : iterable of (n_channel, n) arrays
        Consecutive parts of a record, of any length. [any unit]
    length : int
        Samples of the new blocks.

    Yields
    ------
    (n_channel, length) array
        The last one may be shorter. [same unit]

    Examples
    --------
    >>> [b.tolist() for b in equal_blocks([np.array([[1, 2]]), np.array([[3, 4, 5]])], 3)]
    [[[1, 2, 3]], [[4, 5]]]
    """
    chunks, n = [], 0
    for block in blocks:
        block = np.atleast_2d(block)
        while block.shape[1]:
            n_taken = min(length - n, block.shape[1])
            chunks.append(block[:, :n_taken])
            block, n = block[:, n_taken:], n + n_taken
            if n == length:
                yield np.concatenate(chunks, axis=1)
                chunks, n = [], 0
    if chunks:
        yield np.concatenate(chunks, axis=1)


@dataclass
class _PassageCutter:
    """Cut passages from successive blocks; holds the state between them."""

    rate: float
    settings: PassageSettings
    filter_sections: np.ndarray = field(init=False)
    filter_state: np.ndarray = field(init=False)
    blocks: deque[np.ndarray] = field(default_factory=deque)
    blocks_start: int = 0
    n_fed: int = 0
    remainder: np.ndarray = field(init=False)
    quiet_levels: deque[float] = field(default_factory=lambda: deque(maxlen=int(MEMORY_TIME / BIN_LENGTH)))
    passage_levels: list[float] = field(default_factory=list)
    first: int | None = None
    last: int = 0

    def feed(self, block: np.ndarray) -> Iterator[Excerpt]:
        """Excerpts that end in this block."""
        if self.n_fed == 0:
            self.filter_sections = scipy.signal.butter(2, BAND, btype="bandpass", fs=self.rate, output="sos")
            # as if the channels had always had their first value: an offset is no impact
            offset = np.median(block, axis=1)[None, :, None]
            self.filter_state = scipy.signal.sosfilt_zi(self.filter_sections)[:, None, :] * offset
            self.remainder = np.zeros((block.shape[0], 0))
        filtered, self.filter_state = scipy.signal.sosfilt(self.filter_sections, block, axis=1, zi=self.filter_state)
        self.blocks.append(block.astype(np.float32))
        self.n_fed += block.shape[1]
        per_bin = int(BIN_LENGTH * self.rate)
        filtered = np.concatenate([self.remainder, filtered], axis=1)
        n = filtered.shape[1] // per_bin
        begin = self.n_fed - filtered.shape[1]
        self.remainder = filtered[:, n * per_bin :].copy()
        powers = np.square(filtered[:, : n * per_bin]).reshape(filtered.shape[0], n, per_bin).mean(axis=2)
        levels = np.log(np.maximum(powers, 1e-30)).mean(axis=0)
        quiet_reference = self.quiet_levels if self.quiet_levels else levels
        is_loud = levels > np.quantile(quiet_reference, 0.2) + np.log(LOUD_FACTOR) if n else ()
        for k in range(n):
            self.passage_levels.append(levels[k])
            yield from self._step(begin + k * per_bin, per_bin, bool(is_loud[k]))
            if self.first is None:
                self.quiet_levels.extend(self.passage_levels)
                self.passage_levels.clear()
        self._drop_blocks()

    def end(self) -> Iterator[Excerpt]:
        """The excerpt that the end of the record cuts off, if there is one."""
        if self.first is not None:
            yield self._excerpt(self.first, self.n_fed, True)

    def _step(self, sample: int, per_bin: int, is_loud: bool) -> Iterator[Excerpt]:
        margin = int(self.settings.margin * self.rate)
        if is_loud:
            if self.first is None:
                self.first = max(sample - margin, 0)
            self.last = sample + per_bin
        if self.first is None:
            return
        if is_loud and self.last - self.first > self.settings.longest * self.rate:
            yield self._excerpt(self.first, self.last, False)
            self.first = None
        elif not is_loud and sample - self.last > self.settings.gap * self.rate:
            yield self._excerpt(self.first, self.last + margin, True)
            self.first = None
            self.passage_levels.clear()  # a train as long as the memory would be taken as quiet

    def _excerpt(self, start: int, stop: int, is_whole: bool) -> Excerpt:
        start, blocks, sample = max(start, self.blocks_start), [], self.blocks_start
        for block in self.blocks:
            inside = slice(max(start - sample, 0), max(min(stop - sample, block.shape[1]), 0))
            blocks.append(block[:, inside])
            sample += block.shape[1]
        return Excerpt(start, np.concatenate(blocks, axis=1), is_whole)

    def _drop_blocks(self) -> None:
        """Remove blocks that no later excerpt can need."""
        margin = int((self.settings.margin + BIN_LENGTH) * self.rate)
        first_needed = self.first if self.first is not None else self.n_fed - margin - self.remainder.shape[1]
        while self.blocks and self.blocks_start + self.blocks[0].shape[1] <= first_needed:
            self.blocks_start += self.blocks.popleft().shape[1]
