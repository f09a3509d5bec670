"""The pressure of a wide pad on the rail has the width of the pad on any mesh."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.simulate import uniform_track
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import add_rails, assemble, link_matrices

WIDTH, F = 0.15, np.array([50.0, 200.0, 400.0, 600.0])
IRREGULAR = np.array([0.0, 0.55, 1.2, 1.8, 2.3])


@pytest.mark.parametrize("elements", [3, 4, 8])
@pytest.mark.parametrize("support", [0.6 * np.arange(5), IRREGULAR], ids=["even", "uneven"])
def test_two_points_of_a_pad_are_a_third_of_its_width_apart(support, elements):
    """Mean of |x - y| over an interval b: b/3. The pad presses with its whole force, about its own middle."""
    track = uniform_track(2.4).with_(support=support, elements_per_bay=elements, pad_width=WIDTH)
    for j in (1, 2, 3):
        *rail, sleeper = track.pad_link(j).ends
        share = np.array([weight for _, weight in rail])
        before, behind = np.diff(support[j - 1 : j + 2]) / elements
        place = np.array([-before, 0.0, behind])
        assert sleeper == (("sleeper", j), -1.0) and np.all(share > 0.0)
        assert share.sum() == pytest.approx(1.0) and share @ place == pytest.approx(0.0, abs=1e-15)
        assert share @ np.abs(place[:, None] - place) @ share == pytest.approx(WIDTH / 3.0)


def change(track, matrices):
    """Share by which wide pads change the receptance over a support, against narrow ones on the same mesh."""
    narrow = receptance(assemble(track.with_(pad_width=0.0)), F, 2.4, 2.4)
    return receptance(matrices, F, 2.4, 2.4) / narrow - 1.0


def pressed_evenly(track):
    """Matrices of ``track`` with an even pressure under every pad, on all nodes that it covers."""
    n = round(0.5 * WIDTH / (0.6 / track.elements_per_bay))
    share = {k: (0.5 if abs(k) == n else 1.0) / (2 * n) for k in range(-n, n + 1)}
    links = []
    for j in range(track.support.size):
        for link in track.support_links(j):
            if link.tag == "pad" and 0 < j < track.support.size - 1:
                rail = tuple((("rail", j, k) if k else ("rail", j), weight) for k, weight in share.items())
                link = replace(link, ends=(*rail, (("sleeper", j), -1.0)))
            links.append(link)
    return add_rails(link_matrices(track, links), track)


def test_a_pad_changes_the_receptance_by_its_width_and_not_by_the_mesh():
    """Against a pad of 0.15 m that presses evenly on elements of 19 mm. Three nodes are right for the rail's shear and
    too wide for its bending: a quarter of the effect with 4 elements per bay, an eighth with 8."""
    fine = uniform_track(5.4, elements_per_bay=32)
    expected = change(fine, pressed_evenly(fine))
    found = []
    for elements, left in ((4, 0.25), (8, 0.125)):
        track = uniform_track(5.4, elements_per_bay=elements, pad_width=WIDTH)
        found.append(change(track, assemble(track)))
        assert np.max(np.abs(found[-1] - expected)) < left * np.max(np.abs(expected))
    assert np.max(np.abs(found[0] - found[1])) < 0.15 * np.max(np.abs(expected))


def test_a_pad_wider_than_three_nodes_is_rejected():
    with pytest.raises(
        SimulationError, match=r"pad_width 0\.25 m is not between 0 and 0\.200 m.* 0\.075 m apart; fewer"
    ):
        uniform_track(6.0, elements_per_bay=8, pad_width=0.25)
    with pytest.raises(SimulationError, match="pad_width nan"):
        uniform_track(6.0, pad_width=float("nan"))
    assert uniform_track(6.0, pad_width=0.25).pad_width == 0.25
