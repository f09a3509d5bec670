"""Effects beyond the range of a derivative are simulated at distant starts: wheelsets far from their filed mass."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import shortlist
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout.candidates.catalogue import distant_starts, residual_of_train
from turnout.physics import Parameter, UnsprungMass

FACTOR = (Parameter("factor", "-", 1.0, (0.4, 2.5), "times the pitch", "made up 2026", (1.0, 0.3)),)
T = np.linspace(0.0, 1.0, 300)
MASSES = UnsprungMass.distant_starts


class Pitch(Case):
    """A tone of twelve turns times a factor, known to 6 %, under noise of 0.1; columns are straight lines."""

    is_large = True
    nuisances = (Nuisance("tune", "-", 0.0, 0.06),)

    def __init__(self, true, afar=()):
        rng = np.random.default_rng(3)
        data = [self.tone(true) + 0.1 * rng.normal(size=T.size) for _ in range(2)]
        self.observations = tuple(Observation(f"o{k}", f"day {k}", d, np.full(T.size, 0.1)) for k, d in enumerate(data))
        self.candidates = (
            Candidate.of("pitch", FACTOR, lambda p: p["factor"], ((1.2,),), masking_parameter="tune", masking_sd=0.3),
        )
        self.afar = afar

    def tone(self, factor):
        return np.sin(2.0 * np.pi * 12.0 * factor * T)

    def predict(self, values, terms, observations):
        return [self.tone(np.exp(values["tune"]) * np.prod(terms)) for _ in observations]

    def screen(self, fit):
        near = self.predict({"tune": fit.values["tune"] + 1e-4}, (), self.observations)
        return {("pitch", 0): [np.log(1.2) * (a - b) / 1e-4 for a, b in zip(near, fit.predictions)]}

    def distant_starts(self, fit):
        return [(self.candidates[0], (m,)) for m in self.afar]


@pytest.mark.parametrize("true", [0.65, 1.6])
def test_an_effect_behind_a_barrier_is_found_from_a_distant_start(true):
    """Four periods away a derivative is useless: neither column nor masking parameter predict a gain of 2 nats."""
    blind = Pitch(true)
    assert shortlist(Search(blind), fit_jointly(blind)) == []
    case = Pitch(true, MASSES)
    (found,) = shortlist(Search(case), fit_jointly(case))
    assert found.start == pytest.approx([true]) and found.values == {"tune": 0.0}


def test_a_distant_start_without_a_gain_is_not_refitted():
    case = Pitch(1.0, MASSES)
    assert shortlist(Search(case), fit_jointly(case)) == []


def test_only_trains_with_more_residual_than_intact_ones_are_simulated():
    """Weighted mean squares of 2 and 0.5, where intact turnouts leave 0.7; a hammer test leaves more and is no
    train."""
    names = {"rough 1": "a", "rough 2": "a", "quiet": "b", "impacts": None}
    rms = {"rough 1": 1.0, "rough 2": np.sqrt(3.0), "quiet": np.sqrt(0.5), "impacts": 9.0}
    seen = [Observation(n, n, np.zeros(40), np.ones(40), effective=0.5) for n in names]
    case = SimpleNamespace(
        observations=seen, control_level={"passage": 0.7},
        aligned_passages={n: SimpleNamespace(conditions={"train": train}) for n, train in names.items() if train},
        candidates=[Candidate.of("unsprung_mass", FACTOR, float, ((1.4,),), {"train": t}) for t in "ab"],
    )  # fmt: skip
    fit = SimpleNamespace(white=[np.full(40, rms[o.name]) for o in seen])
    assert residual_of_train(case, fit, "a") == pytest.approx(2.0) and residual_of_train(
        case, fit, "b"
    ) == pytest.approx(0.5)
    assert residual_of_train(case, fit, "c") == 0.0
    found = distant_starts(case, fit)
    assert [(c.where["train"], start) for c, start in found] == [("a", (m,)) for m in MASSES]
