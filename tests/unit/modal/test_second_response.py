"""Both responses of a test together determine its modes with the Cramér-Rao bound of both."""

import numpy as np
import pytest

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import cramer_rao_bound, identify
from turnout.modal.poles import continuous_pole

RATE, N, N_IMPACT, NOISE = 20e3, 600, 10, 0.02
SETTINGS = IdentifySettings(null_draws=10)
FREQUENCY, DAMPING = np.array([99.0, 616.0]), np.array([0.25, 0.06])
TRUTH = np.stack([np.log(FREQUENCY), DAMPING], axis=1)
# the second sensor lies on the sleeper: it moves more with the ballast mode, less with the mode of the rail
FIRST, SECOND = np.array([1.0, 3.0 + 1.0j]), np.array([1.5 + 0.5j, 0.8j])


def clean(amplitude):
    wave = np.exp(continuous_pole(FREQUENCY, DAMPING)[:, None] * np.arange(N) / RATE)
    return (amplitude[:, None] * wave).real.sum(axis=0)


def responses(rng):
    """Decays (N_IMPACT, N) of both sensors for impacts of different size, white noise."""
    size = 1.0 + 0.1 * rng.standard_normal((N_IMPACT, 1))
    return [size * clean(a) + NOISE * rng.standard_normal((N_IMPACT, N)) for a in (FIRST, SECOND)]


def error(model):
    return np.array([[np.log(m.frequency), m.damping] for m in model.modes]) - TRUTH


def test_two_responses_reach_their_common_bound():
    """50 tests: an rms is known to 10 %, the ratio of two of the same tests too."""
    single, joint = [], []
    for k in range(50):
        first, second = responses(np.random.default_rng([38, k]))
        single.append(error(identify(list(first), RATE, SETTINGS)))
        joint.append(error(identify(list(first), RATE, SETTINGS, second=list(second))))
    rms_single, rms_joint = (np.sqrt(np.mean(np.square(e), axis=0)) for e in (single, joint))
    theta = np.repeat(TRUTH[None], N_IMPACT, axis=0)
    bounds = [
        cramer_rao_bound(theta, np.repeat(clean(a)[None], N_IMPACT, axis=0), RATE, NOISE**2) for a in (FIRST, SECOND)
    ]
    # responses are independent, so their information matrices add; of two modes this far apart the diagonals do
    both = 1.0 / np.sqrt(1.0 / bounds[0] ** 2 + 1.0 / bounds[1] ** 2)
    assert np.all((rms_joint / both > 0.7) & (rms_joint / both < 1.3)), rms_joint / both
    np.testing.assert_allclose(rms_single / rms_joint, bounds[0] / both, rtol=0.25)
    assert rms_single[0, 0] > 1.4 * rms_joint[0, 0]


def test_the_stated_bound_is_that_of_both_responses():
    first, second = responses(np.random.default_rng(1))
    alone = identify(list(first), RATE, SETTINGS)
    both = identify(list(first), RATE, SETTINGS, second=list(second))
    twice = identify(list(first), RATE, SETTINGS, second=[d + NOISE * np.sin(7.0 * np.arange(N)) for d in first])
    assert both.diagnostics["responses"] == 2 and alone.diagnostics["responses"] == 1
    assert both.modes[0].frequency_crb < 0.75 * alone.modes[0].frequency_crb
    assert twice.modes[0].frequency_crb == pytest.approx(alone.modes[0].frequency_crb / np.sqrt(2.0), rel=0.3)


def test_without_a_second_decay_of_an_impact_only_the_first_response_is_used():
    first, second = responses(np.random.default_rng(2))
    alone = identify(list(first), RATE, SETTINGS)
    short = [*second[:-1], second[-1][:50]]
    cut = identify(list(first), RATE, SETTINGS, second=short)
    assert cut.diagnostics["responses"] == 1
    assert cut.modes == alone.modes
