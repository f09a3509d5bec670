"""Assign the modes of a test to the frequency bands, one mode per band, after the coherence gate.

Every other mode is listed with the reason. The residues of the modes come from the receptance.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.mixed_effects import MIN_DAMPING
from turnout.modal.poles import continuous_pole
from turnout.modal.selection import Selection
from turnout.records import FittedReceptance, Rejection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.summary import ImpactEstimates
    from turnout.records import Mode, Receptance


def passed_share(receptance: Receptance, frequency: float, damping: float) -> tuple[float, float]:
    """Share of the lines in the half-power band of a mode that pass the gate, and their lowest gate level.

    The band is f (1 ± zeta), at least the three lines nearest to f. (0, nan) if f lies outside the lines.

    Parameters
    ----------
    receptance : Receptance
        Its lines, gate levels and whether each line passed.
    frequency : float
        Frequency of the mode. [Hz]
    damping : float
        Damping ratio of the mode.

    Returns
    -------
    (float, float)
        Share of the lines, 0 to 1, and their lowest gate level.
    """
    lines = receptance.frequency
    if not lines[0] <= frequency <= lines[-1]:
        return 0.0, float("nan")
    inside = np.abs(lines - frequency) <= damping * frequency
    inside[np.argsort(np.abs(lines - frequency), kind="stable")[:3]] = True
    return float(np.mean(receptance.passed[inside])), float(np.min(receptance.gate_level[inside]))


def fit_receptance(receptance: Receptance, frequency: ArrayLike, damping: ArrayLike) -> FittedReceptance | None:
    """Residues and direct terms of modes by least squares over the lines of the accelerance that passed the gate.

    Each line has the weight of its relative error, which is nearly the same for all lines that pass the gate. With
    equal absolute weights the high frequencies decide, and the ballast resonance is missed by a factor of two.

    Parameters
    ----------
    receptance : Receptance
        Its H1, its gate and the decay of its window.
    frequency, damping : (n_mode,) arrays
        All modes of the fit, also those without a band: a mode that is missing here distorts the residues of
        the others. [Hz], [-]

    Returns
    -------
    FittedReceptance or None
        None if fewer than two lines per unknown passed.
    """
    use = receptance.passed & np.isfinite(receptance.h1)
    frequency, damping = np.asarray(frequency), np.asarray(damping)
    unknowns = 2 * len(frequency) + 2
    within = use & (receptance.frequency <= receptance.valid_to)
    if np.count_nonzero(within) >= 2 * unknowns:  # further modes act above the band edge of the hammer
        use = within
    if np.count_nonzero(use) < 2 * unknowns:
        return None
    p = 2j * np.pi * receptance.frequency[use] + receptance.decay
    accelerance = p**2 * receptance.h1[use]
    s = continuous_pole(frequency, damping)
    plus, minus = 0.5 / (p[:, None] - s), 0.5 / (p[:, None] - s.conj())
    scale = float(abs(p).max()) ** 2
    columns = np.hstack([plus + minus, 1j * (plus - minus), np.ones((len(p), 1)), p[:, None] ** 2 / scale])
    weight = 1.0 / np.maximum(np.abs(accelerance), 1e-3 * np.abs(accelerance).max())
    design, target = columns * weight[:, None], accelerance * weight
    design, target = np.vstack([design.real, design.imag]), np.concatenate([target.real, target.imag])
    solution = np.linalg.lstsq(design, target, rcond=None)[0]
    residue = solution[: len(s)] + 1j * solution[len(s) : 2 * len(s)]
    variance = np.sum((target - design @ solution) ** 2) / (len(target) - len(solution))
    error = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    residue_se = error[: len(s)] + 1j * error[len(s) : 2 * len(s)]
    direct = float(solution[-2]), float(solution[-1] / scale)
    return FittedReceptance(s, residue, direct, residue_se, receptance.decay)


MAIN_BANDS = ("ballast", "railpad")
MAX_EDGE_DISTANCE = (
    0.1  # relative distance from the edge of its band up to which a mode still belongs to it: warm pads soften
)


@dataclass
class BandChoice:
    """``modes`` maps a band to the index of its mode in the fit.

    ``rejected_modes`` lists all other modes, ``rejections`` the reasons why a band has none.
    """

    modes: dict[str, int] = field(default_factory=dict)
    rejected_modes: list = field(default_factory=list)
    rejections: list = field(default_factory=list)

    @property
    def status(self) -> str:
        """ "accepted" with both main resonances, "second_order_only" with one, "rejected" with none."""
        main_modes = [band for band in MAIN_BANDS if band in self.modes]
        return ("rejected", "second_order_only", "accepted")[len(main_modes)]


def choose_bands(selection: Selection, settings: IdentifySettings, receptance: Receptance | None = None) -> BandChoice:
    """The mode of each band that is most significant for its bandwidth, if it passes the gate of ``receptance``.

    Parameters
    ----------
    selection : Selection
        Modes of the test and their fit.
    settings : IdentifySettings
        Bands, and share of a mode's half-power band that must pass the gate.
    receptance : Receptance or None
        Receptance with its gate; None: no gate.

    Returns
    -------
    BandChoice
        Modes by band, and all others with reasons.
    """
    choice = BandChoice(rejected_modes=list(selection.rejected))
    gated_bands: list[str] = []
    if selection.fit is not None:
        _choose_strongest(choice, selection, settings)
        if receptance is not None:
            gated_bands = _apply_gate(choice, selection, settings, receptance)
    for band in MAIN_BANDS:
        if band not in choice.modes and band not in gated_bands:
            choice.rejections.append(Rejection("not_identified", None, None, f"{band} band holds no stable mode"))
    return choice


def _choose_strongest(choice: BandChoice, selection: Selection, settings: IdentifySettings) -> None:
    frequency, damping = np.exp(selection.mode_fit.mean[:, 0]), selection.mode_fit.mean[:, 1]
    # Divided by the bandwidth: a broad pole below a stronger mode takes up much of the residual of that mode.
    # Not by energy: two close, heavily damped poles have large opposite amplitudes.
    significance = np.median(selection.chi_squared, axis=0) / np.maximum(damping, MIN_DAMPING)
    for band, low, high in settings.bands():
        inside = np.flatnonzero((frequency >= low) & (frequency < high)).tolist()
        inside = [m for m in inside if m not in selection.failed_tests and m not in choice.modes.values()]
        if inside:
            choice.modes[band] = max(inside, key=lambda m: significance[m])
    _assign_across_edge(choice, frequency, damping, significance, selection.failed_tests, settings)
    for m in sorted(set(range(len(frequency))) - set(choice.modes.values())):
        bands = [band for band, low, high in settings.bands() if low <= frequency[m] < high]
        reason = f"weaker than the {bands[0]} mode of its band" if bands else "outside all bands"
        reason, *limits = selection.failed_tests.get(m, (reason,))
        choice.rejected_modes.append(_rejected_mode(selection, m, reason + ", but it stays in the fit", *limits))


def _assign_across_edge(
    choice: BandChoice,
    frequency: np.ndarray,
    damping: np.ndarray,
    significance: np.ndarray,
    failed_tests: Mapping[int, tuple],
    settings: IdentifySettings,
) -> None:
    """Give an empty main band a mode just outside its edge, if the neighbouring band has another mode for itself.

    The resonance of a soft pad may lie a hertz below the edge. It would then hide the ballast resonance.
    """
    edges = {band: (low, high) for band, low, high in settings.bands()}
    for band, neighbour in zip(MAIN_BANDS, MAIN_BANDS[::-1]):
        if band in choice.modes or neighbour not in choice.modes:
            continue
        (low, high), (floor, top) = edges[band], edges[neighbour]
        neighbour_modes = [m for m in range(len(frequency)) if floor <= frequency[m] < top and m not in failed_tests]
        edge_distance = np.maximum(low / frequency, frequency / high) - 1.0
        pairs = [
            (m, partner)
            for m in neighbour_modes
            for partner in neighbour_modes
            if edge_distance[m] < min(damping[m], MAX_EDGE_DISTANCE)
            and (frequency[m] > frequency[partner]) == (low >= top)
            and m != partner
        ]
        if pairs:
            best_pair = max(pairs, key=lambda pair: significance[list(pair)].sum())
            choice.modes[band], choice.modes[neighbour] = best_pair


def accepted_modes(
    estimates: Sequence[ImpactEstimates], settings: IdentifySettings
) -> tuple[list[tuple[ImpactEstimates, Mode]], list[tuple[str, Rejection]]]:
    """Means over the impacts, divided into those that stand for their resonance and those that do not.

    Parameters
    ----------
    estimates : sequence of ImpactEstimates
        Estimates of one mode of each band.
    settings : IdentifySettings
        Limits of :func:`failure_of_mode`, and the level of the intervals.

    Returns
    -------
    accepted : list of (ImpactEstimates, Mode)
    failed : list of (str, Rejection)
        Band and reason.
    """
    accepted, failed = [], []
    for e in estimates:
        mode = e.mode(settings.confidence)
        failure = failure_of_mode(mode, settings)
        if failure is None:
            accepted.append((e, mode))
        else:
            failed.append((e.band, failure))
    return accepted, failed


def failure_of_mode(mode: Mode, settings: IdentifySettings) -> Rejection | None:
    """Why the reported mean of a mode cannot stand for the resonance of its band, None if it can.

    The limits of the fit hold for the scatter between its impacts, too. The whole interval, with the error that all
    impacts share, must lie in the band of the resonance, up to the distance that a mode may have from its edge.
    Otherwise the test does not tell which resonance it is, even where all impacts agree.

    Parameters
    ----------
    mode : Mode
        Mean over the impacts, with its errors where they are known.
    settings : IdentifySettings
        Bands, and the largest relative standard errors from the scatter of the impacts.

    Returns
    -------
    Rejection or None
        Reason "not_identified".
    """
    words = f"{mode.band} mode at {mode.frequency:.0f} Hz: "
    if mode.damping <= MIN_DAMPING:
        return Rejection("not_identified", mode.damping, MIN_DAMPING, words + "damping, mean over its impacts")
    checks = (
        ("frequency", (mode.frequency_repeatability or 0.0) / mode.frequency, settings.frequency_se_maximum),
        ("damping", (mode.damping_repeatability or 0.0) / mode.damping, settings.damping_se_maximum),
    )
    for name, relative, limit in checks:
        if relative > limit:
            detail = words + f"relative standard error of the {name}, from the spread between its impacts"
            return Rejection("not_identified", relative, limit, detail)
    return _leaves_band(mode, settings, words)


def _leaves_band(mode: Mode, settings: IdentifySettings, words: str) -> Rejection | None:
    """The rejection of a main mode whose interval [Hz] reaches out of the band of its resonance."""
    if mode.band not in MAIN_BANDS or mode.frequency_low is None or mode.frequency_high is None:
        return None
    low, high = next((low, high) for band, low, high in settings.bands() if band == mode.band)
    interval = f"its interval, {mode.frequency_low:.0f} to {mode.frequency_high:.0f} Hz"
    detail = f"{words}{interval}, reaches out of the band of the resonance, {low:.0f} to {high:.0f} Hz"
    lowest, highest = low / (1.0 + MAX_EDGE_DISTANCE), high * (1.0 + MAX_EDGE_DISTANCE)
    if mode.frequency_high > highest:
        return Rejection("not_identified", mode.frequency_high, highest, detail)
    if mode.frequency_low < lowest:
        return Rejection("not_identified", mode.frequency_low, lowest, detail)
    return None


def _apply_gate(
    choice: BandChoice, selection: Selection, settings: IdentifySettings, receptance: Receptance
) -> list[str]:
    """Remove the modes that fail the gate from ``choice``; returns their bands."""
    gated_bands = []
    for band, m in list(choice.modes.items()):
        log_frequency, damping = selection.mode_fit.mean[m]
        share, level = passed_share(receptance, float(np.exp(log_frequency)), float(damping))
        if share >= settings.gate_share:
            continue
        del choice.modes[band]
        detail = f"{band} mode: share of its half-power band that passes the gate; lowest level {level:.2f}"
        choice.rejections.append(Rejection("low_coherence", share, settings.gate_share, detail))
        entry = _rejected_mode(selection, m, "fails the coherence gate", share, settings.gate_share)
        choice.rejected_modes.append(entry)
        gated_bands.append(band)
    return gated_bands


def _rejected_mode(
    selection: Selection, m: int, reason: str, value: float | None = None, limit: float | None = None
) -> dict[str, Any]:
    return {
        "frequency": float(np.exp(selection.mode_fit.mean[m, 0])),
        "damping": float(selection.mode_fit.mean[m, 1]),
        "energy": float(selection.energy[m]),
        "reason": reason,
        "value": value,
        "limit": limit,
    }
