"""Pads whose stiffness rises with frequency as a power law, approximated by four Maxwell branches two octaves apart."""

import numpy as np

from turnout_blind.effect import Effect

BRANCH_RATES = 2.0 * np.pi * np.array([25.0, 100.0, 400.0, 1600.0])


def draw(rng, site, order):
    """Order of the power law; stiffness at 25 Hz is that of the pad."""
    return {}, {"order": float(order)}


def act(world, site, where, p):
    """Give branch b the increase of the power law over its factor of four in frequency, and halve the dashpots."""
    stiffness_ratios = 4.0 ** (p["order"] * np.arange(1, BRANCH_RATES.size + 1))
    world.branch_share = np.diff(np.concatenate([[1.0], stiffness_ratios]))
    world.branch_rate = BRANCH_RATES.copy()
    world.pad_damping = world.pad_damping * 0.5


EFFECT = Effect("pad_fractional", "condition", (0.01, 0.02, 0.035, 0.055, 0.08, 0.11, 0.15), draw, act)
