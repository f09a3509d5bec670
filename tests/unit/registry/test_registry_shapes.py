"""Modes are tracked by their shape at two responses if a section has a second response."""

from datetime import date, timedelta

import numpy as np
import pytest

N_CAMPAIGN, N_IMPACT, SE = 24, 10, 0.05
SWAPPED = (9, 14, 15, 20, 23)  # campaigns in which the other mode is identified as this one
# two crossing modes of equal damping; the second sensor is in phase in the first mode and out of phase in the other
FREQUENCY = np.linspace([150.0, 162.0], [165.0, 155.0], N_CAMPAIGN)
RATIO = np.array([0.8 + 0.1j, -0.7 + 0.2j])
COVARIANCE = SE**2 * np.array([[1.0, 0.3], [0.3, 1.5]])


def campaign_of(hammer, k, section="A1", shape=None, **values):
    day = (date(2024, 1, 10) + timedelta(days=30 * k)).isoformat()
    if shape is not None:
        values |= {
            "shape_ratio": [shape.real, shape.imag], "shape_covariance": COVARIANCE[[0, 0, 1], [0, 1, 1]].tolist(),
            "n_shape": N_IMPACT,
        }  # fmt: skip
    return hammer(section=section, day=day, file=day, frequency_se_hz=0.5, damping_se=0.004, **values)


def crossing(hammer, rng, has_second, swapped=SWAPPED, section="A1"):
    """Campaigns of one section; both modes have c1² + c2² near 1."""
    for k in range(N_CAMPAIGN):
        m = int(k in swapped)
        noise = rng.multivariate_normal([0.0, 0.0], COVARIANCE)
        yield campaign_of(
            hammer, k, section, RATIO[m] + complex(*noise) if has_second else None,
            frequency=FREQUENCY[k, m] + 0.5 * rng.standard_normal(),
            damping_ratio=0.05 + 0.004 * rng.standard_normal(), c_block=[0.0, 1.0 + 0.1 * rng.standard_normal()],
        )  # fmt: skip


def listed(bench, section="A1"):
    days = bench.ask(f"select measured_at_utc from modes_off_track where section_id = 't1/{section}'")
    return [(day.date() - date(2024, 1, 10)).days // 30 for (day,) in days]


def test_swapped_crossing_modes_are_found_by_shape_and_not_by_frequency(bench, hammer):
    """Both frequencies are within the range of the history, so only the shape distinguishes the two modes."""
    frequency_only = crossing(hammer, np.random.default_rng(1), has_second=False, section="A1")
    both = crossing(hammer, np.random.default_rng(1), has_second=True, section="A2")
    bench.register(*frequency_only, *both)
    assert not set(listed(bench, "A1")) & set(SWAPPED)
    assert listed(bench, "A2") == sorted({*listed(bench, "A1"), *SWAPPED})
    assert bench.ask("select count(*) from modes_off_track where section_id = 't1/A1' and shape_mac is not null") == [
        (0,)
    ]


def test_the_history_of_a_mode_is_robust_to_another_mode_in_a_third_of_its_campaigns(bench, hammer):
    """Seven of the first 20 campaigns: quartiles would include both modes, the median deviation only one."""
    swapped = (1, 3, 6, 9, 12, 15, 18, 23)
    bench.register(*crossing(hammer, np.random.default_rng(4), has_second=True, swapped=swapped))
    assert 23 in listed(bench) and set(listed(bench)) <= set(swapped)


def test_no_campaign_of_an_intact_section_is_listed_by_its_shape(bench, hammer):
    """40 sections with five or more earlier campaigns: no shape is far from its history."""
    rng = np.random.default_rng(2)
    sections = [f"A{k}" for k in range(1, 41)]
    bench.register(*(c for s in sections for c in crossing(hammer, rng, has_second=True, swapped=(), section=s)))
    assert bench.ask("select count(*) from modes_off_track where shape_distance > 5.0") == [(0,)]


def test_the_distance_is_that_of_hotellings_t2(bench, hammer):
    """By numpy: T² with the covariance of the campaign and the median deviation of the history."""
    from scipy.stats import chi2, f

    rng = np.random.default_rng(3)
    shapes = RATIO[0] + 0.02 * (rng.standard_normal(7) + 1j * rng.standard_normal(7))
    shapes[-1] = 0.4 + 0.9j
    campaigns = [campaign_of(hammer, k, shape=s, damping_ratio=0.1) for k, s in enumerate(shapes)]
    bench.register(*campaigns[:-1], campaign_of(hammer, 6, shape=shapes[-1], frequency=190.0, damping_ratio=0.1))
    ((mac, distance),) = bench.ask("select shape_mac, shape_distance from modes_off_track")
    parts = np.stack([shapes[:-1].real, shapes[:-1].imag])
    track = np.median(parts, axis=1)
    sd = 1.4826 * np.median(np.abs(parts - track[:, None]), axis=1)
    difference = np.array([shapes[-1].real, shapes[-1].imag]) - track
    t2 = difference @ np.linalg.solve(COVARIANCE + np.diag(sd**2), difference)
    freedom = N_IMPACT - 1
    probability = f.sf(t2 * (freedom - 1) / (2 * freedom), 2, freedom - 1)
    assert distance == pytest.approx(np.sqrt(chi2.isf(probability, 2)), rel=1e-6)
    one, two = np.array([1.0, shapes[-1]]), np.array([1.0, complex(*track)])
    expected = abs(np.vdot(one, two)) ** 2 / np.vdot(one, one).real / np.vdot(two, two).real
    assert mac == pytest.approx(expected)


def test_four_earlier_shapes_are_too_few_for_a_history(bench, hammer):
    """The section got its second sensor late: frequency and damping have a history, the shape has none."""
    earlier = [campaign_of(hammer, k, shape=RATIO[0] if k > 1 else None, damping_ratio=0.1) for k in range(6)]
    bench.register(*earlier, campaign_of(hammer, 6, shape=RATIO[1], frequency=190.0, damping_ratio=0.1))
    assert bench.ask("select shape_mac, shape_distance, n_history from modes_off_track") == [(None, None, 6)]
