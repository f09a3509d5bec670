"""Roughness of single wheels: errors of a passage's own, integrated out.

Every wheel has waves of its own round its tread, at an angle nobody knows, so that no other passage tells them. The
radius is known to a few per cent only: over the sensors' reach the waves are taken as those of any rough surface.
"""

import numpy as np

from turnout.mismatch.track.rolled_waves import Carrier
from turnout.mismatch.track.rough_rail import amplitude_sd

TURNED = 1.5e-5  # m; each of the first three harmonics of wheels in service, Johansson 2006, Vehicle System Dynamics 44
WHEEL_LEVEL = -2.0  # dB on the limit curve of rails: disc-braked wheels
KEPT = 0.02  # share of a sample's own variance below which a mode is not worth keeping


def wheel_modes(case, values, made, sigma):
    """(n_sensor * n_time, n_mode) signals of one standard deviation of the waves of all wheels; ``sigma`` (n,).

    In single precision: a long train over many sensors has a thousand modes of ten thousand samples each.
    """
    waves, circumference = case.waves, 2.0 * np.pi * made.passage.vehicle.radius
    sd = amplitude_sd(waves.lengths, waves.length, WHEEL_LEVEL)
    # out of round: the variance of an harmonic is spread over the waves up to half an order beside it
    turned = np.clip(np.round(circumference / waves.lengths), 1, 99) <= 3
    per_order = circumference / waves.length
    sd[turned] = np.maximum(sd[turned], TURNED * np.sqrt(per_order))
    carrier = Carrier(case, values, made)
    spectra = carrier.spectra(waves.lengths, np.ones(carrier.node.size))
    wheels = [carrier.shown(spectra, carrier.wheel(w)) * np.repeat(sd, 2) for w in range(carrier.behind.size)]
    modes = np.concatenate([w.astype(np.float32) for w in wheels], axis=1)
    scaled = modes / sigma[:, None].astype(np.float32)
    power, turn = np.linalg.eigh(scaled.T @ scaled)
    return modes @ turn[:, power > KEPT]
