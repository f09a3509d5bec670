"""Reader of the rows of a text file in blocks: long files are neither held in memory nor read as a whole."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from turnout.readers.csv_cells import MarkStatistics
from turnout.readers.lazy import LazyColumn

N_SUMMARY_ROWS = 6  # rows at an end, among which those of the least and the largest numbers are looked for


class FilePart(io.RawIOBase):
    """Bytes of a file from ``start`` up to ``stop`` as a file of their own, which is read from its beginning.

    Parameters
    ----------
    path : Path
        The file.
    start, stop : int
        First byte, and that behind the last one.
    """

    def __init__(self, path: Path, start: int, stop: int):
        self.file, self.n_left = path.open("rb"), stop - start
        self.file.seek(start)

    def readable(self) -> bool:
        """Whether it can be read.

        Returns
        -------
        bool
            Always.
        """
        return True

    def read(self, size: int | None = -1) -> bytes:
        """Further bytes.

        Parameters
        ----------
        size : int or None
            At most so many; all if it is negative or None.

        Returns
        -------
        bytes
            Empty at the end of the part.
        """
        data = self.file.read(self.n_left if size is None or size < 0 else min(size, self.n_left))
        self.n_left -= len(data)
        return data

    def close(self) -> None:
        """Close the file."""
        self.file.close()
        super().close()


class RowReader:
    """Reads the rows of a text file in order; a request for earlier rows starts again at the beginning.

    Parameters
    ----------
    path : Path
        The text file.
    offset : int
        Byte at which the numbers begin.
    end : int
        Byte behind them.
    options : dict of str to any
        Options of ``pyarrow.csv.open_csv``.
    """

    def __init__(self, path: Path, offset: int, end: int, options: dict[str, Any]):
        self.path, self.offset, self.end, self.options = path, offset, end, options
        self.n_row, self.begin, self.has_blank_rows = 0, 0, False
        self.marks: list[MarkStatistics] = []
        self.low = self.high = self.edge_rows = np.empty((0, 0))
        self.batches: list[pa.RecordBatch] = []
        self.reader: csv.CSVStreamingReader | None = None

    def scan(self, time: int | None) -> np.ndarray | None:
        """Count the rows, collect marks and extremes of each column, and read the time column.

        Parameters
        ----------
        time : int or None
            Number of the time column, from 0; None: there is none.

        Returns
        -------
        (n_row,) array or None
            The time as it is written; None without a time column.
        """
        values = []
        for batch in self._open():
            self.n_row += batch.num_rows
            if batch.column(0).null_count:
                is_null = [column.is_null().to_numpy(zero_copy_only=False) for column in batch.columns]
                self.has_blank_rows |= bool(np.logical_and.reduce(is_null).any())
            self.marks = self.marks or [MarkStatistics() for _ in batch.columns]
            for statistics, column in zip(self.marks, batch.columns):
                statistics.add(column.to_numpy(zero_copy_only=False))
            self._add_extremes(np.column_stack([column.to_numpy(zero_copy_only=False) for column in batch.columns]))
            if time is not None:
                values.append(batch.column(time).to_numpy(zero_copy_only=False))
        return None if time is None else np.concatenate(values)

    def _add_extremes(self, rows: np.ndarray) -> None:
        """Extend the least and largest numbers, and the rows at both ends, by further rows."""
        rows = np.concatenate([self.edge_rows.reshape(-1, rows.shape[1]), rows])
        self.low = np.min([*self.low, rows.min(axis=0)], axis=0)[None]
        self.high = np.max([*self.high, rows.max(axis=0)], axis=0)[None]
        self.edge_rows = np.concatenate([rows[:N_SUMMARY_ROWS], rows[N_SUMMARY_ROWS:][-N_SUMMARY_ROWS:]])

    @property
    def may_have_summary(self) -> bool:
        """Whether one of the rows at the ends holds the least, and one the largest number of each column."""
        return all(bool((self.edge_rows == extreme).all(axis=1).any()) for extreme in (self.low, self.high))

    def column(self, i: int) -> LazyColumn:
        """Column number ``i``.

        Parameters
        ----------
        i : int
            Number of the column, from 0.

        Returns
        -------
        LazyColumn
            Its numbers, read when it is sliced.
        """
        return LazyColumn(lambda start, stop: self._read_rows(i, start, stop), self.n_row, np.dtype(float))

    def _open(self) -> csv.CSVStreamingReader:
        return csv.open_csv(FilePart(self.path, self.offset, self.end), **self.options)

    def _read_rows(self, i: int, start: int, stop: int) -> np.ndarray:
        if self.reader is None or start < self.begin:
            self.reader, self.begin, self.batches = self._open(), 0, []
        end = self.begin + sum(batch.num_rows for batch in self.batches)
        while end < stop:
            self.batches.append(self.reader.read_next_batch())
            end += self.batches[-1].num_rows
            while self.begin + self.batches[0].num_rows <= start:
                self.begin += self.batches.pop(0).num_rows
        table = pa.Table.from_batches(self.batches).slice(start - self.begin, stop - start)
        return table.column(i).to_numpy()
