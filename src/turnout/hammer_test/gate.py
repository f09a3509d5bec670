"""Decide which bands a receptance supports, by the coherence gate."""

import numpy as np

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.records import Receptance, Rejection

Band = tuple[float, float]
BALLAST_BAND = (50.0, 200.0)  # Hz
RAILPAD_BAND = (300.0, 800.0)  # Hz


def bands_passed(
    receptance: Receptance, ballast: Band = BALLAST_BAND, railpad: Band = RAILPAD_BAND
) -> dict[str, float]:
    """Share of the lines of each band that pass the gate.

    Where the railpad band fails and the ballast band passes, the test supports only a model of order two, as at A8 in
    the paper.

    Parameters
    ----------
    receptance : Receptance
        Averaged receptance with the result of the gate.
    ballast, railpad : (float, float)
        Band edges. [Hz]

    Returns
    -------
    dict
        "ballast" and "railpad": share between 0 and 1; 0 where the band has no line.

    Examples
    --------
    >>> f = np.arange(50.0, 801.0, 50.0); z = np.zeros(f.size)
    >>> seen = Receptance(f, z, z, z, z, z, z, z, f <= 300.0, 10, 700.0)
    >>> bands_passed(seen, ballast=(50, 200), railpad=(200, 800))["ballast"]
    1.0
    """
    bands = {"ballast": ballast, "railpad": railpad}
    shares = {}
    for name, (low, high) in bands.items():
        inside = (receptance.frequency >= low) & (receptance.frequency <= high)
        shares[name] = float(np.mean(receptance.passed[inside])) if inside.any() else 0.0
    return shares


def gate_rejections(
    receptance: Receptance, ballast: Band = BALLAST_BAND, settings: ReceptanceSettings | None = None
) -> tuple[Rejection, ...]:
    """Reasons to reject a whole test: too few impacts, or no coherence in the band of the ballast mode.

    Parameters
    ----------
    receptance : Receptance
        Averaged receptance with the result of the gate.
    ballast : (float, float)
        Edges of the band of the ballast resonance. [Hz]
    settings : ReceptanceSettings, optional
        Least number of impacts and share of the lines; the defaults without one.

    Returns
    -------
    tuple of Rejection
        Empty for a test that supports at least the ballast mode.

    Examples
    --------
    >>> from turnout.hammer_test import receptance_of
    >>> gate_rejections(receptance_of([]))[0].detail
    '0 accepted impacts, a coherence needs 3'
    """
    settings = settings or ReceptanceSettings()
    if receptance.n < settings.minimum_impacts:
        detail = f"{receptance.n} accepted impacts, a coherence needs {settings.minimum_impacts}"
        return (Rejection("too_few_impacts", float(receptance.n), float(settings.minimum_impacts), detail),)
    share = bands_passed(receptance, ballast)["ballast"]
    if share < settings.gate_share:
        low, high = ballast
        detail = f"{share:.0%} of the lines in {low:g}-{high:g} Hz pass the gate, {settings.gate_share:.0%} are needed"
        return (Rejection("low_coherence", share, settings.gate_share, detail),)
    return ()
