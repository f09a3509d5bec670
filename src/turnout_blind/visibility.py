"""Share of the recordings that a concealed effect makes up, by simulation of the site with and without it."""

import numpy as np

from turnout_blind.instrument import amplified
from turnout_blind.march import STEP
from turnout_blind.record import PASSAGE_DOWN, RATE, passage_motion, sensor_places
from turnout_blind.run import strike

HAMMER_BAND, PASSAGE_BAND = (30.0, 800.0), (5.0, 800.0)  # [Hz]


def visible(site, world, seed):
    r"""{"hammer_pct", "passage_pct"}: share of the response that an effect makes up, largest over the sensors.

    .. math:: 100\, \|y - y_0\| / \|y\|

    with :math:`y_0` of the same rails, wheels and impacts without the effect, below 800 Hz and without noise. The fit
    cannot lose more than this if the effect is left out, even without a refit. Used are one impact per position and the
    first passage of each train.
    """
    pairs = [_blow(site, w, seed) for w in (site.world, world)]
    hammer = _difference(*pairs, HAMMER_BAND, 3)
    rolled, first = [], {}
    for k, plan in enumerate(site.passages):
        first.setdefault(plan.train, k)
    for k in first.values():
        rolled.append([_pass(site, w, k, seed) for w in (site.world, world)])
    passage = max(_difference(a, b, PASSAGE_BAND, PASSAGE_DOWN) for a, b in rolled)
    return {"hammer_pct": round(hammer, 2), "passage_pct": round(passage, 2)}


def _shown(site, world, a, kind, seed):
    """Signals of the sensors under the motion ``a``, with faults and without noise."""
    rows = []
    for i, chain in enumerate(site.chains):
        faults = [fault(kind, np.random.default_rng(seed)) for fault in world.channels.get(chain.name, ())]
        rows.append(amplified(chain, a[i], RATE, faults))
    return np.array(rows)


def _blow(site, world, seed):
    """Responses to one impact at each position, at the temperature of the second campaign, concatenated."""
    rows = []
    for point in site.blows:
        warm = site.temperatures[1]
        _, a, _ = strike(world, sensor_places(site, world), point, [0.005], [0.95], 0.12, warm, tip=site.tip)
        rows.append(_shown(site, world, a, "hammer", seed))
    return np.concatenate(rows, axis=1)


def _pass(site, world, k, seed):
    return _shown(site, world, passage_motion(site, world, k, np.random.default_rng(seed)), "passage", seed)


def _difference(before, after, band, down):
    f = np.fft.rfftfreq(before.shape[1], STEP)
    inside = (f >= band[0]) & (f <= band[1])
    a, b = (np.fft.rfft(x)[:, inside] for x in (before, after))
    missed, whole = np.linalg.norm(b - a, axis=1), np.linalg.norm(b, axis=1)
    heard = whole > 0.0  # an unplugged channel shows nothing of the effect
    return float(np.max(100.0 * missed[heard] / whole[heard], initial=0.0))
