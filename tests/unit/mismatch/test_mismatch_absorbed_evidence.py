"""Evidence for effects that a nuisance parameter has absorbed, against a linear problem in closed form."""

import numpy as np
from scipy import stats

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import gain_with_wide_prior, masked_candidates
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.physics.term import Parameter

TAU, NOISE, WIDE = 0.1, 0.06, 0.7


def test_a_wider_prior_gains_the_ratio_of_two_marginal_densities():
    y = -0.69
    s = (TAU**-2 + NOISE**-2) ** -0.5
    gain, size = gain_with_wide_prior(y * s**2 / NOISE**2, s, TAU, WIDE)
    opened, closed = (stats.norm(0.0, np.hypot(NOISE, sd)).logpdf(y) for sd in (WIDE, TAU))
    assert np.isclose(gain, opened - closed, atol=0.0, rtol=1e-12)
    assert np.isclose(size, y * WIDE**2 / (WIDE**2 + NOISE**2), atol=0.0, rtol=1e-12)


class Springs(Case):
    """Two springs in series with unknown logarithms; the second is soft."""

    is_large = True

    def __init__(self):
        self.nuisances = tuple(Nuisance(f"spring_{k}", "-", 0.0, TAU) for k in range(2))
        self.observations = (Observation("sum", "a", np.full(60, 0.1 - 0.7), 0.3), Observation("first", "b",
                             np.full(60, 0.1), 0.3))  # fmt: skip
        factor = Parameter("factor", "-", 1.0, (0.05, 8.0), "", "")
        self.candidates = tuple(
            Candidate.of("soft", (factor,), lambda p, k=k: (k, p["factor"]), ((0.5,),), {"place": k}, n_scanned=2,
                      masking_parameter=f"spring_{k}") for k in range(2)
        )  # fmt: skip

    def predict(self, values, terms, observations):
        logs = [values["spring_0"], values["spring_1"]]
        for k, factor in terms:
            logs[k] += np.log(factor)
        log_by_name = {"sum": logs[0] + logs[1], "first": logs[0]}
        return [np.full(o.data.size, log_by_name[o.name]) for o in observations]


def test_a_spring_that_absorbed_an_effect_is_a_candidate_with_the_size_of_the_effect():
    case = Springs()
    entries = masked_candidates(case, fit_jointly(case, iterations=12))
    gain, candidate, start, values = max(entries, key=lambda e: e[0])
    assert candidate.where["place"] == 1 and gain > 10.0
    # wide prior: least squares but for noise over prior, (0.3 / sqrt(60) / 0.7)² = 0.3 %, and 0.15 of it of the other's
    assert np.isclose(np.log(start[0]), -0.7, atol=0.0, rtol=0.03)
    assert values["spring_1"] == 0.0 and np.isclose(values["spring_0"], 0.1, atol=0.02)
    other = next(e for e in entries if e[1].where["place"] == 0)
    assert other[0] < 3.0
