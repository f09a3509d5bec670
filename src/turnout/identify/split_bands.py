"""The paper's procedure: two filtered bands, a second-order realisation of each."""

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from turnout.identify.era import era

TOP = 0.45  # of the sampling rate: no filter has its edge beyond


def split(records, rate: float, settings) -> tuple[np.ndarray, ...]:
    """Records below and above the split frequency, (n, n_sample) each; filtered over their whole length.

    At a low rate the upper band ends earlier, and without room for it there is only the lower one.

    Butterworth low-pass at ``split_frequency`` and band-pass from there to ``paper_band_high``, forwards and
    backwards if ``paper_zero_phase``. The paper names neither filter nor order nor phase.

    References
    ----------
    Barkhordari et al., section on model validation: 10-200 Hz and 200-800 Hz.
    """
    order, edge = settings.paper_filter_order, settings.split_frequency
    top = min(settings.paper_band_high, TOP * rate)
    filters = [butter(order, min(edge, top), fs=rate, output="sos")]
    if top > edge:
        filters.append(butter(order, [edge, top], btype="band", fs=rate, output="sos"))
    through = sosfiltfilt if settings.paper_zero_phase else sosfilt
    return tuple(through(sos, np.asarray(records, dtype=float), axis=-1) for sos in filters)


def second_order_mode(decay, rate: float) -> tuple[float, float]:
    """Frequency [Hz] and damping of the one mode that a square, order-2 realisation finds; nan if it is real.

    References
    ----------
    Barkhordari et al., eq. 8-16.
    """
    frequency, damping = era(decay, 2, rows=len(decay) // 2, rate=rate).modes()
    return (float(frequency[0]), float(damping[0])) if len(frequency) else (np.nan, np.nan)


def band_modes(records, starts, n: int, rate: float, settings) -> np.ndarray:
    """(n_band, n_record, 2) frequencies [Hz] and damping ratios of ballast and railpad band, nan where not found.

    ``records`` hold the contact too; ``starts`` say where each decay begins and ``n`` how long it is.
    """
    found = np.full((2, len(records), 2), np.nan)
    for i, (record, start) in enumerate(zip(records, starts, strict=True)):
        for band, filtered in enumerate(split(record, rate, settings)):
            found[band, i] = second_order_mode(filtered[start : start + n], rate)
    return found
