"""What the paper's procedure does to a known model: its bias, by simulation at the model just identified."""

import numpy as np

from turnout.identify.poles import continuous_pole
from turnout.identify.pulse_response import pulse_response
from turnout.identify.split_bands import band_modes

CONTACT = 1.5e-3
LEAD = 0.01
AFTER_CONTACT = 2e-4


def simulated_bias(
    frequency, damping, amplitude, noise: float, n: int, rate: float, settings, bands=("ballast", "railpad")
) -> dict:
    """Bias of the split into two bands on decays of known modes.

    Blows of a soft tip (1.5 ms, 8 % spread, start between samples) on a model with these modes, white noise added,
    through the same filters and realisations.

    Parameters
    ----------
    frequency, damping : (n_mode,) arrays
        Modes of the decays, those of ``bands`` first. [Hz], [-]
    amplitude : (n_mode,) array of complex
        At the start of the free decay. [m/s²]
    noise : float
        Standard deviation of the noise. [m/s²]
    n : int
        Samples of a decay.
    rate : float
        [Hz]
    settings : IdentifySettings
        ``paper_bias_tests`` blows are simulated.
    bands : tuple of str
        Which of the two bands the first modes belong to.

    Returns
    -------
    dict
        For each of ``bands``: ``frequency_percent`` and ``damping_percent``, the mean error over the true value [%],
        ``found``, the share of blows in which it is found, and ``n``, the blows.
    """
    rng = np.random.default_rng(20171001)
    draws = settings.paper_bias_tests
    s = continuous_pole(np.asarray(frequency), np.asarray(damping))
    contact = CONTACT * (1.0 + 0.08 * rng.standard_normal(draws))
    lead = round(LEAD * rate)
    time = (np.arange(lead + round((2.0 * CONTACT + AFTER_CONTACT) * rate) + n) - lead) / rate
    time = time - rng.random(draws)[:, None] / rate
    # The residue that leads to the given amplitude when the decay starts.
    turn = 2.0 * np.pi / CONTACT
    spectrum = -np.expm1(-s * CONTACT) / s * 0.5 * turn**2 / (s**2 + turn**2)
    residue = amplitude * np.exp(-s * (CONTACT + AFTER_CONTACT)) / spectrum
    clean = pulse_response(
        time, np.broadcast_to(s, (draws, len(s))), np.broadcast_to(residue, (draws, len(s))), contact
    )
    records = clean + noise * rng.standard_normal(clean.shape)
    starts = lead + np.ceil((contact + AFTER_CONTACT) * rate).astype(int)
    found = band_modes(records, starts, n, rate, settings)
    told = {}
    for m, name in enumerate(bands):
        band = found[("ballast", "railpad").index(name)]
        there = np.isfinite(band[:, 0])
        error = 100.0 * (band[there] / (frequency[m], damping[m]) - 1.0)
        mean = error.mean(axis=0) if there.any() else np.full(2, np.nan)
        told[name] = {
            "frequency_percent": float(mean[0]),
            "damping_percent": float(mean[1]),
            "found": float(there.mean()),
            "n": draws,
        }
    return told


def in_words(bias: dict) -> str:
    """The bias as it is printed beside every result of the paper's procedure.

    >>> in_words({"ballast": {"frequency_percent": -10.9, "damping_percent": -10.0, "found": 1.0, "n": 12}})
    'simulated bias of method paper at this model (12 blows): ballast f -10.9 %, zeta -10.0 %, found 100 %'
    """
    n = next(iter(bias.values()))["n"] if bias else 0
    parts = [
        f"{band} f {b['frequency_percent']:+.1f} %, zeta {b['damping_percent']:+.1f} %, found {100 * b['found']:.0f} %"
        for band, b in bias.items()
    ]
    return f"simulated bias of method paper at this model ({n} blows): " + "; ".join(parts)
