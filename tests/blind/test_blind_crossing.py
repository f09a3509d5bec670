"""Sites at a crossing: the casting in the rail, the nose under the wheels, and the owner's files of both."""

from collections import Counter

import numpy as np
import pytest

from turnout.config.load import load_configuration
from turnout.stages.track_files import track_of
from turnout_blind.crossing import Crossing
from turnout_blind.effect import load_effects
from turnout_blind.nominal_files import write_configuration
from turnout_blind.run import simulate_passage
from turnout_blind.score import case_reports
from turnout_blind.site import draw_site
from turnout_blind.strata import plan_cases

CAST = Crossing(6.0, bending=1.8, mass=2.4, depth=1.2e-3, length=0.8, share=0.4)


def test_a_casting_has_the_mass_of_its_stretch_in_the_file():
    """Half of each ramp lies in the stretch, so trapezoid and rectangle have equal areas. The rest is plain."""
    x = np.linspace(0.0, 12.0, 120001)
    start, end = CAST.ends
    for found, factor in zip(CAST.profile(x), (1.8, 2.4)):
        assert np.trapezoid(found - 1.0, x) == pytest.approx((factor - 1.0) * (end - start), rel=1e-6)
        assert found[0] == found[-1] == 1.0 and found.max() == factor
        assert found[np.searchsorted(x, 6.0)] == factor


def test_a_nose_is_as_deep_and_long_as_its_parameters_state():
    """It begins 0.4 of its length before the nose and ends 0.6 behind it. Its deepest point is rounded."""
    assert CAST.dip(6.0) == pytest.approx(1.2e-3)
    assert CAST.dip(6.0 - 0.32 - 0.016) == 0.0 < CAST.dip(6.0 - 0.32 + 0.001)
    assert CAST.dip(6.0 + 0.48 + 0.016) == 0.0 < CAST.dip(6.0 + 0.48 - 0.001)
    slope = np.diff(CAST.dip(6.0 + np.array([-1e-5, 0.0, 1e-5])))
    assert np.abs(slope).max() < 1e-5 * 2e-2 * 1.2e-3 / 0.32  # 2 % of the mean slope


@pytest.fixture(scope="module")
def site():
    return draw_site(np.random.default_rng([5, 23, 1]), panel="crossing")


def test_the_force_of_a_wheel_rises_at_the_nose_and_all_treads_differ(site):
    """The force of the first wheel rises at the nose by far more than elsewhere, and returns to the static load."""
    train, nose = site.true_trains["railcar"], site.world.surface[0]
    _, force, _ = simulate_passage(site.world, train, 30.0, [2.0], 1.2, 0.6)
    load = 0.5 * train.axle_load
    at = 2.0 + 30.0 * (np.arange(force.shape[1]) * 1e-3 - 0.6)
    x = np.linspace(0.0, 12.0, 2401)
    place = float(x[np.argmax(nose(x))])
    near, far = np.abs(at - place) < 0.6, (np.abs(at - place) > 3.0) & (at > -10.0) & (at < 14.0)
    assert force[0, near].max() > 1.25 * load > force[0, far].max()
    assert force[0, far].mean() == pytest.approx(load, rel=0.03)
    treads = [site.world.treads["railcar", axle][0] for axle in range(1, 9)]
    more = np.array([np.abs(tread(x, 0.0, 0.43)).max() for tread in treads])
    assert np.unique(more).size == 8 and more.max() < 0.6 * nose(x).max()


def test_the_files_of_the_owner_of_a_crossing_load_with_the_drawn_values(site, tmp_path):
    """They hold the stretch and the nose of the drawings with their priors, and no true value."""
    write_configuration(tmp_path / "config", "T1", site)
    (tmp_path / "raw").mkdir()
    text = (tmp_path / "config" / "tracks" / "site.yaml").read_text()
    turnout, _ = track_of(load_configuration(tmp_path / "config").turnout("T1"))
    (stretch,), filed = turnout.track.stretches, site.crossing
    assert (stretch.start, stretch.end) == pytest.approx(filed.ends, abs=1e-3)
    assert stretch.rail.mass == pytest.approx(60.2 * filed.mass, rel=1e-4)
    assert stretch.rail.bending_stiffness == pytest.approx(210e9 * 3037e-8 * filed.bending, rel=1e-4)
    (kink,) = turnout.surfaces("main")[0]
    assert (kink.place, kink.depth, kink.length) == pytest.approx((filed.nose, filed.depth, filed.length), rel=1e-4)
    assert turnout.spreads[kink]["depth"] == 0.4
    true = site.world.surface[0].__self__
    assert f"{1e3 * filed.depth:.6g}" in text and f"{filed.nose:.6g}" in text
    assert f"{1e3 * true.depth:.6g}" not in text and f"{true.nose:.6g}" not in text


def test_a_set_in_crossing_panels_has_the_strata_of_plain_track_and_a_worn_nose():
    plain, cast = (plan_cases(3, load_effects(), full=False, panel=p) for p in ("plain", "crossing"))
    assert {p.panel for p in plain} == {"plain"} and {p.panel for p in cast} == {"crossing"}
    kinds = [
        Counter((p.stratum, *(k for k, _ in p.effects)) for p in s if p.stratum != "double") for s in (plain, cast)
    ]
    assert kinds[1] - kinds[0] == Counter({("single", "nose"): 1}) and not kinds[0] - kinds[1]


def test_the_figure_of_a_case_at_a_crossing_shows_a_crossing_panel(monkeypatch, tmp_path):
    class Staged(Exception):
        """Ends the simulation as soon as the panel is known."""

    def staged(plan, effects):
        raise Staged(plan.panel)

    monkeypatch.setattr(case_reports, "stage", staged)
    truth = {"stratum": "control", "effects": [], "seed": [1], "panel": "crossing"}
    with pytest.raises(Staged, match="crossing"):
        case_reports.draw_case(truth, [], None, tmp_path / "story.svg", {})


def test_a_nose_wears_at_its_tip_by_the_stated_depth_and_nowhere_else(site):
    """Parabolic slopes of 0.25 and 0.75 of the length: the depth at the tip, a quarter of it half way to either end."""
    effect = load_effects()["nose"]
    where, p = effect.draw(np.random.default_rng(2), site, 1.5e-3)
    assert abs(where["position"] - site.crossing.nose) < 0.2  # 4 sd of the file's error of 5 cm
    p |= {"length": 0.8, "share": 0.25}
    world = site.world.copy()
    effect.act(world, site, where, p)
    assert len(world.surface) == len(site.world.surface) + 1

    def wear(x):
        return sum(f(np.array(x)) for f in world.surface) - sum(f(np.array(x)) for f in site.world.surface)

    at = where["position"]
    assert wear([at]) == pytest.approx(1.5e-3)
    assert wear([at - 0.24, at + 0.64, at - 3.0]) == pytest.approx(0.0)
    assert 0.25 * 1.5e-3 < wear([at + 0.3]) < 0.4 * 1.5e-3  # rounded over 3 cm: a little more than a quarter
    plain = draw_site(np.random.default_rng(1))
    with pytest.raises(ValueError, match="only a crossing"):
        effect.draw(np.random.default_rng(2), plain, 1e-3)


@pytest.mark.parametrize("panel", ["plain", "crossing"])
@pytest.mark.parametrize("seed", [0, 1, 2, 8])  # each boundary of sections
def test_each_support_is_in_the_file_with_the_values_of_its_own_section(panel, seed, tmp_path):
    """A boundary on a support would give it the pad, the bed and the mass of the other section."""
    site = draw_site(np.random.default_rng([5, 29, seed]), panel=panel)
    write_configuration(tmp_path / "config", "T1", site)
    track = track_of(load_configuration(tmp_path / "config").turnout("T1"))[0].track
    world, (west, east) = site.world, site.nominal
    boundary = site.zones[1][0]
    assert np.abs(track.support - boundary).min() == pytest.approx(0.3)
    for position, stiffness, mass in zip(track.support, track.ballast_stiffness, track.sleeper_mass):
        if not world.position[0] < position < world.position[-1]:
            continue
        nominal = west if position < boundary else east
        assert (stiffness, mass) == pytest.approx((nominal["ballast"], nominal["mass"]))
        assert world.mass[world.nearest(position)] == pytest.approx(mass, rel=0.14)
