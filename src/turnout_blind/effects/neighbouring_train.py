"""A train on the other track during some passages: ground-borne waves that no wheel of the passing train explains."""

import numpy as np
from scipy import signal

from turnout_blind.effect import Effect


def draw(rng, site, level):
    """Indices of the passages, level [m/s²] and centre frequency [Hz]."""
    passages = sorted(int(k) for k in rng.choice(len(site.passages), 3, replace=False))
    return {}, {"level": float(level), "passages": passages, "centre": float(rng.uniform(18.0, 45.0))}


def act(world, site, where, p):
    """Add narrow-band noise that rises and falls and reaches the sensors with 250 m/s."""

    def source(time, positions, k, rng):
        if k not in p["passages"]:
            return np.zeros((len(positions), time.size))
        rate = 1.0 / (time[1] - time[0])
        band = [0.6 * p["centre"], 1.6 * p["centre"]]
        noise = signal.sosfilt(signal.butter(3, band, "band", fs=rate, output="sos"), rng.normal(size=time.size))
        swell = np.exp(-(((time - rng.uniform(1.0, 2.5)) / 0.6) ** 2))
        wave = p["level"] * noise / np.std(noise) * swell
        return np.stack([np.interp(time - (x - positions[0]) / 250.0, time, wave) for x in positions])

    world.passage_noise.append(source)


EFFECT = Effect("neighbouring_train", "clock", (0.3, 0.7, 1.5, 3.0), draw, act, "outside")
