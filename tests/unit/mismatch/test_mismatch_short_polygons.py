"""Polygonal wheels with waves too short for the band: the wheel, the size and intact wheels, by full simulations."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.short_polygons import polygon_evidence, short_polygon_candidates
from turnout.mismatch.turnout.defect_priors import SHORT_POLYGONS
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan


def polygon_findings(*terms, seed=7, changed=lambda campaign: campaign):
    case = TrackCase(changed(measured_campaign(small_plan((15.0,), hammer_positions=()), terms, seed)))
    values = {n.name: n.mean for n in case.nuisances}
    return short_polygon_candidates(case, SimpleNamespace(candidates=(), values=values, terms=()))


def turned(wheel, size, order):
    return physics.OutOfRound(wheel, 0.8 * size, 0.6 * size, order, train="heavy")


@pytest.mark.parametrize(("wheel", "size", "order", "seed"), [(1, 6e-5, 13, 7), (3, 2.5e-5, 18, 9)])
def test_a_short_polygon_is_found_on_its_wheel_with_its_size(wheel, size, order, seed):
    """In recordings with roughness of every wheel; the simulation and its contact do not use the closed form."""
    (found,) = polygon_findings(turned(wheel, size, order), seed=seed)
    assert found.where == {"train": "heavy", "axle": wheel + 1} and found.site.rival_axles == ()
    mean, error = found.parameters[0].prior
    assert mean == pytest.approx(size, abs=1.96 * error) and error < 0.35 * size
    assert found.refit.promise > 12.0


def test_round_wheels_corrugation_and_hum_are_no_polygons():
    def hummed(campaign):
        def with_polygon(p):
            time = np.arange(p.recording.samples.shape[1]) / p.recording.rate
            hum = np.std(p.recording.samples) * np.sin(2.0 * np.pi * 150.0 * time)
            return replace(p, recording=replace(p.recording, samples=p.recording.samples + hum))

        return replace(campaign, passages=tuple(map(with_polygon, campaign.passages)))

    assert polygon_findings(seed=8) == ()
    assert polygon_findings(physics.RailCorrugation(20.5, 27.0, 3e-5, 0.0, 0.16)) == ()
    assert polygon_findings(seed=5, changed=hummed) == ()


def test_a_line_in_one_half_of_the_passages_alone_is_no_finding():
    """The wheel is polygonal in one passage and round in the other; whether that one is held out does not matter."""
    sound, worn = (
        measured_campaign(small_plan((15.0,), hammer_positions=()), terms, 7) for terms in ((), (turned(1, 6e-5, 13),))
    )
    other = next(p.name for p in worn.passages if p.train == "heavy")
    passages = tuple(s if w.name == other else w for s, w in zip(sound.passages, worn.passages))
    assert polygon_findings(changed=lambda _: replace(worn, passages=passages)) == ()
    assert polygon_findings(changed=lambda _: replace(worn, passages=passages, reserved=(other,)))


def test_the_evidence_is_that_of_an_amplitude_integrated_out():
    """By quadrature over what a polygon adds, N(0, LOUD²)."""
    sd, added = np.sqrt(SHORT_POLYGONS.wheel_sd**2 + SHORT_POLYGONS.sensor_sd**2 / 8), np.linspace(-40.0, 40.0, 200001)
    prior = np.exp(-0.5 * (added / SHORT_POLYGONS.polygon_sd) ** 2) / (SHORT_POLYGONS.polygon_sd * np.sqrt(2.0 * np.pi))
    ratio = np.exp(-0.5 * ((2.3 - added) / sd) ** 2 + 0.5 * (2.3 / sd) ** 2)
    assert polygon_evidence(2.3, 8) == pytest.approx(np.log(np.trapezoid(prior * ratio, added)), abs=1e-6)
