"""Impulse response of a section from the models of the paper, with its stiffness changed by given factors."""

import numpy as np

from benchmarks.published.models import published_model

LOCATION = {
    "OT": "OT",
    "SP": "SP",
    "CLP": "CLP",
    "A7": "CP A7",
    "A8": "CP A8",
    "A9": "CP A9",
    "ASM": "AS main",
    "ASD": "AS diverging",
}
# [m/s² per N s]. The paper normalises its data; with this value 8 kN give some 500 m/s², as a sledge hammer does.
ACCELERATION_PER_IMPULSE = 40.0
SPREAD = 0.006  # relative sd of frequency and damping from impact to impact
N_SAMPLE = 2_400


def paper_response(section, ballast, railpad):
    """Function of a random generator that gives (N_SAMPLE,) acceleration per unit impulse [m/s² per N s].

    A resonance frequency follows the square root of its stiffness. Frequencies and damping scatter by 0.6 % from impact
    to impact.
    """
    model = published_model(LOCATION[section])
    factor = {"ballast": np.sqrt(ballast), "railpad": np.sqrt(railpad)}
    pole = 2 * np.pi * model.frequency * (-model.damping + 1j * np.sqrt(1 - model.damping**2))
    scale = np.array([factor[band] for band in model.bands])
    time = np.arange(N_SAMPLE) / model.rate
    gain = ACCELERATION_PER_IMPULSE / np.max(np.abs(model.residue))

    def response(rng):
        scatter = 1.0 + SPREAD * rng.standard_normal(len(pole))
        damping = 1.0 + SPREAD * rng.standard_normal(len(pole))
        s = (pole.real * damping + 1j * pole.imag) * scale * scatter
        return gain * np.real(model.residue[:, None] * np.exp(s[:, None] * time)).sum(axis=0)

    return response
