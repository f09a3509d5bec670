"""A record that stays in its file: converted stretch by stretch, judged in one pass."""

from dataclasses import dataclass

import numpy as np

from turnout.errors import ReadError
from turnout.readers.raw import RawRecord, Source

PASS = 2**18  # samples of each channel at a time


@dataclass(frozen=True)
class Stretches:
    """``stretches(start, stop)`` -> (n_channel, stop - start) SI samples of the channels ``mapped`` of a raw record.

    ReadError where the file is damaged there, or not what it was when this was made.
    """

    record: RawRecord
    mapped: tuple
    where: str
    source: Source
    state: tuple[int, int] | None

    def __call__(self, start: int, stop: int) -> np.ndarray:
        if self.source.state() != self.state:
            found = f"it changed while it was read, at sample {start}"
            raise self.source.error(self.where, found, "Start again when its copying has ended")
        samples = np.empty((len(self.mapped), stop - start))
        with self.source.parsed_by("the format's library", f"{self.where}, samples {start} to {stop}"):
            for row, m in zip(samples, self.mapped):
                np.multiply(self.record.samples[m.index][start:stop], m.scale, out=row)
                if m.offset:
                    row += m.offset
        return samples

    def of(self, rows) -> "Stretches":
        """Some of the channels."""
        return Stretches(self.record, tuple(self.mapped[i] for i in rows), self.where, self.source, self.state)


@dataclass
class Soundness:
    """What is known of each channel (n_channel,) after the stretches so far: samples that are not finite and where the
    first of them is, the first sample, and whether all others equal it."""

    n_bad: np.ndarray
    first_bad: np.ndarray
    value: np.ndarray
    constant: np.ndarray

    @classmethod
    def over(cls, stretches: Stretches, n_sample: int):
        """One pass over a record of ``n_sample`` samples."""
        n = len(stretches.mapped)
        found = cls(np.zeros(n, int), np.full(n, -1), np.zeros(n), np.ones(n, bool))
        for start in range(0, n_sample, PASS):
            found._add(stretches(start, min(start + PASS, n_sample)), start)
        return found

    def by_channel(self) -> list[tuple]:
        """What is known, channel by channel."""
        return list(zip(self.n_bad, self.first_bad, self.value, self.constant))

    def _add(self, samples, start):
        if start == 0:
            self.value = samples[:, 0].copy()
        for i, row in enumerate(samples):
            self.constant[i] &= bool(row[0] == self.value[i] and row.min() == row.max())
            with np.errstate(over="ignore", invalid="ignore"):
                suspect = not np.isfinite(row.sum())
            if suspect and not (finite := np.isfinite(row)).all():
                if not self.n_bad[i]:
                    self.first_bad[i] = start + int(np.argmin(finite))
                self.n_bad[i] += np.count_nonzero(~finite)


def fault(n_sample, seen, channel, where, source) -> ReadError | None:
    """ReadError of a channel with NaN, infinity, or no movement at all; None for a sound one."""
    place = f"{where}, channel {channel.name!r}"
    n_bad, first_bad, value, constant = seen
    if n_bad:
        found = f"{n_bad} of {n_sample} samples are missing or not finite, the first is sample {first_bad}"
        remedy = "Export the record again from the logger; if it is so there too, check the channel's cable and range"
        return source.error(place, found, remedy, reason="not_finite")
    if constant and channel.quantity != "temperature":
        found = f"all {n_sample} samples are {value:.6g}: the channel is dead"
        return source.error(place, found, "Check sensor, cable and channel map", reason="dead_channel")
    return None
