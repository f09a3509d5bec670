"""Find the impacts whose response was limited before the filter: their tops are lower and flatter than the track's.

The anti-aliasing filter behind an amplifier rounds the tops that the amplifier cut, so no samples are equal. What is
left is physics: the weaker impacts of the test predict the response to each force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import Impact

MIN_IMPACTS = 5  # of a test: the weaker half predicts, and each of them is predicted by at least two others
TOP_SHARE, LOW_SHARE = 0.8, 0.5  # of the predicted peak: tops above the first, what no limit reaches below the second
EARLY_TIME = 0.02  # s from the contact in which prediction and response are compared
LEAD = 5  # samples before the contact that a filter of linear phase may move
REGULARISATION = 1e-4  # of the largest force power, under which a line predicts nothing
# A deficit of the tops against the low part of the same response counts from here. At least one impact must also
# exceed so many robust deviations of the weaker impacts: it shows the limit that the others then share.
MIN_DEFICIT, DEVIATIONS = 0.03, 4.0
# Share of the misfit at the tops that a cut prediction leaves. A cut top is flat; a top that is lower because the
# impact was beside its mark is lower everywhere.
MAX_MISFIT_LEFT = 0.25
# Limits of one channel agree within this factor: the overshoot of a steep filter behind a cut top is 9 % (Gibbs).
SAME_LIMIT = 1.1


@dataclass(frozen=True)
class Top:
    """Tops of one response against its prediction.

    ``deficit`` [-] is the logarithm of the gain of its low part over that of its tops, ``limit`` [m/s²] the level that
    cuts the prediction best, ``misfit_left`` [-] what the cut leaves of the squared misfit.
    """

    deficit: float
    limit: float
    misfit_left: float


def judge_limited_impacts(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject the impacts of a test whose response was limited, while weaker impacts were not.

    Each of them has lower tops than the weaker impacts predict, a cut explains its misfit, and its limit is that of
    the other limited impacts. The weaker half of the test must be intact.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are compared.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "overload" in those that were limited.
    """
    used = [i for i in impacts if i.accepted]
    if len(used) < MIN_IMPACTS or len({i.rate for i in used}) > 1:
        return tuple(impacts)
    weaker = np.argsort([abs(i.peak) for i in used], kind="stable")[: (len(used) + 1) // 2]
    tops = tops_of(used, weaker)
    deficits = np.array([t.deficit for t in tops])
    usual = float(np.median(deficits[weaker]))
    least = max(MIN_DEFICIT, DEVIATIONS * MAD_TO_SD * float(np.median(np.abs(deficits[weaker] - usual))))
    lower = [t for t in tops if t.deficit - usual > MIN_DEFICIT and t.misfit_left < MAX_MISFIT_LEFT]
    limits = [t.limit for t in lower if t.deficit - usual > least]
    if not limits:
        return tuple(impacts)
    limit = float(np.median(limits))
    cut = [t for t in lower if 1.0 / SAME_LIMIT < t.limit / limit < SAME_LIMIT]
    rejections = {}
    for impact, top in zip(used, tops):
        if top in cut:
            detail = (
                f"the tops of {response} are {100.0 * (1.0 - np.exp(usual - top.deficit)):.0f} % lower than the weaker "
                f"impacts predict, flat, and end at about {limit:.4g} in {len(cut)} of {len(used)} impacts: the "
                "channel is limited before its filter, so choose a larger range or hit less hard"
            )
            rejections[id(impact)] = Rejection("overload", top.deficit - usual, MIN_DEFICIT, detail, response)
    return tuple(replace(i, rejections=(rejections[id(i)],)) if id(i) in rejections else i for i in impacts)


def tops_of(impacts: Sequence[Impact], weaker: np.ndarray) -> list[Top]:
    r"""Compare the tops of each response with what the weaker impacts of the test predict.

    .. math:: \hat a_k = \mathcal{F}^{-1}\left[ F_k \frac{\sum_j w_j F_j^* A_j}{\sum_j w_j |F_j|^2 + \epsilon}\right],
        \quad j \ne k, \quad w_j = 1 / \sum_f |F_j|^2

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts of one rate.
    weaker : (m,) array of int
        Indices of those that predict.

    Returns
    -------
    list of Top
        One of each impact.
    """
    spectra = contact_spectra(impacts)
    tops = []
    for k, i in enumerate(impacts):
        predicting = weaker[weaker != k]
        predicted = np.fft.irfft(transfer_function(spectra, predicting) * spectra[0][k])[: i.acceleration.size]
        early = slice(max(0, i.onset - LEAD), i.onset + round(EARLY_TIME * i.rate))
        tops.append(_top(i.acceleration[early], predicted[early]))
    return tops


def contact_spectra(impacts: Sequence[Impact]) -> tuple[np.ndarray, np.ndarray]:
    """Spectra of the forces, which count during the contact only, and of the responses, over twice the longest record.

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts of one rate.

    Returns
    -------
    force, response : (n_impact, n_frequency) array of complex
        [N], [m/s²]; their inverse transforms have an even length, and no convolution wraps.
    """
    n = 2 * max(i.acceleration.size for i in impacts)
    force, rail = np.zeros((2, len(impacts), n))
    for k, i in enumerate(impacts):
        force[k, i.onset : i.contact_end + 1] = i.force[i.onset : i.contact_end + 1]
        rail[k, : i.acceleration.size] = i.acceleration
    return np.fft.rfft(force), np.fft.rfft(rail)


def transfer_function(spectra: tuple[np.ndarray, np.ndarray], predicting: np.ndarray) -> np.ndarray:
    """Response per force of some impacts, each of which has the same weight; 0 at lines without force.

    Parameters
    ----------
    spectra : (force, response)
        Of all impacts, from ``contact_spectra``.
    predicting : (m,) array of int
        Indices of the impacts that are averaged.

    Returns
    -------
    (n_frequency,) array of complex
        [m/s²/N]
    """
    force, response = (x[predicting] for x in spectra)
    power = np.abs(force) ** 2
    weights = 1.0 / np.sum(power, axis=1, keepdims=True)
    total = np.sum(weights * power, axis=0)
    return np.sum(weights * force.conj() * response, axis=0) / (total + REGULARISATION * total.max())


def _top(measured: np.ndarray, predicted: np.ndarray) -> Top:
    size = np.abs(predicted)
    is_top, is_low = size >= TOP_SHARE * size.max(), size < LOW_SHARE * size.max()
    gains = [
        float(measured[samples] @ predicted[samples] / (predicted[samples] @ predicted[samples]))
        for samples in (is_low, is_top)
    ]
    if not min(gains) > 0.0:
        return Top(0.0, np.inf, 1.0)
    expected = gains[0] * predicted[is_top]
    levels = np.linspace(0.4, 1.0, 61)[:, None] * np.max(np.abs(expected))
    misfits = np.sum((measured[is_top] - np.clip(expected, -levels, levels)) ** 2, axis=1)
    closest = int(np.argmin(misfits))
    misfit_left = float(misfits[closest] / misfits[-1]) if misfits[-1] > 0.0 else 1.0
    return Top(float(np.log(gains[0] / gains[1])), float(levels[closest, 0]), misfit_left)
