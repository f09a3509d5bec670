"""Measure the contact of the hammer with the rail: onset, length, peak, impulse, and the noise before it.

Further contacts in the force of one impact (double impacts) are found. The band edge of a hammer's tip is the
frequency at which its force spectrum has fallen by 20 dB.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy
from scipy.fft import next_fast_len, rfft

from turnout.constants import MAD_TO_SD
from turnout.hammer_test.impact_window import Contact

if TYPE_CHECKING:
    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.hammer_test.impact_window import Cut


def measure_contact(cut: Cut, level: float) -> Contact:
    """Contact of one cut: the run of samples above ``level`` times the peak that contains the peak.

    The impulse is the integral of the force over the contact by the rectangle rule. Noise levels are standard
    deviations before the first contact. With fewer than 8 samples there, that of the force is taken from the whole
    record (by its median absolute deviation), and that of the acceleration from the last tenth.

    Parameters
    ----------
    cut : Cut
        The impact.
    level : float
        Share of the peak above which there is contact. [-]

    Returns
    -------
    Contact
        The main contact with the noise before it.
    """
    force = cut.polarity * cut.force
    top = int(np.argmax(force))
    peak = float(force[top])
    onset, end = interval_above_level(force, top, level * peak)
    rise, fall = crossing(force, top, 0.5 * peak, -1), crossing(force, top, 0.5 * peak, 1)
    n_quiet = max(0, min(cut.first, onset) - max(2, round(0.2 * (end - onset + 1))))
    if n_quiet >= 8:
        noise_force = float(np.std(cut.force[:n_quiet]))
        quiet_acceleration = cut.acceleration[:n_quiet]
    else:
        noise_force = cut.force_noise
        quiet_acceleration = cut.acceleration[-max(8, cut.acceleration.size // 10) :]
    return Contact(
        onset, end, top, cut.polarity * peak, fall - rise, float(np.sum(cut.force[onset : end + 1])) / cut.rate,
        noise_force, float(np.std(quiet_acceleration)), float(np.mean(quiet_acceleration)) if n_quiet >= 8 else 0.0,
    )  # fmt: skip


def interval_above_level(x: np.ndarray, top: int, level: float) -> tuple[int, int]:
    """First and last index of the unbroken run of samples above ``level`` around ``top``.

    Parameters
    ----------
    x : (n,) array of float
        Samples. [any unit]
    top : int
        Sample within the run.
    level : float
        The level. [same unit]

    Returns
    -------
    first, last : int
        Samples of the run.

    Examples
    --------
    >>> interval_above_level(np.array([0.0, 3, 0, 2, 5, 2, 0]), 4, 1.0)
    (3, 5)
    """
    below = np.flatnonzero(x[:top] <= level)
    onset = int(below[-1]) + 1 if below.size else 0
    below = np.flatnonzero(x[top + 1 :] <= level)
    return onset, (top + int(below[0]) if below.size else x.size - 1)


def crossing(x: np.ndarray, top: int, level: float, step: int) -> float:
    """Point at which x falls through ``level``, from ``top`` in direction ``step`` (+1, -1), interpolated linearly.

    Parameters
    ----------
    x : (n,) array of float
        Samples. [any unit]
    top : int
        Sample above the level.
    level : float
        The level. [same unit]
    step : int
        +1 for later samples, -1 for earlier ones.

    Returns
    -------
    float
        The first or last sample where x never falls through the level. [samples]

    Examples
    --------
    >>> x = np.array([0.0, 1.0, 4.0, 2.0, 0.0])
    >>> float(crossing(x, 2, 3.0, 1)), float(crossing(x, 2, 2.5, -1))
    (2.5, 1.5)
    """
    first, last = interval_above_level(x, top, level)
    if step > 0:
        return float(last) if last + 1 >= x.size else last + (x[last] - level) / (x[last] - x[last + 1])
    return float(first) if first == 0 else first - (x[first] - level) / (x[first] - x[first - 1])


# s. Within this time of the main contact, ringing of a filter or of the hammer resembles a small second contact, and a
# large one after a pulse of a few samples; no hammer rebounds so soon. Then a contact needs this prominence (share of
# the peak), and a main pulse of at least so many samples at half height.
MIN_CONTACT_INTERVAL = 1e-3
MIN_CLOSE_PROMINENCE = 0.1
MIN_CLOSE_SAMPLES = 6.0
# Least height of a further contact, in standard deviations of the noise.
NOISE_FACTOR = 6.0
# A further contact lasts as long as it exceeds this share of its own height.
FURTHER_CONTACT_LEVEL = 0.1


def smoothed_force(force: np.ndarray, half_width: float) -> np.ndarray:
    """Force behind a Hann kernel as long as the main pulse's half width, at least three samples; the sum is kept.

    As it is as wide as the tip's own pulse, it reduces noise and lowers a second pulse no more than the first.

    Parameters
    ----------
    force : (n,) array of float
        Force. [N]
    half_width : float
        Width of the pulse at half its height. [samples]

    Returns
    -------
    (n,) array of float
        Smoothed force. [N]

    Examples
    --------
    >>> smoothed_force(np.array([0.0, 0.0, 4.0, 0.0, 0.0]), 2.0)
    array([0., 1., 2., 1., 0.])
    """
    n = max(3, 2 * round(half_width / 2) + 1)
    kernel = np.hanning(n + 2)[1:-1]
    return np.convolve(force, kernel / kernel.sum(), mode="same")


class FurtherContact(NamedTuple):
    """First, last and highest sample, and the height over that of the main contact."""

    onset: int
    end: int
    top: int
    share: float


def further_contacts(cut: Cut, contact: Contact, settings: ReceptanceSettings) -> tuple[list[FurtherContact], float]:
    """Contacts besides the main one: list of FurtherContact in order of time, and the level they exceed.

    A contact is a local maximum of the smoothed force. It exceeds ``double_hit_level`` of the peak and six standard
    deviations of the noise, with a prominence of ``double_hit_prominence``. The noise is the median absolute deviation
    outside the main contact, so that hum or a drifting zero raise the limit instead of causing findings.

    Parameters
    ----------
    cut : Cut
        The impact.
    contact : Contact
        Its main contact.
    settings : ReceptanceSettings
        Level and prominence of a double impact.

    Returns
    -------
    contacts : list of FurtherContact
        In order of time.
    level : float
        Level that they exceed, over the main peak. [-]
    """
    force = smoothed_force(cut.polarity * cut.force, contact.half_width)
    margin = max(2, round(MIN_CONTACT_INTERVAL * cut.rate))
    top = max(0, contact.top - margin) + int(np.argmax(force[max(0, contact.top - margin) : contact.top + margin + 1]))
    force /= force[top]
    lower, upper = max(0, contact.onset - margin), min(force.size, contact.end + margin + 1)
    outside = np.concatenate([force[:lower], force[upper:]])
    noise = NOISE_FACTOR * MAD_TO_SD * float(np.median(np.abs(outside))) if outside.size else 0.0
    level = max(settings.double_hit_level, noise)
    tops, shape = scipy.signal.find_peaks(force, height=level, prominence=max(settings.double_hit_prominence, noise))
    contacts = []
    for k, prominence in zip(tops, shape["prominences"]):
        is_close = lower <= k < upper
        stands_out = prominence >= max(MIN_CLOSE_PROMINENCE, noise) and contact.half_width >= MIN_CLOSE_SAMPLES
        if k != top and (not is_close or stands_out):
            onset, end = interval_above_level(force, k, max(FURTHER_CONTACT_LEVEL * force[k], noise / 2))
            contacts.append(FurtherContact(onset, end, int(k), float(force[k])))
    return contacts, level


def band_edges(pulses: list[np.ndarray], rate: float, fall: float = 20.0, resolution: float = 5.0) -> np.ndarray:
    r"""Lowest frequency at which each pulse's spectrum lies ``fall`` decibel below its value at 0 Hz.

    Parameters
    ----------
    pulses : list of (n,) arrays
        Force of one contact each. [N]
    rate : float
        Sampling rate. [Hz]
    fall : float
        How far the spectrum falls. [dB]
    resolution : float
        Spacing of the lines between which the edge is interpolated; n is padded with zeros. [Hz]

    Returns
    -------
    (n_pulse,) array of float
        Half the rate where the spectrum does not fall that far. [Hz]

    Examples
    --------
    A half-sine of length T has :math:`|\cos(\pi fT)| / |1 - (2fT)^2|`, which is 0.1 at fT = 1.2976 (the first time,
    on the way to its zero at 1.5).

    >>> T, rate = 2e-3, 50_000.0
    >>> edge = band_edges([np.sin(np.pi * np.arange(101) / 100)], rate)[0]
    >>> print(f"{edge * T:.2f}")
    1.30
    """
    if not pulses:
        return np.empty(0)
    n_fft = next_fast_len(max(int(rate / resolution), *(p.size for p in pulses)), real=True)
    stacked = np.zeros((len(pulses), n_fft))
    for row, pulse in zip(stacked, pulses):
        row[: pulse.size] = pulse
    magnitude = np.abs(rfft(stacked))
    with np.errstate(divide="ignore", invalid="ignore"):
        decibel = 20.0 * np.log10(magnitude / magnitude[:, :1]) + fall
    below = decibel < 0.0
    k = np.where(below.any(axis=1), below.argmax(axis=1), decibel.shape[1])
    edges = np.full(len(pulses), rate / 2)
    for i in np.flatnonzero((k > 0) & (k < decibel.shape[1])):
        here, after = decibel[i, k[i] - 1], decibel[i, k[i]]
        edges[i] = (k[i] - 1 + (here / (here - after) if np.isfinite(after) else 1.0)) * rate / n_fft
    return edges
