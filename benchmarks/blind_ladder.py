"""How plainly each rung of each ladder is to be seen, by the generator alone.

    python -m benchmarks.blind_ladder [--rungs 0 3 6] [--sites 2] [--kinds void flat]

Prints per kind and rung: the share of the recordings that the effect makes up, in impacts and in passages [%], and the
index: that share over what a recording hides anyway - 6 % of an impact's response (gains, seats, twist: what two
owners' models differ by) and 46 % of a passage's, mostly roughness. Below 0.3 nobody sees it, above 1 everybody should.
"""

import argparse

import numpy as np

from turnout_blind.effect import load_effects
from turnout_blind.site import draw_site
from turnout_blind.visibility import effect_visibility

HIDDEN_SHARE = {"hammer_pct": 6.0, "passage_pct": 46.0}


def index_of(visibility):
    """Largest ratio of a share to what hides it."""
    return max(visibility[quantity] / HIDDEN_SHARE[quantity] for quantity in HIDDEN_SHARE)


def measure_visibility(effect, rung, seed):
    """Shares [%] that the effect makes up at a site drawn with ``seed``."""
    rng = np.random.default_rng([seed, 5])
    site = draw_site(rng, **effect.site)
    world = site.world.copy()
    drawn = effect.draw_concealed(rng, site, rung)
    effect.act(world, site, drawn.where, drawn.parameters)
    return effect_visibility(site, world, [seed, rung])


def main():
    """Print the ladders."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rungs", type=int, nargs="+")
    parser.add_argument("--sites", type=int, default=1)
    parser.add_argument("--kinds", nargs="+")
    args = parser.parse_args()
    for effect_type, effect in sorted(load_effects().items()):
        if args.kinds and effect_type not in args.kinds:
            continue
        last = len(effect.ladder) - 1
        for rung in sorted({min(r, last) for r in args.rungs} if args.rungs else range(last + 1)):
            visibilities = [measure_visibility(effect, rung, seed) for seed in range(args.sites)]
            hammer, passage = (np.mean([s[k] for s in visibilities]) for k in HIDDEN_SHARE)
            index = np.mean([index_of(s) for s in visibilities])
            print(f"{effect_type:18s} {rung}  {hammer:7.1f} {passage:7.1f}  {index:6.2f}", flush=True)


if __name__ == "__main__":
    main()
