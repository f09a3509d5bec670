"""A leader that is too small to report: the next effect has to have a gain beside it."""

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.refit import correct_for_leader
from turnout.mismatch.engine.search import Search
from turnout.physics import Parameter

AMOUNT = (Parameter("amount", "-", 0.0, (-3.0, 3.0), "share of a shape", "made up 2026"),)
X = np.linspace(0.0, 1.0, 400)
SHAPES = {"wave": np.sin(9.0 * X), "near": np.sin(9.4 * X), "ramp": X - 0.5}


class Shapes(Case):
    """Sums of shapes under noise of 0.1; a wave counts from 10 on, the others always."""

    is_large = True

    def __init__(self, **true):
        noise = 0.1 * np.random.default_rng(6).normal(size=X.size)
        basis = np.linalg.qr(np.column_stack(list(SHAPES.values())))[0]
        noise -= basis @ (basis.T @ noise)  # the noise favours no shape
        data = sum(a * SHAPES[n] for n, a in true.items()) + noise
        self.observations = (Observation("all", "all", data, np.full(X.size, 0.1)),)
        self.candidates = tuple(
            Candidate.of(
                n,
                AMOUNT,
                lambda p, n=n: (n, p["amount"]),
                ((0.5,),),
                {"shape": n},
                smallest_reportable=10.0 * (n == "wave"),
            )
            for n in SHAPES
        )

    def predict(self, values, terms, observations):
        return [sum((a * SHAPES[n] for n, a in terms), np.zeros(X.size))]

    def is_hammer_test(self, observation):
        return True

    def ranked(self):
        search = Search(self)
        base = fit_jointly(self)
        fits = [(c, fit_jointly(self, (c,), c.starts[0])) for c in self.candidates]
        scores = [score_of(search, base, f, c) for c, f in fits]
        return correct_for_leader(search, base, sorted(scores, key=lambda s: -s.gain))


@pytest.mark.parametrize("true, kept", [({"wave": 1.0}, False), ({"wave": 1.0, "ramp": 0.8}, True)])
def test_a_name_without_a_gain_beside_the_leader_is_rejected_and_another_effect_is_not(true, kept):
    """A wave of nearly the same length gains hundreds of nats from the leading wave, and hardly any beside it."""
    settings = MismatchSettings()
    ranked = Shapes(**true).ranked()
    best = next(s for s in ranked if s.is_reportable)
    assert (best.gain > settings.threshold) == kept


def test_a_name_with_the_evidence_of_the_leader_is_accepted():
    """Both explain equally much of a wave in between: an effect that is too small to report does not replace the
    other."""
    settings = MismatchSettings()
    case = Shapes(**{n: size / np.linalg.norm(SHAPES[n]) for n, size in (("wave", 6.05), ("near", 6.0))})
    ranked = case.ranked()
    near, wave = (next(s for s in ranked if s.family == n) for n in ("near", "wave"))
    assert near.is_reportable and not wave.is_reportable
    assert 0.0 < wave.gain - near.gain < settings.margin and near.gain > 10.0 * settings.threshold
