"""Pads whose stiffness rises with frequency as a power law, approximated by four Maxwell branches two octaves apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

BRANCH_RATES = 2.0 * np.pi * np.array([25.0, 100.0, 400.0, 1600.0])


def draw(rng: np.random.Generator, site: Site, order: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Order of the power law; stiffness at 25 Hz is that of the pad.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    order : float
        Order of the power law. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return {}, {"order": float(order)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Give branch b the increase of the power law over its factor of four in frequency, and halve the dashpots.

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
    stiffness_ratios = 4.0 ** (p["order"] * np.arange(1, BRANCH_RATES.size + 1))
    world.branch_share = np.diff(np.concatenate([[1.0], stiffness_ratios]))
    world.branch_rate = BRANCH_RATES.copy()
    world.pad_damping = world.pad_damping * 0.5


EFFECT = Effect("pad_fractional", "condition", (0.01, 0.02, 0.035, 0.055, 0.08, 0.11, 0.15), draw, act)
