"""Which axes of an array of three dimensions are records, channels and samples."""

from itertools import permutations
from typing import Any

import numpy as np

from turnout.readers.array_metadata import Metadata, list_of_texts
from turnout.readers.array_names import split_texts
from turnout.readers.rate_units import words_of
from turnout.readers.source import Source

DIMENSION_NAMES = ("dims", "dimensions", "dim_names", "axes", "axis_names", "axis_order", "order", "layout")
# Beginnings of words for the three axes.
AXIS_WORDS = {
    "record": ("rec", "impact", "hit", "shot", "blow", "seg", "trial", "run", "test", "schlag", "messung", "coup"),
    "channel": ("ch", "kan", "can", "voie", "sensor", "signal"),
    "sample": ("sampl", "time", "zeit", "temps", "tid", "t", "point", "punkt", "abtast", "muestr", "campion"),
}
AXES_REMEDY = "State the order of the axes in the file, as in 'dims: channel,record,sample', or save each record alone"


def with_records_first(array: np.ndarray, n_channel: int, facts: Metadata, where: str, source: Source) -> np.ndarray:
    """An array of three dimensions with its axes in the order record, channel, sample.

    An entry ``dims`` decides. Without it the longest axis is that of the samples, and that of the channels has as many
    entries as there are channels. Without a number of channels the order is (record, channel, sample), or (sample,
    channel, record) as MATLAB saves it: so it is where there are as many records as channels, which is a remark.

    Parameters
    ----------
    array : (a, b, c) array
        The samples as they are in the file.
    n_channel : int
        Number of channels that the file names, 0 if it names none.
    facts : Metadata
        Metadata of the array.
    where : str
        The variable, for the message.
    source : Source
        The raw file.

    Returns
    -------
    (n_record, n_channel, n_sample) array
        A view.

    Raises
    ------
    ReadError
        If no axis fits the channels, or the samples are in the middle between as many records as channels.
    """
    if order := _stated_order(facts):
        moved = array.transpose([order.index(axis) for axis in AXIS_WORDS])
        if n_channel and moved.shape[1] != n_channel:
            problem = f"by its axes {', '.join(order)} it has {moved.shape[1]} channels, and {n_channel} have a name"
            raise source.error(where, problem, AXES_REMEDY)
        return moved
    sample = max((2, 0, 1), key=lambda i: array.shape[i])
    other_axes = [i for i in range(3) if i != sample]
    if sample == 1 and not n_channel:
        sample, other_axes = (0, [1, 2]) if array.shape[0] > array.shape[2] else (2, [0, 1])
    fitting = [i for i in other_axes if array.shape[i] == n_channel]
    if n_channel and not fitting:
        raise source.error(where, f"{array.shape} samples do not match {n_channel} channels", AXES_REMEDY)
    is_open = _is_square(array, sample)
    if is_open and sample == 1:
        problem = f"it has the shape {array.shape}: nothing says which axis is that of the records and of the channels"
        raise source.error(where, problem, AXES_REMEDY)
    channel = fitting[0] if fitting and not is_open else 1
    (record,) = set(range(3)) - {sample, channel}
    return array.transpose(record, channel, sample)


def axes_problem(array: np.ndarray, facts: Metadata) -> str:
    """Why an array of three dimensions may have its records and its channels the other way round.

    Parameters
    ----------
    array : (a, b, c) array
        The samples as they are in the file.
    facts : Metadata
        Metadata of the array.

    Returns
    -------
    str
        "" if the file states the order of its axes, or there are not as many records as channels.
    """
    sample = max((2, 0, 1), key=lambda i: array.shape[i])
    if _stated_order(facts) or not _is_square(array, sample):
        return ""
    order = "record, channel, sample" if sample == 2 else "sample, channel, record"
    return f"it has the shape {array.shape}, and nothing states the order of its axes: it is read as ({order})"


def _is_square(array: np.ndarray, sample: int) -> bool:
    """Whether an array has as many records as channels, and more than one."""
    first, second = (n for i, n in enumerate(array.shape) if i != sample)
    return bool(first == second > 1)


def _stated_order(facts: Metadata) -> tuple[str, ...]:
    """Axes of an array in the order that the file states, () without such an entry."""
    for name in DIMENSION_NAMES:
        texts = split_texts(list_of_texts(_plain(facts.get((name,)))))
        if len(texts) != len(AXIS_WORDS):
            continue
        for order in permutations(AXIS_WORDS):
            if all(any(w.startswith(AXIS_WORDS[a]) for w in words_of(t)) for a, t in zip(order, texts)):
                return order
    return ()


def _plain(value: Any) -> Any:
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
