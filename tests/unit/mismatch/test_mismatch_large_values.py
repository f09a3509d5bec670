"""A single value far beyond its prior is found at its position, although normal priors spread it over neighbours."""

import numpy as np
import pytest
from scipy import stats

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.large_values import (
    evidence_far_from_fit,
    evidence_of_large_values,
    fit_large_values,
    with_wide_priors,
)
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.thresholds import THRESHOLDS

N, PRIOR, NOISE, WIDE = 7, 0.1, 0.1, 5.0
MIXING = np.tile([[0.75 ** abs(i - j) for j in range(N)] for i in range(9)], (6, 1))  # six recordings of nine sensors


class Springs(Case):
    """Springs in a row, each with the logarithm of its stiffness; sensors also respond to neighbours."""

    def __init__(self, truth, power=1.0, seed=1):
        rng = np.random.default_rng(seed)
        self.power = power
        bound = 6.0 * PRIOR
        self.nuisances = tuple(Nuisance(f"k{j}", "-", 0.0, PRIOR, bounds=(-bound, bound), group="k") for j in range(N))
        y = self.response(np.asarray(truth)) + NOISE * rng.normal(size=len(MIXING))
        self.observations = (Observation("o", "o", y, NOISE),)

    def response(self, x):
        return MIXING @ (x if self.power == 0.0 else np.exp(-self.power * x) - 1.0)

    def predict(self, values, terms, observations):
        return [self.response(np.array([values[f"k{j}"] for j in range(N)])) for _ in observations]


NAMES = [f"k{j}" for j in range(N)]


def base_of(case):
    search = Search.of(case)
    return search, fit_jointly(case, iterations=60)


def test_the_evidence_of_a_large_value_is_that_of_the_density_of_all_data():
    """A linear model: the ratio of the normal densities of the data with the wide and with the ordinary prior."""
    case = Springs([0.0, 0.0, -0.3, 0.1, 0.0, 0.05, 0.0], power=0.0)
    _, fit = base_of(case)
    noise = NOISE**2 * np.eye(len(MIXING))
    prior = np.full(N, PRIOR**2)

    def density(variance):
        covariance = noise + MIXING @ np.diag(variance) @ MIXING.T
        return stats.multivariate_normal(np.zeros(len(MIXING)), covariance).logpdf(case.observations[0].data)

    gains = evidence_of_large_values(case, fit, NAMES, WIDE)
    for j, name in enumerate(NAMES):
        wide = np.where(np.arange(N) == j, WIDE**2, 1.0) * prior
        assert gains[name] == pytest.approx(density(wide) - density(prior), abs=1e-6)
    assert NAMES[2] not in evidence_of_large_values(case, fit, NAMES, WIDE, ["k2"])


@pytest.mark.parametrize("size", [-1.6, 1.6])
@pytest.mark.parametrize("where", [1, 3])
def test_one_spring_with_a_fifth_or_five_times_its_stiffness_is_found_with_its_size(size, where):
    """The base fit cannot exceed its bound of six prior sd; a wide prior allows that, and neighbours stay."""
    truth = np.zeros(N)
    truth[where] = size
    case = Springs(truth)
    search, base = base_of(case)
    assert abs(base.values[f"k{where}"]) <= 0.6 + 1e-9  # the precondition of this test
    fit = fit_large_values(search, base, NAMES, WIDE)
    assert fit.evidence > base.evidence + np.log(N)
    others = [abs(fit.values[n]) for j, n in enumerate(NAMES) if j != where]
    sd = np.sqrt(fit.covariance[where, where])
    assert fit.values[f"k{where}"] == pytest.approx(size, abs=4.0 * sd + 0.1 * (size > 0.0)) and max(others) < PRIOR


@pytest.mark.parametrize(("power", "size"), [(1.0, -1.6), (-2.0, 1.6), (3.0, -1.6)])
def test_the_target_cost_of_a_start_is_below_that_of_the_starts_before_it(monkeypatch, power, size):
    """With the other powers one or two of the starts end in minima of ten times the cost, in the last case the first.

    The result is the best of all starts when they run separately.
    """
    search, base = base_of(Springs([0.0, size, 0.0, 0.0, 0.0, 0.0, 0.0], power))
    runs, fit_of_search = [], Search.fit

    def recorded(self, candidates, psi, values, *args, sought_cost=np.inf, **options):
        fit = fit_of_search(self, candidates, psi, values, *args, sought_cost=sought_cost, **options)
        runs.append((self, values, sought_cost, fit.cost))
        return fit

    monkeypatch.setattr(Search, "fit", recorded)
    best = fit_large_values(search, base, NAMES, WIDE)
    (wide, *_), starts = runs[0], runs[: 1 + len(THRESHOLDS.large_start_sds)]
    costs = [cost for *_, cost in starts]
    assert [sought for *_, sought, _ in starts] == [min(costs[:k], default=np.inf) for k in range(len(starts))]
    alone = min(fit_of_search(wide, (), np.zeros(0), values).cost for _, values, *_ in starts)
    assert best.cost == pytest.approx(alone, abs=0.01)


def test_two_large_values_are_found_in_turn():
    case = Springs([0.0, -0.9, 0.0, 0.0, 0.0, -0.8, 0.0])
    fit = fit_large_values(*base_of(case), NAMES, WIDE)
    assert [fit.values["k1"], fit.values["k5"]] == pytest.approx([-0.9, -0.8], abs=0.15)


def test_the_usual_scatter_has_no_large_value():
    """Springs with usual scatter, n = 20: the fit is the base fit itself."""
    rng = np.random.default_rng(3)
    for seed in range(20):
        search, base = base_of(Springs(PRIOR * rng.normal(size=N), seed=seed))
        assert fit_large_values(search, base, NAMES, WIDE) is base


def test_wide_priors_leave_the_case_and_the_other_values_as_they_are():
    case = Springs(np.zeros(N))
    wide = with_wide_priors(case, ["k2"], WIDE)
    assert wide.nuisances[2].sd == pytest.approx(0.5) and wide.nuisances[2].bounds == pytest.approx((-3.0, 3.0))
    assert wide.nuisances[:2] == case.nuisances[:2] and case.nuisances[2].sd == PRIOR


def test_the_partner_of_a_large_value_may_change_as_much_as_that_value():
    """sqrt(0.1² + (5 · 0.1)²) and not 5 · 0.2: the partner of a spring is a damper, with a wider prior of its own."""
    case = Springs(np.zeros(N))
    case.nuisances = tuple(Nuisance(n.name, "-", 0.0, 0.2 if n.name == "k3" else 0.1, bounds=(-0.6, 0.6), group="k")
                           for n in case.nuisances)  # fmt: skip
    wide = with_wide_priors(case, ["k2"], WIDE, {"k2": "k3", "k4": "k5"})
    assert wide.nuisances[3].sd == pytest.approx(np.hypot(0.2, 0.5))
    assert wide.nuisances[3].bounds == pytest.approx((-0.6 * np.hypot(1.0, 2.5), 0.6 * np.hypot(1.0, 2.5)))
    assert wide.nuisances[5] == case.nuisances[5]
    shared = with_wide_priors(case, ["k3", "k4"], WIDE, {"k3": "k1", "k4": "k1"})
    assert shared.nuisances[1].sd == pytest.approx(np.hypot(0.1, 1.0))  # the wider of the two
    assert with_wide_priors(case, ["k2"], WIDE, {"k2": "absent"}).nuisances[1] == case.nuisances[1]


class TwoValleys(Springs):
    """Beyond 0.6 the response of the third spring first falls, and agrees with the data only at 1.3 and more."""

    def response(self, x):
        y = np.array(x, dtype=float)
        y[2] = x[2] - 2.0 * np.exp(-0.5 * ((x[2] - 0.8) / 0.15) ** 2)
        return MIXING @ y


def test_a_large_value_behind_a_barrier_is_found_from_a_separate_start():
    truth = np.zeros(N)
    truth[2] = 1.4
    case = TwoValleys(truth)
    search, base = base_of(case)
    fit = fit_large_values(search, base, NAMES, WIDE)
    assert fit.values["k2"] == pytest.approx(1.4, abs=0.1)


class Cubes(Springs):
    """Hammer tests that show nothing of a small deviation: they respond to its cube."""

    def response(self, x):
        return MIXING @ (x if self.power == 0.0 else x**3)

    def is_hammer_test(self, observation):
        return True


@pytest.mark.parametrize("size", [-1.4, 1.4])
def test_a_large_value_of_which_a_small_deviation_shows_nothing_is_found(size):
    """The sleeper of a pad with six times its stiffness moves with the rail; twice the stiffness changes little."""
    truth = np.zeros(N)
    truth[3] = size
    case = Cubes(truth)
    search, base = base_of(case)
    assert max(evidence_of_large_values(case, base, NAMES, WIDE).values(), default=0.0) < np.log(N)  # the precondition
    fit = fit_large_values(search, base, NAMES, WIDE)
    others = [abs(fit.values[n]) for j, n in enumerate(NAMES) if j != 3]
    assert fit.values["k3"] == pytest.approx(size, abs=0.05) and max(others) < PRIOR


class Reversed(Cubes):
    """Hammer tests that respond to a small deviation with the other sign than to a large one."""

    def __init__(self, truth, slope):
        self.slope = slope
        super().__init__(truth)

    def response(self, x):
        return MIXING @ (x**3 - self.slope * x)


@pytest.mark.parametrize("slope", [0.1, 0.3])
@pytest.mark.parametrize("size", [-1.4, 1.4])
def test_a_large_value_is_sought_with_the_sign_that_it_has_where_it_is_large(size, slope):
    """The sign of the linear model led to two values of 1.15 beside it in two of these four."""
    truth = np.zeros(N)
    truth[3] = size
    fit = fit_large_values(*base_of(Reversed(truth, slope)), NAMES, WIDE)
    assert fit.values["k3"] == pytest.approx(size, abs=0.05)
    assert max(abs(fit.values[n]) for j, n in enumerate(NAMES) if j != 3) < PRIOR


def test_the_evidence_far_from_the_fit_is_that_of_the_best_fit_with_the_value_held_there():
    """A linear model, solved by least squares with the held value taken to the right-hand side."""
    case = Cubes([0.0, 0.0, 0.9, 0.1, 0.0, 0.05, 0.0], power=0.0)
    _, fit = base_of(case)
    y = case.observations[0].data / NOISE
    gains = evidence_far_from_fit(case, fit, NAMES, WIDE, ["k5"])
    assert set(gains) == set(NAMES) - {"k5"}
    sd = np.where(np.arange(N) == 5, WIDE, 1.0) * PRIOR
    stacked, right = np.vstack([MIXING / NOISE, np.diag(1.0 / sd)]), np.concatenate([y, np.zeros(N)])

    def cost(held=None, value=0.0):
        free = [j for j in range(N) if j != held]
        rest = right - (stacked[:, held] * value if held is not None else 0.0)
        rest[y.size + np.arange(N)[[j == held for j in range(N)]]] = 0.0  # its own prior is the wide one
        left = rest - stacked[:, free] @ np.linalg.lstsq(stacked[:, free], rest, rcond=None)[0]
        return left @ left + (0.0 if held is None else (value / (WIDE * PRIOR)) ** 2)

    sizes = [s * sign * WIDE * PRIOR for s in THRESHOLDS.large_start_sds for sign in (1.0, -1.0)]
    for j, name in enumerate(NAMES):
        if name != "k5":
            best = min(sizes, key=lambda size: cost(j, size))
            expected = 0.5 * (cost() - cost(j, best)) - np.log(WIDE)
            assert gains[name] == (pytest.approx(expected, abs=1e-6), pytest.approx(best))


def test_the_usual_scatter_has_no_large_value_far_from_the_fit_either():
    rng = np.random.default_rng(4)
    for seed in range(20):
        search, base = base_of(Cubes(PRIOR * rng.normal(size=N), seed=seed))
        assert fit_large_values(search, base, NAMES, WIDE) is base


def test_without_hammer_tests_there_is_no_evidence_far_from_the_fit():
    case = Springs(np.zeros(N))
    assert evidence_far_from_fit(case, base_of(case)[1], NAMES, WIDE) == {}
