"""Entries of the metadata that the samples explain: their statistics, and the divisions of a screen."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.number_meanings import number_value
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x * x)))


STATISTICS: dict[str, Callable[[np.ndarray], float]] = {
    **dict.fromkeys(("min", "minimum", "minima", "ymin", "kleinster"), np.min),
    **dict.fromkeys(("max", "maximum", "maxima", "ymax", "grosster"), np.max),
    **dict.fromkeys(("mean", "average", "avg", "mittelwert", "mittel", "moyenne", "media"), np.mean),
    **dict.fromkeys(("std", "stdev", "standardabweichung"), np.std),
    **dict.fromkeys(("rms", "effektivwert"), _rms),
}
BESIDE_STATISTIC = frozenset("value values wert y data signal of the".split())
NUMBER = re.compile(r"[+-]?\d*[.,]?\d*(?:[eE][+-]?\d+)?")
RELATIVE_PRECISION = 1e-3  # of the largest sample: what a program rounds a statistic to
MAX_DIVISIONS = 16.0  # of a screen from its middle, with its offset


def is_statistic_name(name: str) -> bool:
    """Whether a name means a statistic of samples.

    Parameters
    ----------
    name : str
        Name of an entry.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_statistic_name(name) for name in ("Minimum", "Max value", "Max. temperature", "Minute")]
    [True, True, False, False]
    """
    return _statistic(name) is not None


def _statistic(name: str) -> Callable[[np.ndarray], float] | None:
    words = [word for word in words_of(name) if word not in BESIDE_STATISTIC]
    return STATISTICS.get(words[0]) if len(words) == 1 else None


def is_statistic(entry: Entry, record: RawRecord) -> bool:
    """Whether an entry states a statistic that the samples of a record have, as they are in the file.

    Parameters
    ----------
    entry : Entry
        Entry of the metadata.
    record : RawRecord
        The record.

    Returns
    -------
    bool
        False for another number: the samples may lack a scale.
    """
    statistic = _statistic(entry.name)
    if statistic is None:
        return False
    numbers = [_number(text) for text in _texts(entry.value)]
    signals = [*record.samples, *([] if record.time is None else [record.time])]
    arrays = [x.astype(float) for x in signals if isinstance(x, np.ndarray) and x.dtype.kind in "fiu" and x.size]
    stated = [(statistic(x), RELATIVE_PRECISION * float(np.abs(x).max())) for x in arrays]
    return bool(numbers) and all(any(abs(y - x) <= e for x, e in stated) for y in numbers)


def _texts(value: Any) -> Sequence[Any]:
    values = np.ravel(np.asarray(value, dtype=object)).tolist()
    return [v for v in values if not isinstance(v, str) or v.strip()]


def _number(value: Any) -> float:
    """A number, also as a text with a decimal comma; NaN for any other value."""
    if isinstance(value, str):
        return number_value(value.strip().replace(",", ".")) if NUMBER.fullmatch(value.strip()) else np.nan
    return float(value) if isinstance(value, (int, float, np.number)) else np.nan


def screen_names(record: RawRecord) -> frozenset[str]:
    """Names of the entries about divisions of a screen, "Vertical Scale" beside "Horizontal Scale", without case.

    They are none if the samples do not fit on that screen: then they may be codes of a converter.

    Parameters
    ----------
    record : RawRecord
        The record.

    Returns
    -------
    frozenset of str
        Empty if one of the two axes is not stated.
    """
    scales = {axis: [e for e in record.entries if set(words_of(e.name)) >= {axis, "scale"}] for axis in AXES}
    if not all(scales.values()):
        return frozenset()
    divisions = [_number(text) for entry in scales["vertical"] for text in _texts(entry.value)]
    arrays = [np.asarray(x[:], dtype=float) for x in record.samples if x.dtype.kind in "fiu"]
    largest = max((float(np.nanmax(np.abs(x))) for x in arrays if x.size), default=np.inf)
    if not divisions or not largest <= MAX_DIVISIONS * np.nanmax([*divisions, 0.0]):
        return frozenset()
    return frozenset(e.name.strip().casefold() for entries in scales.values() for e in entries)


AXES = ("vertical", "horizontal")
