"""Name the modes of a test: one for each band, after the coherence gate; the rest listed with the reason."""

from dataclasses import dataclass, field

import numpy as np

from turnout.identify.gate import passed_share
from turnout.identify.mixed import LOWEST_DAMPING
from turnout.identify.select import Selection
from turnout.records import Rejection

MAIN_BANDS = ("ballast", "railpad")
EDGE = 0.1  # how far beside its band, of its frequency, a mode may still be meant by it: pads soften so much in summer


@dataclass
class BandChoice:
    """``modes`` maps a band to the index of its mode in the fit; ``rejected_modes`` and ``rejections`` say the rest."""

    modes: dict[str, int] = field(default_factory=dict)
    rejected_modes: list = field(default_factory=list)
    rejections: list = field(default_factory=list)

    @property
    def status(self) -> str:
        """ "accepted" with both main resonances, "second_order_only" with one of them, else "rejected"."""
        found = [band for band in MAIN_BANDS if band in self.modes]
        return ("rejected", "second_order_only", "accepted")[len(found)]


def choose_bands(selection: Selection, settings, receptance=None) -> BandChoice:
    """The mode of each band most significant for its width, unless the coherence gate of ``receptance`` stops it."""
    choice = BandChoice(rejected_modes=list(selection.rejected))
    if selection.fit is not None:
        _strongest(choice, selection, settings)
        if receptance is not None:
            _gate(choice, selection, settings, receptance)
    stopped = {r.detail.split()[0] for r in choice.rejections}
    for band in MAIN_BANDS:
        if band not in choice.modes and band not in stopped:
            choice.rejections.append(Rejection("not_identified", None, None, f"{band} band holds no stable mode"))
    return choice


def _strongest(choice, selection, settings):
    frequency, damping = np.exp(selection.fit.mean[:, 0]), selection.fit.mean[:, 1]
    # per bandwidth: a broad pole below a stronger mode takes up much of what that leaves. Not by energy: two close,
    # heavily damped poles trade large opposite amplitudes between them
    significance = np.median(selection.chi_squared, axis=0) / np.maximum(damping, LOWEST_DAMPING)
    for band, low, high in settings.bands():
        inside = np.flatnonzero((frequency >= low) & (frequency < high)).tolist()
        inside = [m for m in inside if m not in selection.unfit and m not in choice.modes.values()]
        if inside:
            choice.modes[band] = max(inside, key=lambda m: significance[m])
    _across_edges(choice, frequency, damping, significance, selection.unfit, settings)
    for m in sorted(set(range(len(frequency))) - set(choice.modes.values())):
        bands = [band for band, low, high in settings.bands() if low <= frequency[m] < high]
        reason = f"weaker than the {bands[0]} mode of its band" if bands else "outside all bands"
        reason, *limits = selection.unfit.get(m, (reason,))
        choice.rejected_modes.append(_entry(selection, m, reason + "; kept in the fit", *limits))


def _across_edges(choice, frequency, damping, significance, unfit, settings):
    """Give an empty main band a mode that lies just beside it, where the band next door has another one for itself.

    A soft pad's resonance may fall below the edge by a hertz, and would hide that of the ballast there.
    """
    edges = {band: (low, high) for band, low, high in settings.bands()}
    for band, beside in zip(MAIN_BANDS, MAIN_BANDS[::-1]):
        if band in choice.modes or beside not in choice.modes:
            continue
        (low, high), (floor, top) = edges[band], edges[beside]
        there = [m for m in range(len(frequency)) if floor <= frequency[m] < top and m not in unfit]
        beyond = np.maximum(low / frequency, frequency / high) - 1.0
        pairs = [
            (m, other)
            for m in there
            for other in there
            if beyond[m] < min(damping[m], EDGE) and (frequency[m] > frequency[other]) == (low >= top) and m != other
        ]
        if pairs:
            best = max(pairs, key=lambda pair: significance[list(pair)].sum())
            choice.modes[band], choice.modes[beside] = best


def _gate(choice, selection, settings, receptance):
    for band, m in list(choice.modes.items()):
        log_frequency, damping = selection.fit.mean[m]
        share, level = passed_share(receptance, float(np.exp(log_frequency)), float(damping))
        if share >= settings.gate_share:
            continue
        del choice.modes[band]
        detail = f"{band} mode: share of its half-power band that passes the gate; lowest level {level:.2f}"
        choice.rejections.append(Rejection("low_coherence", share, settings.gate_share, detail))
        entry = _entry(selection, m, "fails the coherence gate", share, settings.gate_share)
        choice.rejected_modes.append(entry)


def _entry(selection, m, reason, value=None, limit=None):
    return {
        "frequency": float(np.exp(selection.fit.mean[m, 0])),
        "damping": float(selection.fit.mean[m, 1]),
        "energy": float(selection.energy[m]),
        "reason": reason,
        "value": value,
        "limit": limit,
    }
