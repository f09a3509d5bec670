"""Wheelsets far from the mass of their vehicle's file: a derivative does not reach there, so they are simulated.

The P2 resonance goes as the inverse root of the unsprung mass. Where it has moved by more than its own width, a few per
cent more make the fit worse, and so says the derivative; what gains lies behind that hump.
"""

import numpy as np

MASSES = (0.65, 1.3, 1.6, 2.0)  # times that of the file: an eighth of the P2 frequency apart


def distant_wheels(case, fit):
    """(candidate, start) of masses to simulate, for trains that leave more than those of sound turnouts do."""
    level = case.control_level["passage"]
    heavy = [c for c in case.candidates if c.family == "unsprung_mass"]
    loud = [c for c in heavy if left_by(case, fit, c.where["train"]) > level]
    return [(c, (mass,)) for c in loud for mass in MASSES]


def left_by(case, fit, train):
    """Weighted mean square that ``fit`` leaves of the passages of a train, 0 without one."""
    mine = [
        (o.n_effective, o.effective * float(np.sum(np.square(w))))
        for o, w in zip(case.observations, fit.white)
        if o.name in case.rollings and case.said(case.rollings[o.name])["train"] == train
    ]
    return sum(left for _, left in mine) / sum(n for n, _ in mine) if mine else 0.0
