"""Share of the recordings that a concealed effect makes up, by simulation of the site with and without it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.instrument import amplify
from turnout_blind.march import TIME_STEP
from turnout_blind.record import PASSAGE_DECIMATION, RATE, passage_motion, sensor_positions
from turnout_blind.run import simulate_impacts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

HAMMER_BAND, PASSAGE_BAND = (30.0, 800.0), (5.0, 800.0)  # [Hz]


def effect_visibility(site: Site, world: World, seed: Sequence[int]) -> dict[str, float]:
    r"""Share of the response that an effect makes up, largest over the sensors.

    .. math:: 100\, \|y - y_0\| / \|y\|

    with :math:`y_0` of the same rails, wheels and impacts without the effect, below 800 Hz and without noise. The fit
    cannot lose more than this if the effect is left out, even without a refit. Used are one impact per position and the
    first passage of each train.

    Parameters
    ----------
    site : Site
        The site.
    world : World
        World with the effect.
    seed : sequence of int
        Seed of the faults and of other sources.

    Returns
    -------
    dict
        "hammer_pct" and "passage_pct". [%]
    """
    before, after = (_impact_signals(site, w, seed) for w in (site.world, world))
    hammer = _relative_difference(before, after, HAMMER_BAND, 3)
    passage_pairs: list[list[np.ndarray]] = []
    first_passage: dict[str, int] = {}
    for k, plan in enumerate(site.passages):
        first_passage.setdefault(plan.train, k)
    for k in first_passage.values():
        passage_pairs.append([_passage_signals(site, w, k, seed) for w in (site.world, world)])
    passage = max(_relative_difference(a, b, PASSAGE_BAND, PASSAGE_DECIMATION) for a, b in passage_pairs)
    return {"hammer_pct": round(hammer, 2), "passage_pct": round(passage, 2)}


def _sensor_signals(site: Site, world: World, a: np.ndarray, recording_type: str, seed: Sequence[int]) -> np.ndarray:
    """Signals of the sensors under the motion ``a``, with faults and without noise."""
    rows = []
    for i, chain in enumerate(site.chains):
        faults = [fault(recording_type, np.random.default_rng(seed)) for fault in world.channels.get(chain.name, ())]
        rows.append(amplify(chain, a[i], RATE, faults))
    return np.array(rows)


def _impact_signals(site: Site, world: World, seed: Sequence[int]) -> np.ndarray:
    """Responses to one impact at each position, at the temperature of the second campaign, concatenated."""
    rows = []
    for position in site.hammer_positions:
        warm = site.temperatures[1]
        _, a, _ = simulate_impacts(
            world, sensor_positions(site, world), position, [0.005], [0.95], 0.12, warm, tip=site.tip
        )
        rows.append(_sensor_signals(site, world, a, "hammer", seed))
    return np.concatenate(rows, axis=1)


def _passage_signals(site: Site, world: World, k: int, seed: Sequence[int]) -> np.ndarray:
    return _sensor_signals(site, world, passage_motion(site, world, k, np.random.default_rng(seed)), "passage", seed)


def _relative_difference(before: np.ndarray, after: np.ndarray, band: tuple[float, float], decimation: int) -> float:
    f = np.fft.rfftfreq(before.shape[1], TIME_STEP)
    inside = (f >= band[0]) & (f <= band[1])
    a, b = (np.fft.rfft(x)[:, inside] for x in (before, after))
    difference, total = np.linalg.norm(b - a, axis=1), np.linalg.norm(b, axis=1)
    has_signal = total > 0.0  # an unplugged channel shows nothing of the effect
    return float(np.max(100.0 * difference[has_signal] / total[has_signal], initial=0.0))
