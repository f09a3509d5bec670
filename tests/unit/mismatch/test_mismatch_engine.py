"""The engine on systems whose answer is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.residual_attribution import attribute
from turnout.physics import Parameter


class Line(Case):
    """y = a x + b x² + noise at conditions of different reach; candidates add powers of x."""

    def __init__(self, true, seed=0, slope_sd=1.0, powers=(2, 3), noise=0.05):
        rng = np.random.default_rng(seed)
        self.x = {f"reach {r}": np.linspace(-r, r, 60) for r in (1.0, 1.5, 2.0, 3.0)}
        data = {n: true(x) + noise * rng.normal(size=x.size) for n, x in self.x.items()}
        made = [Observation(n, n, y, noise) for n, y in data.items()]
        self.observations, self.reserved = tuple(made[:3]), tuple(made[3:])
        self.nuisances = (Nuisance("slope", "-", 1.0, slope_sd), Nuisance("level", "-", 0.0, 1.0))
        parameter = Parameter("amount", "-", 0.0, (-2.0, 2.0), "share of a power", "made up 2026")
        self.candidates = tuple(
            Candidate.of(f"power_{p}", (parameter,), lambda psi, p=p: (p, psi["amount"]), ((0.3,),)) for p in powers
        )

    def predict(self, values, terms, observations):
        found = []
        for o in observations:
            x = self.x[o.name]
            found.append(values["level"] + values["slope"] * x + sum(a * x**p for p, a in terms))
        return found


def test_a_linear_problem_is_solved_as_by_the_normal_equations():
    case = Line(lambda x: 1.4 * x + 0.2, powers=())
    fit = fit_jointly(case)
    x = np.concatenate([case.x[o.name] for o in case.observations])
    y = np.concatenate([o.data for o in case.observations])
    rows = np.column_stack([x, np.ones(x.size)]) / 0.05
    normal = rows.T @ rows / max(1.0, *fit.level.values()) + np.eye(2)
    right = rows.T @ y / 0.05 / max(1.0, *fit.level.values()) + np.array([1.0, 0.0])
    assert [fit.values["slope"], fit.values["level"]] == pytest.approx(list(np.linalg.solve(normal, right)), rel=1e-6)
    assert fit.covariance == pytest.approx(np.linalg.inv(normal), rel=1e-4)


def test_the_held_out_density_is_that_of_the_marginal_normal():
    """One condition left out, its own offset free under a prior: the density is written down directly."""
    case = Line(lambda x: x, powers=())
    case.nuisances = (Nuisance("slope", "-", 1.0, 0.3), Nuisance("level", "-", 0.0, 0.5))
    fit = fit_jointly(case)
    found = held_out_score(case, fit)["reach 2.0"]
    kept = [o for o in case.observations if o.name != "reach 2.0"]
    out = next(o for o in case.observations if o.name == "reach 2.0")
    basis = lambda o: np.column_stack([case.x[o.name], np.ones(o.data.size)])  # noqa: E731
    rows, y = np.concatenate([basis(o) for o in kept]), np.concatenate([o.data for o in kept])
    scale = (
        np.mean([np.mean((o.data - p) ** 2) for o, p in zip(case.observations, fit.predictions) if o in kept]) / 0.05**2
    )
    noise = 0.05**2 * max(1.0, scale)
    prior = np.diag([1 / 0.09, 1 / 0.25])
    posterior = np.linalg.inv(rows.T @ rows / noise + prior)
    mean = posterior @ (rows.T @ y / noise + prior @ [1.0, 0.0])
    covariance = noise * np.eye(out.data.size) + basis(out) @ posterior @ basis(out).T
    missed = out.data - basis(out) @ mean
    direct = -0.5 * (missed @ np.linalg.solve(covariance, missed) + np.linalg.slogdet(2 * np.pi * covariance)[1])
    assert found == pytest.approx(direct, abs=1e-3)


def test_without_a_missing_effect_there_is_no_name():
    answers = [diagnose(Line(lambda x: 1.2 * x + 0.1, seed=s)).verdict.answer for s in range(12)]
    assert answers == ["none"] * 12  # 12 of 12; an upper 95 % limit of 22 % false alarms for this example


def test_a_missing_square_is_named_with_an_interval_that_covers_it():
    covered = 0
    for seed in range(12):
        found = diagnose(Line(lambda x: 1.2 * x + 0.4 * x**2, seed=seed))
        assert found.verdict.answer == "named" and found.names == ("power_2",)
        covered += abs(found.fit.psi[0] - 0.4) < 1.96 * found.fit.psi_se[0]
    assert covered >= 9  # of 12 at 95 %: fewer has a chance of 0.2 %


def test_without_the_right_power_the_answer_is_unknown():
    found = diagnose(Line(lambda x: 1.2 * x + 0.6 * np.abs(x) ** 1.5, powers=(3,)))
    assert found.verdict.answer == "unknown"


def test_an_effect_that_the_base_absorbs_is_found_by_the_joint_fit_alone():
    """On x > 0 a square is similar to a steeper line. The residual of the fitted base model hardly shows it."""
    case = Line(lambda x: x + 0.3 * np.tanh(2.0 * x), powers=())
    case.x = {n: np.linspace(0.8, 2.0, 60) + 0.1 * k for k, n in enumerate(case.x)}
    rng = np.random.default_rng(5)
    step = lambda x: 0.5 * np.tanh(3.0 * (x - 1.2))  # noqa: E731
    data = {n: x + step(x) + 0.05 * rng.normal(size=x.size) for n, x in case.x.items()}
    made = tuple(Observation(n, n, y, 0.05) for n, y in data.items())
    case.observations, case.reserved = made, ()
    case.nuisances = (Nuisance("slope", "-", 1.0, 0.5), Nuisance("level", "-", 0.0, 1.0))
    base = fit_jointly(case)
    assert base.values["slope"] > 1.2  # the base model has absorbed it
    parameter = Parameter("amount", "-", 0.0, (-2.0, 2.0), "size of the step", "made up 2026")
    candidate = Candidate.of("step", (parameter,), lambda psi: psi["amount"], ((0.4,),), from_base=False)
    predict = case.predict
    case.predict = lambda v, terms, obs: [
        p + sum(terms) * np.tanh(3.0 * (case.x[o.name] - 1.2)) for o, p in zip(obs, predict(v, (), obs))
    ]
    case.candidates = (candidate,)
    r, c = np.concatenate(base.residuals), np.concatenate([np.tanh(3.0 * (case.x[o.name] - 1.2)) for o in made])
    naive = float(r @ c / (c @ c))  # the size from a regression of the residual of the base model on the effect
    found = diagnose(case)
    assert naive < 0.5 * 0.5  # less than half of it is left in the residual
    assert found.names == ("step",)
    assert found.fit.psi[0] == pytest.approx(0.5, abs=3.0 * found.fit.psi_se[0])
    assert abs(found.fit.values["slope"] - 1.0) < 0.1


def test_frames_are_reported_only_if_one_level_is_unusual():
    rng = np.random.default_rng(2)
    labels = {
        "sensor": np.array([f"S{k % 4}" for k in range(320)], dtype=object),
        "wheel": np.array([f"axle {k // 4 % 8}" for k in range(320)], dtype=object),
    }
    energy = rng.normal(size=320) + 1.5 * (labels["wheel"] == "axle 3")
    frames = attribute(energy, labels)
    assert (frames[0].frame, frames[0].level) == ("wheel", "axle 3") and frames[0].q < 0.01
    assert frames[0].effect == pytest.approx(1.5 * 10.0 / np.log(10.0), abs=1.5)
    quiet = [attribute(np.random.default_rng(s).normal(size=320), labels) for s in range(40)]
    called = sum(any(f.q < 0.05 for f in frames) for frames in quiet)
    assert called <= 6  # 5 % of 40 is 2; more than 6 has a chance of 0.3 %


def test_a_large_numerical_error_gives_the_answer_numerics():
    class Coarse(Line):
        def numerical_error(self, fit):
            return [0.35 * self.x[o.name] ** 2 for o in self.observations]

    found = diagnose(Coarse(lambda x: 1.2 * x + 0.4 * x**2))
    assert found.verdict.answer == "numerics" and not found.names


def test_a_stored_fit_is_not_computed_again():
    store, calls = {}, []
    case = Line(lambda x: 1.2 * x + 0.4 * x**2)
    predict = case.predict
    first = diagnose(case, store=store)
    case.predict = lambda *a: (calls.append(1), predict(*a))[1]
    again = diagnose(case, MismatchSettings(), store=store)
    assert again.verdict == first.verdict or again.names == first.names
    assert len(calls) < 16  # the verification alone, and its error by each of three fitted recordings


def test_errors_of_another_generator_are_no_effect_if_they_are_integrated_out():
    """Controls from the own simulation are too optimistic. A smooth error of another simulation, one for each
    recording, has the name of an effect if the noise counts as independent, and not if the error is a mode."""

    def foreign(seed, modes):
        case = Line(lambda x: 1.2 * x + 0.1, seed=seed, slope_sd=0.05)
        rng = np.random.default_rng([seed, 1])
        made = []
        for o in (*case.observations, *case.reserved):
            x = case.x[o.name]
            shapes = 0.3 * np.column_stack([x**2, x**3]) / np.abs(x).max() ** 2
            error = shapes @ rng.normal(size=2)
            made.append(Observation(o.name, o.condition, o.data + error, 0.05, modes=shapes if modes else None))
        case.observations, case.reserved = tuple(made[:3]), tuple(made[3:])
        return diagnose(case).verdict.answer

    ignored = [foreign(seed, modes=False) for seed in range(8)]
    known = [foreign(seed, modes=True) for seed in range(8)]
    assert ignored.count("none") == 0  # all controls have false alarms
    assert known.count("none") == 8


def test_whitening_gives_unit_variance_to_the_modelled_noise():
    rng = np.random.default_rng(3)
    modes = rng.normal(size=(40, 5))
    o = Observation("a", "a", np.zeros(40), 0.3, modes=modes)
    drawn = np.array([modes @ rng.normal(size=5) + 0.3 * rng.normal(size=40) for _ in range(400)])
    white = o.whiten(drawn.T)
    # 16000 numbers of variance 1: the mean square scatters by sqrt(2 / 16000) = 1.1 %
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.045)
    assert o.whiten(drawn[0]) == pytest.approx(white[:, 0])


class Offset(Line):
    """A sensor with an offset on x in 1 to 2; ``known`` states whether the model has that nuisance."""

    def __init__(self, seed, known):
        super().__init__(lambda x: x, seed, powers=(2, 3))
        rng = np.random.default_rng(seed)
        self.x = {n: 1.0 + 0.1 * k + np.linspace(0.0, 1.0, 60) for k, n in enumerate(self.x)}
        data = {n: 1.2 * x + 0.5 + 0.01 * rng.normal(size=x.size) for n, x in self.x.items()}
        made = [Observation(n, n, y, 0.01) for n, y in data.items()]
        self.observations, self.reserved = tuple(made[:3]), tuple(made[3:])
        if not known:
            self.nuisances = self.nuisances[:1]

    def predict(self, values, terms, observations):
        return super().predict({"level": 0.0, **values}, terms, observations)


def test_a_missing_nuisance_appears_as_an_effect_and_a_modelled_one_does_not():
    """An offset that the model lacks looks like a curved effect; with a free offset no effect is missing."""
    forgotten = [diagnose(Offset(seed, known=False)) for seed in range(6)]
    known = [diagnose(Offset(seed, known=True)).verdict.answer for seed in range(6)]
    best = [max(d.scores, key=lambda s: s.gain) for d in forgotten]
    assert all(b.gain > MismatchSettings().threshold for b in best)  # each one is a false finding
    assert known == ["none"] * 6


def test_two_effects_that_agree_in_one_condition_are_distinguished_by_another():
    """Held-out data must have another condition. x|x| agrees with x³ on one range with another slope; on further
    ranges it does not, although there are no more data."""

    def margin(reaches, seed):
        case = Line(lambda x: x + 0.1 * x**3, seed, powers=(3,), noise=0.08)
        rng = np.random.default_rng(seed)
        case.x = {f"part {k}": np.linspace(-r, r, 60) for k, r in enumerate(reaches)}
        data = {n: x + 0.1 * x**3 + 0.08 * rng.normal(size=x.size) for n, x in case.x.items()}
        case.observations, case.reserved = tuple(Observation(n, n, y, 0.08) for n, y in data.items()), ()
        parameter = Parameter("amount", "-", 0.0, (-2.0, 2.0), "share of an effect", "made up 2026")
        square = Candidate.of("signed_square", (parameter,), lambda psi: ("square", psi["amount"]), ((0.3,),))
        case.candidates = (*case.candidates, square)
        law = {3: lambda x: x**3, "square": lambda x: x * np.abs(x)}
        case.predict = lambda v, terms, obs: [
            v["level"] + v["slope"] * case.x[o.name] + sum(a * law[p](case.x[o.name]) for p, a in terms) for o in obs
        ]
        gain = {s.family: s.gain for s in diagnose(case).scores}
        return gain["power_3"] - gain["signed_square"]

    required = MismatchSettings().margin
    same = [margin((1.5, 1.5, 1.5), seed) for seed in range(6)]
    other = [margin((0.5, 1.5, 3.0), seed) for seed in range(6)]
    assert max(np.abs(same)) < required  # cannot tell
    assert min(other) > required


def test_the_error_of_a_size_includes_the_model_error_of_its_effect():
    case = Line(lambda x: x + 0.4 * x**2)
    strict = case.candidates[0]
    fit = fit_jointly(case, (strict,), np.array([0.3]))
    loose = fit.with_candidates((replace(strict, effect=replace(strict.effect, model_error_share=0.15)),))
    assert np.allclose(loose.psi_se**2, fit.psi_se**2 + (0.15 * fit.psi) ** 2, atol=0.0, rtol=1e-12)


def test_further_parameters_have_model_errors_of_their_own():
    case = Line(lambda x: x + 0.4 * x**2)
    strict, fit = case.candidates[0], fit_jointly(case, (case.candidates[0],), np.array([0.3]))
    (size,) = strict.parameters
    length = replace(size, name="length", neutral=0.6, model_error_share=0.2)
    effect = replace(strict.effect, parameters=(size, length), model_error_share=0.15)
    several = replace(
        fit, values={}, candidates=(replace(strict, effect=effect), strict), psi=np.array([0.3, 0.5, 0.4]),
        covariance=np.diag([1e-4, 4e-4, 9e-4]),
    )  # fmt: skip
    expected = [1e-4 + (0.15 * 0.3) ** 2, 4e-4 + (0.2 * 0.5) ** 2, 9e-4]
    assert np.allclose(several.psi_se**2, expected, atol=0.0, rtol=1e-12)


@pytest.mark.parametrize("n", [100, 200])  # with one dense matrix, and with the modes
def test_modes_in_single_precision_whiten_as_in_double(n):
    rng = np.random.default_rng(4)
    modes, sigma = 30.0 * rng.normal(size=(n, 40)), rng.uniform(0.5, 2.0, n)
    x = rng.normal(size=(n, 3)) + modes @ rng.normal(size=(40, 3))
    exact = np.linalg.solve(np.diag(sigma**2) + modes @ modes.T, x)  # x' C^-1 x is the square of what is whitened
    for kind, close in ((np.float64, 1e-9), (np.float32, 1e-3)):  # a mode of 400 sigma leaves 1e-6 of 400, 200 times
        o = Observation("a", "a", np.zeros(n), sigma, modes=modes.astype(kind))
        white = o.whiten(x)
        assert white.T @ white == pytest.approx(x.T @ exact, rel=close, abs=200 * close)
