"""A mass on the rail may lie at every quarter of a bay; other effects lie at supports."""

import pytest

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan


@pytest.fixture(scope="module")
def case():
    plan = small_plan((15.0,), passages=False, hammer_positions=(21.6, 24.0))
    return TrackCase(measured_campaign(plan, seed=2))


def candidates_of(case, family):
    return sorted((c for c in case.candidates if c.family == family), key=lambda c: c.position)


def test_quarters_of_the_bay_beside_a_mass_complete_its_positions(case):
    masses = candidates_of(case, "attached_resonator")
    over, between = masses[10], masses[11]
    spacing = 2.0 * (between.position - over.position)
    for candidate, shares in ((over, (-0.75, -0.25, 0.25, 0.75)), (between, (-0.25, 0.25))):
        finer = case.finer_candidates(candidate)
        positions = [candidate.position + share * spacing for share in shares]
        assert [c.position for c in finer] == pytest.approx(positions, abs=2e-3)
        assert {c.family for c in finer} == {"attached_resonator"} and {c.site.n_scanned for c in finer} == {
            2 * candidate.site.n_scanned
        }


def test_a_finer_mass_is_attached_to_the_node_at_its_position(case):
    track = case.predictor.track()
    (first, *_) = case.finer_candidates(candidates_of(case, "attached_resonator")[10])
    mass = first.term(first.starts[0])
    bay = track.support[mass.support + 1] - track.support[mass.support]
    assert track.support[mass.support] + mass.beyond * bay == pytest.approx(first.position, abs=2e-3)
    assert mass.beyond == 0.25


@pytest.mark.parametrize("family", ["local_pad", "local_ballast", "sensor_gain"])
def test_other_effects_have_no_positions_between_supports(case, family):
    candidate = next(c for c in case.candidates if c.family == family)
    assert case.finer_candidates(candidate) == ()
