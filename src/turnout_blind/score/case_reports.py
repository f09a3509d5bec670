"""Report single cases: what was concealed, how it shows in the signals, the answer, and the fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.campaign import stage
from turnout_blind.effect import load_effects
from turnout_blind.march import TIME_STEP
from turnout_blind.record import RATE, passage_motion, sensor_positions
from turnout_blind.reveal import read_revealed
from turnout_blind.run import simulate_impacts
from turnout_blind.score.answers import answers_of
from turnout_blind.score.matching import judge
from turnout_blind.score.plots import most_changed, outcome, pyplot, relative_changes, save, spectrum
from turnout_blind.strata import PLAIN, CasePlan

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from typing import Any

    from matplotlib.axes import Axes

    from turnout_blind.effect import Effect
    from turnout_blind.score.matching import CaseResult
    from turnout_blind.site import Site
    from turnout_blind.true_site import World

METRE_KEYS = "position depth length gap close play amplitude shift wavelength reach"
UNITS = dict.fromkeys(METRE_KEYS.split(), "m") | {
    "delay": "s", "frequency": "Hz", "mass": "kg", "limit": "m/s²", "coefficient": "1/K", "angle": "rad",
    "phase": "rad",
}  # fmt: skip
FIT_LABELS = {"before": "base model", "decoy": "decoy", "rival": "second best effect", "after": "named effect"}
MIN_SPECTRUM_CHANGE = (
    0.05  # median difference of two spectra (logarithm) below which their curves coincide in a picture
)


def choose_cases(results: Sequence[CaseResult]) -> list[str]:
    """Ids of three cases: the least visible single effect named rightly, two effects, and the most visible failure.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    list of str
        Ids, fewer where there is no such case.
    """
    right = [j for j in results if j.stratum == "single" and j.is_clear and outcome(j) == "right"]
    double = [j for j in results if j.stratum == "double"]
    failed = [j for j in results if j.kinds and j.is_clear and outcome(j) in ("wrong", "none", "unknown")]
    failed = [j for j in failed if j.stratum in ("single", "double") or j.wrong_names]
    chosen = [min(right, key=lambda j: j.gain)] if right else []
    chosen += [max(double, key=lambda j: (sum(h == "named" for h in j.matches), j.gain))] if double else []
    chosen += [max(failed, key=lambda j: (bool(j.wrong_names), j.gain))] if failed else []
    return list(dict.fromkeys(j.case for j in chosen))


def case_texts(
    out: str | Path,
    page: str | Path,
    cases: Sequence[str] | None = None,
    extra_names: Mapping[str, Sequence[str]] | None = None,
    oracle: Mapping[str, tuple[float, float]] | None = None,
    effects: Iterable[str | Path] = (),
) -> str:
    """Markdown reports of some cases. A picture of each is written beside the page.

    The generator makes the recordings without the effect from the seed in the truth.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    page : str or Path
        File of the page.
    cases : sequence of str or None
        Ids; None: three are chosen.
    extra_names : mapping or None
        Right names of added effects by kind.
    oracle : mapping or None
        Result of ``read_oracle``.
    effects : iterable of str or Path
        Folders with further effects.

    Returns
    -------
    str
        Markdown.
    """
    truths, rows, _ = read_revealed(out)
    results = {case: judge(truths[case], answers_of(rows[case]), extra_names) for case in truths}
    texts = []
    for case in cases or choose_cases(list(results.values())):
        name = f"{Path(page).stem}_story_{case}.svg"
        draw_case(
            truths[case],
            rows[case],
            (oracle or {}).get(case, (None, None))[1],
            Path(page).with_name(name),
            load_effects(*effects),
        )
        texts.append(f"### {_title(truths[case])}\n\n{case_text(truths[case], rows[case])}\n\n![{case}]({name})")
    return "\n\n".join(texts)


def _title(truth: Mapping[str, Any]) -> str:
    return f"{truth['case']}: " + (" and ".join(e["kind"].replace("_", " ") for e in truth["effects"]) or "nothing")


def case_text(truth: Mapping[str, Any], rows: Sequence[Mapping[str, Any]] | None) -> str:
    """What was concealed and what was answered, in sentences.

    Parameters
    ----------
    truth : mapping
        Truth of the case.
    rows : sequence of mapping or None
        Finding rows; None: no answer.

    Returns
    -------
    str
        The sentences.
    """
    concealed = "; ".join(
        f"{e['kind'].replace('_', ' ')} ({_numbers({**e['where'], **e['parameters']})})" for e in truth["effects"]
    )
    visibility = truth["visible"]
    answers = " ".join(f"*{_row_text(row)}*" for row in rows) if rows else "*no answer*"
    return (
        f"Concealed: {concealed or 'nothing'}. It makes up {visibility['hammer_pct']:.0f} % of the impacts' and "
        f"{visibility['passage_pct']:.0f} % of the passages' response at the sensor that shows it most. "
        f"Answer: {answers}"
    )


def _row_text(row: Mapping[str, Any]) -> str:
    sure = row.get("probability")
    sentence = row.get("sentence") or row.get("term") or ""
    return f"{row['verdict'].replace('_', ' ')}{'' if sure is None else f' (probability {sure:.2f})'}: {sentence}"


def _numbers(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{k} {_number(v, UNITS.get(k, ''))}" for k, v in values.items())


def _number(value: Any, unit: str) -> str:
    """
    >>> _number(0.000323, "m"), _number(1.312, ""), _number(7, "")
    ('0.323 mm', '1.31', '7')
    """
    if not isinstance(value, float):
        return str(value)
    if unit in ("m", "s") and abs(value) < 0.1:
        return f"{1e3 * value:.3g} m{unit}"
    return f"{value:.3g} {unit}".rstrip()


def draw_case(
    truth: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]] | None,
    oracle: float | None,
    path: Path,
    effects: Mapping[str, Effect],
) -> Path:
    """Draw one case: impact and train with and without the effect, the track with truth and answers, and the fits.

    Parameters
    ----------
    truth : mapping
        Truth of the case.
    rows : sequence of mapping or None
        Finding rows; None: no answer.
    oracle : float or None
        Held-out fit with the true effect [%]; None: not computed.
    path : Path
        File of the picture.
    effects : mapping
        Effects by kind.

    Returns
    -------
    Path
        The picture.
    """
    plt = pyplot()
    concealed = tuple((e["kind"], e["rung"]) for e in truth["effects"])
    plan = CasePlan(truth["stratum"], concealed, tuple(truth["seed"]), truth.get("panel", PLAIN))
    _, site, world, _ = stage(plan, effects)
    figure, axes = plt.subplots(2, 2, figsize=(8.5, 5.6), layout="constrained")
    for axis, (title, before, after, top, window) in zip(
        axes[0], (_impact_comparison(site, world), _passage_comparison(site, world))
    ):
        k = most_changed(before, after)
        axis.set_title(f"{title}, sensor {site.names()[k]}", fontsize=9)
        _plot_comparison(axis, before[k], after[k], top, window)
        axis.legend(fontsize=7)
    _plot_track(axes[1, 0], truth, rows, site)
    _plot_fits(axes[1, 1], rows, oracle)
    return save(figure, path)


def _plot_comparison(axis: Axes, before: np.ndarray, after: np.ndarray, top: float, window: str) -> None:
    """Plot spectra without and with the effect up to ``top`` [Hz]; if they coincide, as for a delay, 30 ms of time."""
    (f, density_before), (_, density_after) = (spectrum(signal[None], RATE, window) for signal in (before, after))
    inside = (f > 5.0) & (f < top)
    if np.median(np.abs(np.log(density_after[0][inside] / density_before[0][inside]))) > MIN_SPECTRUM_CHANGE:
        curves, x, label = (
            np.sqrt([density_before[0], density_after[0]]),
            f,
            ("frequency [Hz]", "acceleration [m/s²/√Hz]"),
        )
        axis.set(yscale="log", xlim=(0.0, top), ylim=(0.3 * curves[1][inside].min(), None))
    else:
        first = max(int(np.argmax(np.abs(after))) - int(0.01 * RATE), 0)
        segment = slice(first, first + int(0.03 * RATE))
        curves, label = np.array([before[segment], after[segment]]), ("time [ms]", "acceleration [m/s²]")
        x = 1e3 * np.arange(curves.shape[1]) / RATE
    for row, name, style in zip(curves, ("without", "with"), ("-", "--")):
        axis.plot(x, row, style, lw=1, label=f"{name} the effect")
    axis.set(xlabel=label[0], ylabel=label[1])


def _impact_comparison(site: Site, world: World) -> tuple[str, np.ndarray, np.ndarray, float, str]:
    """(title, without, with, top [Hz], window) of an impact at the position where the effect shows most."""

    def both_signals(position: float) -> Iterator[np.ndarray]:
        for w in (site.world, world):
            warm = site.temperatures[1]
            _, a, _ = simulate_impacts(
                w, sensor_positions(site, w), position, [0.005], [0.95], 0.25, warm, tip=site.tip
            )
            yield _sensor_signals(site, w, a, "hammer")

    position, before, after = _most_different((x, *both_signals(x)) for x in site.hammer_positions)
    return f"an impact at {position:.1f} m", before, after, 900.0, "boxcar"


def _passage_comparison(site: Site, world: World) -> tuple[str, np.ndarray, np.ndarray, float, str]:
    """(title, without, with, top [Hz], window) of the passage in which the effect shows most."""

    def both_signals(k: int) -> Iterator[np.ndarray]:
        for w in (site.world, world):
            yield _sensor_signals(site, w, passage_motion(site, w, k, np.random.default_rng(k)), "passage")

    k, before, after = _most_different((k, *both_signals(k)) for k in range(len(site.passages)))
    p = site.passages[k]
    return f"{p.train}, {3.6 * p.speed:.0f} km/h", before, after, 250.0, "hann"


def _most_different(comparisons: Iterable[tuple]) -> tuple:
    """The (key, without, with) that differs most."""
    return max(comparisons, key=lambda s: relative_changes(*s[1:]).max())


def _sensor_signals(site: Site, world: World, motion: np.ndarray, recording_type: str) -> np.ndarray:
    """Signals of the sensors under ``motion`` with their faults, in a "hammer" test or a "passage"."""
    rows = []
    for x, chain in zip(motion, site.chains):
        for fault in world.channels.get(chain.name, ()):
            x = fault(recording_type, np.random.default_rng(0))(x, 1.0 / TIME_STEP)
        rows.append(x)
    return np.array(rows)


def _plot_track(axis: Axes, truth: Mapping[str, Any], rows: Sequence[Mapping[str, Any]] | None, site: Site) -> None:
    """Plot along the rail: sensors, hammer positions, concealed effects (filled) and answers (open)."""
    axis.set_xlim(min(site.sensors) - 2.5, max(site.sensors) + 2.5)
    axis.plot(site.sensors, np.zeros(len(site.sensors)), "^", color="0.4", label="sensor")
    axis.plot(site.hammer_positions, np.zeros(len(site.hammer_positions)), "v", color="0.7", label="impact")
    for name, x in zip(site.names(), site.sensors):
        axis.annotate(name, (x, 0.0), xytext=(0, -14), textcoords="offset points", ha="center", fontsize=8)
    for k, effect in enumerate(truth["effects"]):
        where = effect["where"]
        x = where.get("position", truth["sensors"].get(where.get("sensor")))
        _plot_mark(axis, x, 1.0 + 0.45 * k, effect["kind"], where.get("train"), where.get("axle"), color="black")
    for k, a in enumerate(answers_of(rows) or ()):
        x = truth["sensors"].get(a.sensor) if a.position is None else a.position
        _plot_mark(axis, x, 2.0 + 0.45 * k, " or ".join(a.names) or a.verdict, a.train, a.axle, color="C3", mfc="none")
    axis.set_yticks([0, 1, 2], ["track", "concealed", "answer"])
    axis.set_ylim(-1.1, 3.3)
    axis.set_xlabel("position [m]")
    axis.legend(loc="lower right", ncols=2, fontsize=7)


def _plot_mark(
    axis: Axes, x: float | None, y: float, text: str, train: str | None, axle: int | None, **style: Any
) -> None:
    """Mark an effect at its position ``x``; one without a position stands at the left with its wheel or train."""
    if x is not None:
        axis.plot(x, y, "o", **style)
        _annotate(axis, x, y, text)
        return
    wheel = f"axle {axle} of {train}" if axle is not None else train or "no position"
    axis.annotate(f"{text.replace('_', ' ')}: {wheel}", (0.02, y), xycoords=("axes fraction", "data"), fontsize=8)


def _annotate(axis: Axes, x: float, y: float, text: str) -> None:
    """Write the text beside the point, towards the middle of the axis."""
    low, high = axis.get_xlim()
    side = "right" if x > 0.5 * (low + high) else "left"
    axis.annotate(text.replace("_", " "), (x, y), xytext=(-5 if side == "right" else 5, 5),
                  textcoords="offset points", fontsize=8, ha=side)  # fmt: skip


def _plot_fits(axis: Axes, rows: Sequence[Mapping[str, Any]] | None, oracle: float | None) -> None:
    """Plot the fits of the held-out recordings."""
    row = (rows or [{}])[0]
    fits = {label: row.get(f"fit_{name}_pct") for name, label in FIT_LABELS.items()} | {"true effect": oracle}
    stated: dict[str, Any] = {name: value for name, value in fits.items() if value is not None}
    axis.barh(list(stated), list(stated.values()), color="C0")
    axis.set_xlabel("fit on held-out recordings [%]")
    if not stated:
        axis.text(0.5, 0.5, "no fit was given", ha="center", transform=axis.transAxes)
