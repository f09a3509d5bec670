"""Describe the contents of a raw file in words, and as plain values for other programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from turnout.stages.file_contents import ChannelContents, FileContents

MAX_EVENTS = 12  # impacts or trains that are listed by their times


def contents_lines(contents: FileContents) -> list[str]:
    """Contents of a file as lines of text.

    Parameters
    ----------
    contents : FileContents
        Contents of the file.

    Returns
    -------
    list of str
        The name of the file, then a line for each subject.
    """
    lines = [f"{contents.path}: {contents.meaning} ({contents.format}), {_size(contents.size)}"]
    if contents.responses is not None:
        return lines + _response_lines(contents)
    lines.append(_line("records", _records(contents)))
    lines.append(_line("rate", _rate(contents)))
    lines += [_line("", f"stated as {statement}") for statement in contents.rate.statements]
    lines.append(_line("times", _times(contents)))
    lines += [_line("channels" if k == 0 else "", text) for k, text in enumerate(_channel_texts(contents.channels))]
    lines.append(_line("force", _candidates(contents, "force")))
    lines.append(_line("response", _candidates(contents, "response")))
    lines += _event_lines(contents)
    lines += [
        _line("unknown", f"{name}: {text} may state a rate, scale or unit") for name, text in contents.unexplained
    ]
    return lines + [_line("problem", problem) for problem in contents.problems]


def contents_summary(contents: FileContents) -> str:
    """Contents of a file in one line.

    Parameters
    ----------
    contents : FileContents
        Contents of the file.

    Returns
    -------
    str
        Path, format, records, channels, rate, first time, what is in it.
    """
    if contents.responses is not None:
        return f"{contents.path}: {contents.format}, {_response_words(contents)}"
    parts = [
        contents.format,
        _records(contents),
        " ".join(f"{c.name}[{c.unit or '?'}]" for c in contents.channels) or "no channels",
        "rate not stated" if contents.rate.value is None else f"{contents.rate.value:.9g} Hz",
        _moment(contents.starts[0], contents.has_zone) if contents.starts else "no time",
        _event_words(contents),
    ]
    if contents.problems:
        parts.append(f"{len(contents.problems)} problems, the first: {contents.problems[0]}")
    return f"{contents.path}: {', '.join(parts)}"


def contents_values(contents: FileContents) -> dict[str, Any]:
    """Contents of a file as plain values, for JSON.

    Parameters
    ----------
    contents : FileContents
        Contents of the file.

    Returns
    -------
    dict of str to any
        Texts, numbers, lists and dicts of these; None for what is not known.
    """
    values: dict[str, Any] = {
        "path": contents.path,
        "format": contents.format,
        "size_bytes": contents.size,
        "kind": contents.kind or None,
        "records": contents.n_records,
        "samples_per_record": list(contents.n_samples),
        "problems": list(contents.problems),
    }
    if contents.responses is not None:
        responses = contents.responses
        step = float(responses.frequency[1] - responses.frequency[0])
        return values | {
            "lowest_hz": float(responses.frequency[0]),
            "highest_hz": float(responses.frequency[-1]),
            "step_hz": step,
            "responses": [{"name": n, "unit": u} for n, u in zip(responses.names, responses.units)],
        }
    starts = contents.starts
    return values | {
        "rate_hz": contents.rate.value,
        "rate_statements": list(contents.rate.statements),
        "started_at": starts[0].isoformat() if starts else None,
        "last_started_at": starts[1].isoformat() if starts else None,
        "has_time_zone": contents.has_zone,
        "unexplained": dict(contents.unexplained),
        "channels": [
            {
                "name": c.name,
                "unit": c.unit or None,
                "minimum": None if math.isnan(c.minimum) else c.minimum,
                "maximum": None if math.isnan(c.maximum) else c.maximum,
                "role": c.role.name or None,
                "why": c.role.why or None,
            }
            for c in contents.channels
        ],
        "force_candidates": [c.name for c in contents.with_role("force")],
        "response_candidates": [c.name for c in contents.with_role("response")],
        contents.kind or "events": [
            {"record": e.record, "time_s": e.time, "peak" if contents.kind == "impacts" else "length_s": e.size}
            for e in contents.events
        ],
    }


def _line(what: str, words: str) -> str:
    return f"  {what:<10} {words}"


def _size(n_byte: int) -> str:
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_byte >= size:
            return f"{n_byte / size:.3g} {unit}"
    return f"{n_byte} bytes"


def _records(contents: FileContents) -> str:
    low, high = contents.n_samples
    count = "1 record" if contents.n_records == 1 else f"{contents.n_records} records"
    samples = f"{high}" if low == high else f"{low} to {high}"
    length = f" ({high / contents.rate.value:.4g} s)" if contents.rate.value and low == high else ""
    return f"{count} of {samples} samples{length}"


def _rate(contents: FileContents) -> str:
    if contents.rate.problem:
        return f"not clear: {contents.rate.problem}"
    if contents.rate.value is None:
        return "not stated in the file: the layout must give it"
    return f"{contents.rate.value:.9g} Hz"


def _times(contents: FileContents) -> str:
    if contents.starts is None:
        return "not stated in the file: the campaign or the file's name must give the day"
    first, last = contents.starts
    words = _moment(first, contents.has_zone)
    if last != first:
        words += f" to {_moment(last, contents.has_zone)}"
    return words if contents.has_zone else f"{words} (no time zone stated: the layout's time_zone holds)"


def _moment(stamp: datetime, has_zone: bool) -> str:
    return (
        stamp.isoformat(sep=" ", timespec="milliseconds" if stamp.microsecond else "seconds")
        if has_zone
        else (
            stamp.replace(tzinfo=None).isoformat(sep=" ", timespec="milliseconds" if stamp.microsecond else "seconds")
        )
    )


def _channel_texts(channels: Sequence[ChannelContents]) -> list[str]:
    names = [repr(channel.name) for channel in channels]
    width = max(map(len, names), default=0)
    return [
        f"{k}  {name:<{width}}  {f'[{c.unit}]' if c.unit else 'no unit':<10}  {c.minimum:.5g} to {c.maximum:.5g}"
        + (f"  time axis: {c.role.why}" if c.role.name == "time" else "")
        for k, (name, c) in enumerate(zip(names, channels))
    ]


def _candidates(contents: FileContents, role: str) -> str:
    channels = contents.with_role(role)
    return "; ".join(f"{c.name!r} ({c.role.why})" for c in channels) or "no candidate"


def _event_words(contents: FileContents) -> str:
    n = len(contents.events)
    if contents.kind == "impacts":
        return "1 impact" if n == 1 else f"{n} impacts"
    if contents.kind == "trains":
        return "1 train" if n == 1 else f"{n} trains"
    return "no impact and no train found"


def _event_lines(contents: FileContents) -> list[str]:
    if contents.rate.value is None:
        return [_line("impacts", "not sought without a rate")]
    if contents.kind == "impacts":
        unit = next(c.unit for c in contents.channels if c.name == contents.event_channel)
        sizes = sorted(abs(e.size) for e in contents.events)
        span = f"peaks {sizes[0]:.4g} to {sizes[-1]:.4g} {unit or '(no unit)'} in {contents.event_channel!r}"
        return [_line("impacts", f"{len(sizes)}, {span}"), _line("", _event_times(contents))]
    if contents.kind == "trains":
        stretches = f"{len(contents.events)}, parts with strong vibration for longer than elsewhere"
        return [_line("trains", stretches), _line("", _event_times(contents))]
    return [_line("impacts", "none found; no train found either")]


def _event_times(contents: FileContents) -> str:
    moments = {f"{e.time:.4g} s" for e in contents.events}
    if len(moments) == 1 and len({e.record for e in contents.events}) == len(contents.events) > 1:
        return f"one in each of {len(contents.events)} records, at {moments.pop()}"
    times = [f"record {e.record} at {e.time:.4g} s" for e in contents.events[:MAX_EVENTS]]
    return ", ".join(times) + (" ..." if len(contents.events) > MAX_EVENTS else "")


def _response_words(contents: FileContents) -> str:
    responses = contents.responses
    if responses is None:
        return ""
    f = responses.frequency
    units = ", ".join(dict.fromkeys(u for u in responses.units if u)) or "no unit"
    return f"{len(responses.frf)} frequency responses of {len(f)} lines, {f[0]:.4g} to {f[-1]:.5g} Hz, {units}"


def _response_lines(contents: FileContents) -> list[str]:
    names = contents.responses.names if contents.responses is not None else ()
    listed_names = "; ".join(names[:MAX_EVENTS]) + (" ..." if len(names) > MAX_EVENTS else "")
    return [
        _line("contents", _response_words(contents)),
        _line("step", f"{contents.responses.frequency[1] - contents.responses.frequency[0]:.6g} Hz")
        if contents.responses is not None
        else "",
        _line("responses", listed_names),
        _line("impacts", "none: the responses are averaged, so no impact can be judged"),
    ]
