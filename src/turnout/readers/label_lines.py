"""Heads with a label in a line of its own above the values of the channels, as LabVIEW SignalExpress exports text.

``channel names:``, ``start times:`` and ``dt:`` stand above one cell for each channel, and ``data:`` above the numbers.
"""

import re

LABEL = re.compile(rb"[ \t]*([A-Za-z][A-Za-z .]{0,30}:)[ \t,;]*\r?\n")
NAMES = re.compile(rb"(?:channel )?names?:|channels?:", re.IGNORECASE)
DATA = re.compile(rb"(?:data|values|samples):", re.IGNORECASE)


def has_labels(head: bytes) -> bool:
    """Whether a text begins with the label of the channels' names alone in its line.

    Parameters
    ----------
    head : bytes
        First bytes of the file.

    Returns
    -------
    bool

    Examples
    --------
    >>> has_labels(b"channel names:\\nforce\\trail\\n"), has_labels(b"Channels: 2\\n")
    (True, False)
    """
    label = LABEL.match(head.removeprefix(b"\xef\xbb\xbf"))
    return bool(label and NAMES.fullmatch(label[1]))


def with_joined_labels(data: bytes) -> bytes:
    """A text with each label in front of its values, and the names above the numbers; the lines keep their numbers.

    Parameters
    ----------
    data : bytes
        Text of a file.

    Returns
    -------
    bytes
        Unchanged if it has no such head, or if no label of the data follows.
    """
    if not has_labels(data):
        return data
    lines: list[bytes] = []
    names = b""
    position = len(data) - len(data.removeprefix(b"\xef\xbb\xbf"))
    while (label := LABEL.match(data, position)) and (end := data.find(b"\n", label.end()) + 1):
        if DATA.fullmatch(label[1]):
            return b"".join((*lines, names, data[label.end() :]))
        values = data[label.end() : end]
        is_of_names = bool(NAMES.fullmatch(label[1]))
        lines += [b"\n", b"\n" if is_of_names else label[1] + b"\t" + values]
        names = values if is_of_names else names
        position = end
    return data
