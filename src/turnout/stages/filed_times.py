"""Times under which recordings are filed, and whether their own times contradict these."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta

from turnout.errors import ReadError
from turnout.records import LongRecording, Recording

# Largest time between a recording and its campaign: it may last into the night, and a clock may show local time.
MAX_CAMPAIGN_OFFSET = timedelta(days=2)
MISFILED_REMEDY = (
    "It is used. Move it to its day's campaign if it is another's; a logger's clock that was wrong does no harm"
)
# Largest time between the file's name and its content; names in local time differ by less.
MAX_NAME_OFFSET = timedelta(days=1)
TIME_REMEDY = "Which is right is not known. Rename it, or export it again with the right time"


def time_of_label(label: str) -> datetime | None:
    """Time of a unit from its file name, YYYYMMDDTHHMMSSZ.

    Parameters
    ----------
    label : str
        Label of the unit.

    Returns
    -------
    datetime or None
        Naive UTC; None without a valid time.
    """
    stem = label.rsplit("/", 1)[-1].split(".")[0]
    try:
        return datetime.strptime(stem, "%Y%m%dT%H%M%SZ")
    except ValueError:
        return None


def time_contradiction(
    path: str,
    recordings: Iterable[Recording | LongRecording],
    filed_at: datetime | None,
    tolerance: timedelta,
    remedy: str,
    reason: str = "wrong_time",
) -> ReadError | None:
    """Error if the first time noted in a file differs from the time that it is filed under.

    Parameters
    ----------
    path : str
        Path of the file.
    recordings : iterable of Recording or LongRecording
        Records of the file.
    filed_at : datetime or None
        Time that the file is filed under, naive UTC.
    tolerance : timedelta
        Largest accepted difference.
    remedy : str
        What to do, a sentence without its full stop.
    reason : str
        Code of the error; that of a remark where the file is used.

    Returns
    -------
    ReadError or None
        None if both times agree or one is not known; it is returned, not raised.
    """
    recorded_at = min((r.started_at for r in recordings if r.started_at is not None), default=None)
    if filed_at is None or recorded_at is None or abs(recorded_at - filed_at) <= tolerance:
        return None
    observation = f"says it was recorded on {recorded_at:%Y-%m-%d %H:%M}, and is filed under {filed_at:%Y-%m-%d %H:%M}"
    return ReadError(path, "the file", observation, remedy, reason)
