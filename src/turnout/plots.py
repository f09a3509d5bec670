"""Draw recordings, receptances and modal models for a notebook; matplotlib is imported when the first is drawn.

No result depends on this module, so fingerprints of code do not count it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.units import SI

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from turnout.records import ModalModel, Mode, Receptance, Recording

BLUE, ORANGE, GREY = "#1f5a99", "#c8501e", "#8a8f98"
SHADE, GRID = "#e3e5e9", "#e9ebee"
FREQUENCY_RANGE = (30.0, 1600.0)  # Hz, of the axis; the resonances of a track lie between 50 and 800 Hz
TICKS = (30, 50, 100, 200, 300, 500, 1000, 1600)  # Hz
MAX_POINTS = 4000  # per curve; longer ones are drawn by the extremes of each stretch, which looks the same
BOX = {"boxstyle": "square,pad=0.25", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}  # behind words


def plot_recording(recording: Recording, figure: Figure | SubFigure | None = None) -> np.ndarray:
    """Draw every channel of a recording over time, (n_channel,) axes; see ``Recording.plot``.

    Parameters
    ----------
    recording : Recording
        The recording.
    figure : Figure or SubFigure or None
        Figure to draw into; by default a new one.

    Returns
    -------
    (n_channel,) array of Axes
        See ``Recording.plot``.
    """
    n_channel = len(recording.channels)
    axes = _figure(figure, 1.0 + 1.5 * n_channel).subplots(n_channel, 1, sharex=True, squeeze=False)[:, 0]
    for one, channel, samples in zip(axes, recording.channels, recording.samples):
        one.plot(*_extremes(samples, recording.rate), color=BLUE, linewidth=0.9)
        one.set_ylabel(f"{channel.quantity} [{SI.get(channel.quantity, '-')}]")
        one.margins(x=0.0)
        _tidy(one, channel.name)
    axes[-1].set_xlabel("time [s]")
    return axes


def plot_receptance(receptance: Receptance, figure: Figure | SubFigure | None = None) -> np.ndarray:
    """Draw magnitude and coherence of a receptance, (2,) axes; see ``Receptance.plot``.

    Parameters
    ----------
    receptance : Receptance
        The receptance.
    figure : Figure or SubFigure or None
        Figure to draw into; by default a new one.

    Returns
    -------
    (2,) array of Axes
        See ``Receptance.plot``.
    """
    grid = {"height_ratios": (2.0, 1.0)}
    axes = _figure(figure, 5.6).subplots(2, 1, sharex=True, gridspec_kw=grid)
    magnitude, coherence = axes
    frequency = receptance.frequency
    _draw_receptance(magnitude, receptance)
    limits = np.abs(receptance.h1), np.abs(receptance.h2)
    magnitude.fill_between(frequency, *limits, color=BLUE, alpha=0.25, linewidth=0.0, label="H1 to H2")
    limits = receptance.coherence_low, receptance.coherence_high
    coherence.fill_between(frequency, *limits, color=BLUE, alpha=0.25, linewidth=0.0, label="95 % limits")
    coherence.plot(frequency, receptance.coherence, color=BLUE, linewidth=1.4, label="coherence")
    coherence.set_ylim(0.0, 1.04)
    coherence.set_ylabel("coherence [-]")
    _shade_failed(coherence, receptance)
    _frequency_axis(coherence)
    coherence.set_xlabel("frequency [Hz]")
    _tidy(coherence)
    for one in axes:
        one.legend(frameon=False, fontsize="small", loc="lower left")
    return axes


def plot_model(model: ModalModel, figure: Figure | SubFigure | None = None) -> np.ndarray:
    """Draw the modes of a modal model with their errors; see ``ModalModel.plot``.

    Parameters
    ----------
    model : ModalModel
        The modal model.
    figure : Figure or SubFigure or None
        Figure to draw into; by default a new one.

    Returns
    -------
    (n_axes,) array of Axes
        See ``ModalModel.plot``.
    """
    rows: list[Any] = [["receptance"] * max(len(model.modes), 1)] if model.receptance is not None else []
    rows += [[mode.band for mode in model.modes]] if model.modes else []
    if not rows:
        axes = _figure(figure, 2.0).subplots()
        axes.set_axis_off()
        axes.text(0.0, 0.5, repr(model), wrap=True, va="center")
        return np.array([axes], dtype=object)
    figure = _figure(figure, 3.4 * len(rows))
    by_name = figure.subplot_mosaic(rows)
    if model.receptance is not None:
        _draw_receptance(by_name["receptance"], model.receptance)
        _draw_fitted(by_name["receptance"], model)
        by_name["receptance"].set_xlabel("frequency [Hz]")
        by_name["receptance"].legend(frameon=False, fontsize="small", loc="lower left")
    for k, mode in enumerate(model.modes):
        if model.receptance is not None:
            _mark_mode(by_name["receptance"], mode)
        _draw_estimates(by_name[mode.band], model, mode)
        by_name[mode.band].set_ylabel("" if k else "damping ratio [%]")
    if model.modes:
        words = by_name[model.modes[0].band].get_legend_handles_labels()
        figure.legend(*words, loc="outside lower center", ncols=2, frameon=False, fontsize="small")
    return np.array(list(by_name.values()), dtype=object)


def _draw_receptance(axes: Axes, receptance: Receptance) -> None:
    """Draw the magnitude of H1: a line where it passes the gate, grey on a shade elsewhere."""
    magnitude = np.abs(receptance.h1)
    axes.plot(receptance.frequency, magnitude, color=GREY, linewidth=0.8)
    passed = np.where(receptance.passed, magnitude, np.nan)
    axes.plot(receptance.frequency, passed, color=BLUE, linewidth=1.6, label="H1, passes the gate")
    inside = (receptance.frequency >= FREQUENCY_RANGE[0]) & (receptance.frequency <= FREQUENCY_RANGE[1])
    inside &= np.isfinite(magnitude) & (magnitude > 0.0)
    if inside.any():
        axes.set_ylim(np.quantile(magnitude[inside], 0.005) / 1.5, 1.8 * magnitude[inside].max())
    axes.set_yscale("log")
    axes.set_ylabel("receptance [m/N]")
    _shade_failed(axes, receptance)
    _frequency_axis(axes)
    _tidy(axes, f"Receptance, mean of {receptance.n} impacts")


def _draw_fitted(axes: Axes, model: ModalModel) -> None:
    """Draw the magnitude of the receptance of the modes, where it was fitted."""
    if model.fitted_receptance is None or model.receptance is None:
        return
    frequency = model.receptance.frequency
    frequency = frequency[(frequency >= FREQUENCY_RANGE[0]) & (frequency <= FREQUENCY_RANGE[1])]
    magnitude = np.abs(model.fitted_receptance.at(frequency))
    axes.plot(frequency, magnitude, color=ORANGE, linewidth=1.2, label="modes of the fit")


def _mark_mode(axes: Axes, mode: Mode) -> None:
    """Mark a mode over frequency, with its values in words."""
    axes.axvline(mode.frequency, color=ORANGE, linewidth=1.0, linestyle="--", zorder=1)
    axes.annotate(
        f"{mode.band}\n{mode.frequency_text}", (mode.frequency, 0.04), xycoords=axes.get_xaxis_transform(),
        xytext=(5, 0), textcoords="offset points", va="bottom", fontsize="small", color=ORANGE, bbox=BOX,
    )  # fmt: skip


def _draw_estimates(axes: Axes, model: ModalModel, mode: Mode) -> None:
    """Draw the estimates of one mode from the single impacts, and their mean with its 95 % interval."""
    rows = [e for e in model.per_impact if e.get("band") == mode.band]
    if rows:
        frequency, damping = (np.array([e[name] for e in rows]) for name in ("frequency", "damping"))
        errors = [np.array([e.get(f"{n}_se") or np.nan for e in rows], dtype=float) for n in ("frequency", "damping")]
        axes.errorbar(
            frequency, 100.0 * damping, xerr=errors[0], yerr=100.0 * errors[1], fmt="o", color=GREY, markersize=3.5,
            elinewidth=0.9, label="one impact, ± standard error",
        )  # fmt: skip
    axes.errorbar(
        [mode.frequency], [100.0 * mode.damping],
        xerr=_distances(mode.frequency, mode.frequency_low, mode.frequency_high, 1.0),
        yerr=_distances(mode.damping, mode.damping_low, mode.damping_high, 100.0),
        fmt="D", color=ORANGE, markersize=5.5, elinewidth=2.0, capsize=4.0, zorder=5, label="mean, 95 % interval",
    )  # fmt: skip
    axes.set_xlabel("frequency [Hz]")
    axes.margins(0.12)
    axes.ticklabel_format(useOffset=False)
    axes.locator_params(nbins=5)
    _tidy(axes, f"{mode.band} {mode.frequency_text}\ndamping {mode.damping_text}")


def _distances(value: float, low: float | None, high: float | None, factor: float) -> np.ndarray | None:
    """(2, 1) distances of the ends of an interval from its value, None without an interval."""
    if low is None or high is None:
        return None
    return factor * np.abs(np.array([[value - low], [high - value]]))


def _shade_failed(axes: Axes, receptance: Receptance) -> None:
    """Shade the frequencies whose lines fail the gate."""
    frequency = receptance.frequency
    if frequency.size < 2:
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~receptance.passed).astype(int), [0]])))
    half = 0.5 * (frequency[1] - frequency[0])
    for k, (first, last) in enumerate(zip(edges[::2], edges[1::2] - 1)):
        label = None if k else "fails the gate"
        span = frequency[first] - half, frequency[last] + half
        axes.axvspan(*span, color=SHADE, linewidth=0.0, zorder=0, label=label)


def _frequency_axis(axes: Axes) -> None:
    """Logarithmic axis of frequency over the range of a track's resonances, with plain numbers."""
    axes.set_xscale("log")
    axes.set_xlim(*FREQUENCY_RANGE)
    axes.set_xticks(TICKS, [str(tick) for tick in TICKS])
    axes.minorticks_off()


def _tidy(axes: Axes, title: str = "") -> None:
    """Grid below the curves, no frame above and to the right, and the title at the left."""
    axes.grid(True, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if title:
        axes.set_title(title, loc="left", fontsize="medium")


def _figure(figure: Figure | SubFigure | None, height: float) -> Figure | SubFigure:
    """The given figure, or a new one of ``height`` [inch]."""
    if figure is not None:
        return figure
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(8.0, height), layout="constrained")


def _extremes(samples: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """(time [s], values) of a curve; of a long one the least and the largest value of each stretch.

    >>> time, values = _extremes(np.sin(np.arange(1e5)), 1e3)
    >>> len(values) <= MAX_POINTS, round(float(values.max()), 3)
    (True, 1.0)
    """
    if samples.size <= MAX_POINTS:
        return np.arange(samples.size) / rate, samples
    step = -(-2 * samples.size // MAX_POINTS)
    starts = np.arange(0, samples.size, step)
    values = np.stack([np.minimum.reduceat(samples, starts), np.maximum.reduceat(samples, starts)], axis=1)
    return np.repeat(starts / rate, 2), values.ravel()
