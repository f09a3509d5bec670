"""A train on the other track during some passages: ground-borne waves that no wheel of the passing train explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, level: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Indices of the passages, level [m/s²] and centre frequency [Hz].

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    level : float
        Level of the noise, rms at its strongest. [m/s²]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    passages = sorted(int(k) for k in rng.choice(len(site.passages), 3, replace=False))
    return {}, {"level": float(level), "passages": passages, "centre": float(rng.uniform(18.0, 45.0))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add narrow-band noise that rises and falls and reaches the sensors with 250 m/s.

    Parameters
    ----------
    world : World
        World that is changed.
    site : Site
        The site without the effect.
    where : mapping
        Where the effect is, from ``draw``.
    p : mapping
        Parameters, from ``draw``.
    """

    def source(time: np.ndarray, positions: Sequence[float], k: int, rng: np.random.Generator) -> np.ndarray:
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
