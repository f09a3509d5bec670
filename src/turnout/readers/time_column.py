"""Which column of a table is the time, and how long one of its numbers lasts."""

from turnout.readers.variables import TIME

WORDS = (*TIME, "zeit", "tid", "temps", "tempo", "tiempo", "tijd")
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6}


def time_column(names, units):
    """Number of the column that is the time: by its name, else by its unit; None without one.

    No sensor of ours measures in seconds, so that a unit of time tells a column whatever its language.

    Examples
    --------
    >>> time_column(["Kraft", "Zeit"], ["N", "s"]), time_column(["idő", "erő"], ["ms", "N"])
    (1, 0)
    >>> time_column(["force", "rail"], ["N", ""])
    """
    for i, name in enumerate(names):
        if name.strip().lower() in WORDS:
            return i
    return next((i for i, unit in enumerate(units) if unit.strip() and _plain_time(unit) in SECONDS), None)


def seconds_per_number(unit, source):
    """How many seconds a number in the time column is; ReadError for a unit that is none of time."""
    if _plain_time(unit) not in SECONDS:
        remedy = f"Export the time in one of {', '.join(SECONDS)[2:]}"
        raise source.error("the time column", f"its unit {unit!r} is not known", remedy, reason="unit_unknown")
    return SECONDS[_plain_time(unit)]


def _plain_time(unit):
    return unit.strip().replace("\u03bc", "µ")
