"""Describe campaigns whose mode departs from that of the campaigns before: sentences, and rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95
from turnout.counts import count_of
from turnout.report.formatting import campaign_of, supported_decimals

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from typing import Any

    Rows = Sequence[Mapping[str, Any]]

# Value, median before, and distance in standard deviations
COLUMNS = (
    ("frequency_hz", "frequency_track_hz", "frequency_distance"),
    ("damping_ratio", "damping_track", "damping_distance"),
)
RESULTS = {"departs": "differs", "uncertain": "too uncertain to compare"}


def departure_sentences(off_track: Rows, modes: Rows) -> list[str]:
    """One sentence for each time from which on, or at which, a mode differs from that of the campaigns before.

    A mode that changed for good is part of the history of later campaigns, which then no longer depart from it. They
    belong to the change as long as they are nearer to its mean than to the median before it.

    Parameters
    ----------
    off_track : sequence of mapping
        Rows of ``modes_off_track`` of one section.
    modes : sequence of mapping
        All its modes, with ``band``, ``campaign_id``, ``measured_at_utc``, ``frequency_hz`` and ``damping_ratio``.

    Returns
    -------
    list of str
    """
    sentences = []
    for band in sorted({m["band"] for m in off_track}):
        of_band = [m for m in off_track if m["band"] == band]
        departures = {m["measured_at_utc"]: m for m in of_band if m["verdict"] == "departs"}
        values = {m["measured_at_utc"]: m for m in (*modes, *of_band) if m["band"] == band}
        newest = max(values)
        for group in _groups(departures, values):
            sentences.append(_sentence(band, departures[group[0]], [values[t] for t in group], group[-1] == newest))
        uncertain = [m for m in of_band if m["verdict"] == "uncertain"]
        if uncertain:
            days = ", ".join(campaign_of(m) for m in sorted(uncertain, key=lambda m: m["measured_at_utc"]))
            sentences.append(f"Too uncertain to show whether the {band} mode continues that before: {days}.")
    return sentences


def _groups(
    departures: Mapping[datetime, Mapping[str, Any]], values: Mapping[datetime, Mapping[str, Any]]
) -> Iterator[list[datetime]]:
    """Times of campaigns that belong to one change, the oldest first."""
    group: list[datetime] = []
    for time in sorted(values):
        if group and (time in departures or _is_nearer(values[time], departures[group[0]], [values[t] for t in group])):
            group.append(time)
            continue
        if group:
            yield group
        group = [time] if time in departures else []
    if group:
        yield group


def _is_nearer(mode: Mapping[str, Any], first: Mapping[str, Any], group: Rows) -> bool:
    """Whether a mode is nearer to the mean of a group than to the median before, in what differed most at first."""
    column, median, _ = max(COLUMNS, key=lambda columns: first[columns[2]])
    mean = np.mean([m[column] for m in group])
    return bool(abs(mode[column] - mean) < abs(mode[column] - first[median]))


def _sentence(band: str, first: Mapping[str, Any], group: Rows, is_present: bool) -> str:
    """The sentence of one change."""
    begin, end = campaign_of(group[0]), campaign_of(group[-1])
    when = f"On {begin}" if len(group) == 1 else f"From {begin} to {end}"
    when = f"From {begin} on" if is_present else when
    frequency = f"{_range(group, 'frequency_hz', 1)} Hz against {first['frequency_track_hz']:.1f} Hz"
    damping = f"damping {_range(group, 'damping_ratio', 3)} against {first['damping_track']:.3f}"
    return (
        f"{when} the {band} mode differs from that before: {frequency}, {damping} "
        f"({count_of(len(group), 'campaign')}, against the median of {first['n_history']} before). "
        "It is another mode, or the track has changed."
    )


def _range(group: Rows, column: str, decimals: int) -> str:
    low, high = (f"{end([m[column] for m in group]):.{decimals}f}" for end in (min, max))
    return low if low == high else f"{low} to {high}"


def departure_rows(off_track: Rows) -> list[dict[str, str]]:
    """Rows of the table of such campaigns, the oldest first.

    Parameters
    ----------
    off_track : sequence of mapping
        Rows of ``modes_off_track`` of one section.

    Returns
    -------
    list of dict
        ``when``, ``mode``, ``result``, ``frequency`` and ``damping`` with half of their 95 % intervals, the medians
        before, ``n`` campaigns before, ``residue`` ratio and ``shape`` criterion in words.
    """
    return [
        {
            "when": campaign_of(m),
            "mode": m["band"],
            "result": RESULTS[m["verdict"]],
            "frequency": _with_error(m["frequency_hz"], m["frequency_se_hz"], 1),
            "frequency_before": f"{m['frequency_track_hz']:.1f}",
            "damping": _with_error(m["damping_ratio"], m["damping_se"], 3),
            "damping_before": f"{m['damping_track']:.3f}",
            "n": m["n_history"],
            "residue": "–" if m["residue_ratio"] is None else f"{m['residue_ratio']:.2g}",
            "shape": "–" if m["shape_mac"] is None else f"{m['shape_mac']:.2f}",
        }
        for m in sorted(off_track, key=lambda m: (m["measured_at_utc"], m["band"]))
    ]


def _with_error(value: float, error: float | None, decimals: int) -> str:
    """A value with half of its 95 % interval, that of the campaign alone."""
    if not error:
        return f"{value:.{decimals}f} ± ?"
    half = Z95 * error
    n = supported_decimals(half, decimals)
    return f"{value:.{n}f} ± {half:.{n}f}"
