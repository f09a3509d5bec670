"""Intact panels of the track file of a real turnout, also lightly damped ones and the crossing, are no mismatch."""

import numpy as np
import pytest

from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import CampaignInput, TrackCase
from turnout.mismatch.turnout.campaign import HammerInput, PassageInput
from turnout.simulate import Sensor, load_track, load_vehicle, simulate_hammer, simulate_passage
from turnout.simulate.hammer import Hammer

SPEEDS = (39.0, 43.0)  # m/s; at higher speeds the frequencies are nearer to those with low decay along the track
# s of a hammer record, 0.12 of them after the impact: some impacts would be rejected as cut off with less
RECORD = 0.17


def measured(places, seed):
    """Impacts at the first position and two trains over one rail; the file of the owner describes exactly this
    track."""
    turnout = load_track("tommerup")
    sensors = tuple(Sensor(f"S{x:g}", x, noise=0.05) for x in places)
    impacts = simulate_hammer(turnout, places[0], Hammer(position_spread=0.004), sensors, 5, seed=seed, duration=RECORD)
    passages = []
    for k, speed in enumerate(SPEEDS):
        train = load_vehicle("ic3", 0.5)
        recording = simulate_passage(
            turnout, train, speed, sensors, seed=seed + k, rail_seed=seed, rate=5e3, lead=0.6, tail=0.4
        )
        passages.append(PassageInput(f"ic3 {k}", recording, train, speed, "ic3"))
    return CampaignInput(turnout, sensors, (HammerInput("impacts", places[0], impacts),), tuple(passages))


@pytest.mark.slow
@pytest.mark.parametrize(("places", "seed"), [((3.6,), 1), ((13.8,), 7), ((24.6, 26.4), 7)])
def test_the_residual_of_intact_panels_is_that_of_controls(places, seed):
    """Switch, closure and crossing panel; with the control levels of the settings, which are from plain track of
    another simulation."""
    case = TrackCase(measured(places, seed))
    assert len(case.aligned_passages) == len(SPEEDS)
    base = fit_jointly(case, iterations=case.settings.base_iterations)
    assert base.level["hammer"] < case.settings.hammer_control
    assert base.level["passage"] < case.settings.passage_control
    worst = [np.max(np.mean(np.reshape(w, (len(places), -1)) ** 2, axis=1)) for w in base.white[-len(SPEEDS) :]]
    assert max(worst) < case.settings.cell_control
