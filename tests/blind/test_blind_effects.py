"""Effects, plans, roughness and instruments of the blind generator, and its independence of what it tests."""

import ast
from collections import Counter

import numpy as np
import pytest

from turnout_blind.effect import LOCKS, load_effects
from turnout_blind.instrument import MeasurementChain, amplify, digitise, mounting_response
from turnout_blind.roughness import level, patch_share, rail_roughness, wheel_roughness
from turnout_blind.score.names import RIGHT_NAMES, SAME_PARAMETERS
from turnout_blind.site import draw_site
from turnout_blind.strata import case_id, plan_cases
from turnout_blind.visibility import _relative_difference

EFFECTS = load_effects()
MAY = {"turnout", "turnout.errors", "turnout.records", "turnout.readers", "turnout.readers.writing"}


def test_the_generator_does_not_import_the_package_that_it_tests(repository):
    """Only records, errors and the writers of raw files, in every file, at the top and inside functions."""
    files = sorted((repository / "src" / "turnout_blind").rglob("*.py"))
    assert len(files) > 30
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, path
                names = [node.module]
            for name in names:
                if name.split(".")[0] == "turnout":
                    assert name in MAY, f"{path} imports {name}"


def test_the_tool_does_not_import_the_generator(repository):
    """But for the command that starts it, and the table of former module names."""
    for path in (repository / "src" / "turnout").rglob("*.py"):
        if path.name not in ("blind.py", "former_names.py"):
            assert "turnout_blind" not in path.read_text(), path


def contents(world):
    """All numbers and callables of a world, to compare."""
    return {k: v.tobytes() if isinstance(v, np.ndarray) else repr(v) for k, v in world.__dict__.items()}


@pytest.mark.parametrize("kind", sorted(EFFECTS))
def test_an_effect_changes_only_its_copy_of_the_world(kind):
    effect = EFFECTS[kind]
    assert len(effect.ladder) == (7 if effect.stratum in ("single", "history", "switch") else 4)
    for rung in range(len(effect.ladder)):
        site = draw_site(np.random.default_rng(rung), **effect.site)
        before, world = contents(site.world), site.world.copy()
        drawn = effect.draw_concealed(np.random.default_rng(rung), site, rung)
        effect.act(world, site, drawn.where, drawn.parameters)
        assert contents(site.world) == before
        assert contents(world) != before
        assert drawn.locked_to in LOCKS
        if "position" in drawn.where and kind != "beyond_reach":
            assert min(site.sensors) - 0.6 < drawn.where["position"] < max(site.sensors) + 0.6
        if "sleeper" in drawn.where:
            assert site.world.nearest(drawn.where["position"]) == drawn.where["sleeper"]
        if "axle" in drawn.where:
            assert 1 <= drawn.where["axle"] <= site.trains[drawn.where["train"]].axles().size


def test_every_kind_has_an_entry_in_the_table_of_right_names():
    assert set(EFFECTS) == set(RIGHT_NAMES)
    for kind, same in SAME_PARAMETERS.items():
        site = draw_site(np.random.default_rng(1), **EFFECTS[kind].site)
        assert set(same) <= set(EFFECTS[kind].draw_concealed(np.random.default_rng(2), site, 3).parameters), kind


def test_a_full_set_has_the_numbers_of_cases_that_the_proof_needs():
    plans = plan_cases(3, EFFECTS)
    strata = Counter(p.stratum for p in plans)
    assert len(plans) >= 200
    assert strata["control"] >= 60
    assert (strata["double"], strata["outside"], strata["unidentifiable"]) == (20, 20, 16)
    singles = Counter(p.effects[0][0] for p in plans if p.stratum == "single")
    assert min(singles.values()) == 7
    assert len({p.effects[0][0] for p in plans if p.stratum == "outside"}) >= 4
    rungs = [p.effects[0][1] for p in plans if p.stratum == "single" and p.effects[0][0] == "void"]
    assert sorted(rungs) == list(range(7))
    assert len({p.seed for p in plans}) == len(plans)


def test_the_order_of_the_cases_has_no_information_on_their_effects():
    """Names sort the cases otherwise than any stratum: ranks of the controls among the names are like any others."""
    plans = plan_cases(3, EFFECTS)
    named = sorted(range(len(plans)), key=lambda k: case_id(3, k))
    ranks = np.array([i for i, k in enumerate(named) if plans[k].stratum == "control"])
    n, m = len(plans), ranks.size
    spread = np.sqrt((n + 1) * (n - m) / (12.0 * m))
    assert abs(ranks.mean() - 0.5 * (n - 1)) < 3.0 * spread


def test_a_user_adds_an_effect_as_one_file(tmp_path):
    (tmp_path / "squeal.py").write_text(
        "from turnout_blind.effect import Effect\n"
        "def draw(rng, site, level):\n    return {}, {'level': level}\n"
        "def act(world, site, where, p):\n    world.surface.append(lambda x: p['level'] * x)\n"
        "EFFECT = Effect('squeal', 'wheel', (1.0, 2.0), draw, act)\n"
    )
    effects = load_effects(tmp_path)
    assert effects["squeal"].ladder == (1.0, 2.0)
    plans = plan_cases(3, effects, only={"squeal"})
    assert Counter(p.stratum for p in plans) == {"control": 2, "single": 2}
    (tmp_path / "empty.py").write_text("x = 1\n")
    with pytest.raises(ValueError, match=r"empty\.py: defines no EFFECT"):
        load_effects(tmp_path)


def test_a_polygonal_wheel_excites_the_track_at_60_to_110_hz():
    """n v / 2 pi R of the drawn order at the mean speed of the train; rounding errs by up to half an order."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        site = draw_site(rng)
        drawn = EFFECTS["out_of_round"].draw_concealed(rng, site, 6)
        train = site.trains[drawn.where["train"]]
        turns = np.mean([p.speed for p in site.passages if p.train == train.name]) / (2.0 * np.pi * train.radius)
        assert 60.0 - 0.51 * turns < drawn.parameters["order"] * turns < 110.0 + 0.51 * turns
        assert drawn.parameters["amplitude"] == pytest.approx(5e-4)  # 1 mm from peak to peak


def test_a_clipped_channel_shows_its_limit_as_the_mean_of_both_sides():
    """Signals far beyond the limit end there; signals within 0.73 of it stay. Real peaks reach the limit."""
    site = draw_site(np.random.default_rng(4))
    world = site.world.copy()
    drawn = EFFECTS["clipping"].draw_concealed(np.random.default_rng(4), site, 2)
    EFFECTS["clipping"].act(world, site, drawn.where, drawn.parameters)
    (fault,) = world.channels[drawn.where["sensor"]]
    apply_fault, limit = fault("hammer", None), drawn.parameters["limit"]
    far = apply_fault(np.array([100.0, -100.0]) * limit, 6e4)
    assert 0.5 * (far[0] - far[1]) == pytest.approx(limit)
    small = np.linspace(-0.73, 0.73, 9) * limit
    assert apply_fault(small, 6e4) == pytest.approx(small)
    assert 20.0 < limit / drawn.parameters["share"] < 1000.0  # an impact of 10 kN on a rail, within the sensor's range


def test_a_saturating_amplifier_limits_the_resonance_of_the_mounting():
    """A pulse excites the mounting at 3.5 kHz, far beyond the limit. The larger side ends at 1.08 of the limit."""
    site = draw_site(np.random.default_rng(4))
    world = site.world.copy()
    EFFECTS["clipping"].act(world, site, {"sensor": "A2"}, {"limit": 50.0})
    faults = [fault("hammer", None) for fault in world.channels["A2"]]
    click = np.zeros(6000)
    click[1000:1010] = 400.0
    free, saturated = (np.abs(amplify(MeasurementChain("A2", 1000.0), click, 60000.0, f)).max() for f in ((), faults))
    assert free > 3.0 * saturated
    assert saturated == pytest.approx(54.0)


def test_rail_roughness_has_its_level_in_every_octave():
    """Variance in a third of an octave against 10^(L/10) µm², over realisations; 25 % for 30 of them."""
    x = np.arange(0.0, 20.0, 5e-3)
    f = np.fft.rfftfreq(x.size, 5e-3)
    power = np.zeros(f.size)
    for seed in range(30):
        power += np.abs(np.fft.rfft(rail_roughness(np.random.default_rng(seed), 2.0)(x))) ** 2 * 2.0 / x.size**2 / 30
    for wavelength in (1.0, 0.25, 0.08):
        low, high = 2.0 ** (-0.5) / wavelength, 2.0**0.5 / wavelength
        thirds = [wavelength * 2.0 ** (k / 3.0) for k in (-1, 0, 1)]
        wanted = sum(1e-12 * 10.0 ** (level(w, 2.0) / 10.0) * patch_share(w) for w in thirds)
        assert power[(f >= low) & (f < high)].sum() == pytest.approx(wanted, rel=0.25)


def test_wheel_roughness_repeats_every_turn():
    dips = wheel_roughness(np.random.default_rng(1), -3.0, 0.43)
    x = np.linspace(0.0, 2.0, 50)
    assert dips(x + 2.0 * np.pi * 0.43, 0.3) == pytest.approx(dips(x, 0.3), abs=1e-10)
    assert not np.allclose(dips(x, 0.3), dips(x, 1.3), atol=1e-6)


def test_a_mounting_is_flat_below_its_resonance_and_peaks_by_its_quality_factor():
    t = np.arange(60000) / 60000.0
    for frequency, gain in ((50.0, 1.0), (400.0, 8.0)):
        response = mounting_response(np.sin(2.0 * np.pi * frequency * t), 60000.0, 400.0, 8.0)
        assert np.abs(response[40000:]).max() == pytest.approx(gain, rel=0.03)


def test_a_converter_has_steps_and_range_of_sixteen_bits():
    chain = MeasurementChain("A1", 100.0, mount=0.0, coupling=0.0, noise=0.0, drift=0.0)
    t = np.arange(60000) / 60000.0
    digitised = digitise(chain, 150.0 * np.sin(2.0 * np.pi * 5.0 * t), 60000.0, 12, np.random.default_rng(0))
    steps = digitised / chain.step
    assert digitised.size == 5000
    assert np.allclose(steps, np.round(steps), atol=1e-8)
    assert (steps.min(), steps.max()) == (-32768, 32767)


def test_a_silent_channel_does_not_count_in_the_visibility_of_an_effect():
    """Its relative change would be infinite."""
    t = np.arange(6000) / 60000.0
    before = np.array([np.sin(600.0 * t), np.sin(600.0 * t)])
    after = np.array([1.1 * np.sin(600.0 * t), 0.0 * t])
    assert _relative_difference(before, after, (30.0, 800.0), 3) == pytest.approx(100.0 / 11.0, rel=1e-6)
    assert _relative_difference(before, 0.0 * after, (30.0, 800.0), 3) == 0.0


def test_a_set_of_a_few_kinds_has_as_many_controls_as_other_cases():
    plans = plan_cases(3, load_effects(), only={"bilinear_clip", "pad"})
    others = [p for p in plans if p.stratum != "control"]
    assert {k for p in others for k, _ in p.effects} == {"bilinear_clip", "pad"}
    assert len(plans) == 2 * len(others) and "control" not in {p.stratum for p in others}
    assert len({p.stratum == "control" for p in plans[:8]}) == 2  # both are among the first ones
