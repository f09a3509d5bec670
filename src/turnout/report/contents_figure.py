"""Draw every channel of a raw file, or its frequency responses, as an SVG file."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from turnout.stages.file_contents import FileContents

MAX_RECORDS = 10  # records that are drawn over each other
MAX_POINTS = 4000  # per curve: longer ones are drawn by the extremes of each stretch
BLUE, GRID = "#1f5a99", "#e9ebee"


def contents_figure(contents: FileContents) -> str:
    """SVG with one panel per channel, the first records over each other.

    Parameters
    ----------
    contents : FileContents
        Contents of the file.

    Returns
    -------
    str
        The drawing.
    """
    from matplotlib.figure import Figure

    n_panel = max(len(contents.channels), 1)
    figure = Figure(figsize=(9.0, 0.8 + 1.7 * n_panel), layout="constrained")
    axes = figure.subplots(n_panel, 1, squeeze=False)[:, 0]
    if contents.responses is not None:
        _draw_responses(axes[0], contents)
    else:
        for index, one in enumerate(axes[: len(contents.channels)]):
            _draw_channel(one, contents, index)
            one.sharex(axes[0])
        axes[-1].set_xlabel("time [s]" if contents.rate.value else "sample")
    figure.suptitle(contents.path, x=0.01, ha="left", fontsize="medium")
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def _draw_channel(axes: Axes, contents: FileContents, index: int) -> None:
    channel, rate = contents.channels[index], contents.rate.value or 1.0
    for record in contents.records[:MAX_RECORDS]:
        if channel.name not in record.names:
            continue
        x = np.asarray(record.samples[record.names.index(channel.name)], dtype=float)
        axes.plot(*_extremes(x, rate), color=BLUE, linewidth=0.7, alpha=0.8)
    role = f", {channel.role.name}: {channel.role.why}" if channel.role.name else ""
    axes.set_title(f"{channel.name}{role}", loc="left", fontsize="small")
    axes.set_ylabel(f"[{channel.unit or '?'}]")
    axes.margins(x=0.0)
    axes.grid(True, color=GRID, linewidth=0.7)


def _draw_responses(axes: Axes, contents: FileContents) -> None:
    responses = contents.responses
    if responses is None:
        return
    above = responses.frequency > 0.0
    for frf in responses.frf[:MAX_RECORDS]:
        axes.loglog(responses.frequency[above], np.abs(frf[above]), linewidth=0.8)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"[{responses.units[0] or '?'}]")
    axes.grid(True, color=GRID, linewidth=0.7)


def _extremes(x: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], values) of a curve; of a long one the least and the largest value of each stretch."""
    if len(x) <= MAX_POINTS:
        return np.arange(len(x)) / rate, x
    n = 2 * len(x) // MAX_POINTS
    whole = x[: len(x) // n * n].reshape(-1, n)
    values = np.stack([whole.min(axis=1), whole.max(axis=1)], axis=1).ravel()
    return np.arange(len(values)) * (0.5 * n / rate), values
