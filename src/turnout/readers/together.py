"""Channels that stand side by side in a record: of one rate, and from one moment on."""

from turnout.readers.precision import TEXT


def seconds_behind(moments):
    """Seconds of each channel's time stamp behind the first one's; 0 where not all have a comparable one.

    >>> from datetime import datetime
    >>> seconds_behind([datetime(2024, 5, 13, 10, 0, 1), datetime(2024, 5, 13, 10, 0, 0, 500_000)])
    [0.0, -0.5]
    """
    if None in moments or len({moment.tzinfo is None for moment in moments}) > 1:
        return [0.0] * len(moments)
    return [(moment - moments[0]).total_seconds() for moment in moments]


def check_together(names, steps, starts, where, source):
    """ReadError where channels state different steps [s] (0: not stated), or starts [s] more than half a step apart.

    Less than that apart are the channels of converters that take turns.
    """
    step = steps[0]
    if any(abs(other - step) > TEXT * abs(step) for other in steps):
        found = f"its channels have different steps: {sorted(set(steps))} s"
        remedy = "Record all channels at one rate, or export those of one rate to one file"
        raise source.error(where, found, remedy, reason="wrong_rate")
    early, late = min(starts), max(starts)
    if step and late - early > 0.5 * abs(step):
        first, last = names[starts.index(early)], names[starts.index(late)]
        found = f"channel {last!r} begins {late - early:.6g} s after channel {first!r}"
        remedy = "Start all channels by one trigger, or export them cut to the stretch that they share"
        raise source.error(where, found, remedy, reason="clock_drift")
