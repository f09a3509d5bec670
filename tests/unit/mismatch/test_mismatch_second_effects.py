"""Second effects: the residual of an exact effect is another effect, that of an approximate one may be its shape."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout.mismatch import diagnose
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import is_same_site
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.channel_levels import is_lone_excess, worst_channel_excess
from turnout.mismatch.engine.cross_validation import signature_overlap, single_type_estimate
from turnout.mismatch.engine.evidence import explained_share, score_of
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.second_effect import add_second
from turnout.mismatch.engine.verdict import Verdict
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.physics import Parameter

AMOUNT = (Parameter("amount", "-", 0.0, (-400.0, 400.0), "share of a shape", "made up 2026"),)
X = np.linspace(0.0, 1.0, 400)
SHAPES = {"wave": np.sin(9.0 * X), "ramp": X - 0.5}


class Shapes(Case):
    """A wave of 200 with a ramp of 0.28 beneath it, noise of 0.1."""

    def __init__(self, exact):
        data = 200.0 * SHAPES["wave"] + 0.28 * SHAPES["ramp"] + 0.1 * np.random.default_rng(6).normal(size=X.size)
        self.observations = (Observation("all", "all", data, np.full(X.size, 0.1)),)
        starts = (100.0,), (0.3,)
        self.candidates = tuple(
            Candidate.of(n, AMOUNT, lambda p, n=n: (n, p["amount"]), starts, {"shape": n}, exact=exact) for n in SHAPES
        )

    def predict(self, values, terms, observations):
        return [sum((a * SHAPES[n] for n, a in terms), np.zeros(X.size))]


@pytest.mark.parametrize("exact, names", [(True, ("wave", "ramp")), (False, ("wave",))])
def test_a_second_effect_needs_a_share_of_the_first_only_if_the_shape_of_that_is_uncertain(exact, names):
    """The ramp is worth 200 ln(1 + 2.8^2 / 12) = 100 nats, the wave 200 ln(2000^2 / 3.3) = 2,800: 28 times as many."""
    assert diagnose(Shapes(exact)).names == names


class Spread(Shapes):
    """Wave and ramp of four times the energy, for four times the samples, each spread evenly over the ``cells``
    (recording, sensor) in which it shows."""

    is_large = True

    def __init__(self, **cells):
        super().__init__(False)
        self.cells, rng = {n: set(c.split()) for n, c in cells.items()}, np.random.default_rng(6)
        frame = np.repeat([0, 1], X.size)
        self.observations = tuple(
            Observation(
                o,
                o,
                y + 0.1 * rng.normal(size=y.size),
                0.1,
                cells=frame,
                labels={"sensor": np.array(["A", "B"])},
                rows=2,
            )
            for o, y in ((o, self.sum_of(o, (("wave", 400.0), ("ramp", 0.56)))) for o in "12")
        )

    def sum_of(self, o, terms):
        rows = [
            sum((a * SHAPES[n] / np.sqrt(len(self.cells[n])) for n, a in terms if o + s in self.cells[n]), 0.0 * X)
            for s in "AB"
        ]
        return np.concatenate(rows)

    def predict(self, values, terms, observations):
        return [self.sum_of(o.name, terms) for o in observations]


@pytest.mark.parametrize(
    ("wave", "ramp", "alike", "names"),
    [
        ("1A", "1A", 1.0, 1),
        ("1A", "1B", 0.0, 2),  # another sensor
        ("1A 1B", "2A 2B", 0.0, 2),  # other recordings
        ("1A", "1A 1B 2A 2B", 0.5, 2),  # the residual of a mounting is in its own channel
        ("1A 1B 2A 2B", "2B", 0.5, 2),  # the residual of an effect of the track is in all channels
        ("1A 1B 2A", "1A 1B 2A 2B", 0.866, 1),
        ("1A 1B 2A 2B", "1A 1B 2A 2B", 1.0, 1),
    ],
)
def test_a_residual_in_other_cells_is_not_the_shape_of_the_first_effect(wave, ramp, alike, names):
    """The ramp has a 28th of the evidence of the wave: below a twentieth, above 0.71 of a twentieth. Equal shares on n
    and m samples, k of them common, have a similarity of k over the root of n m."""
    case = Spread(wave=wave, ramp=ramp)
    assert len(diagnose(case).names) == names
    fit = fit_jointly(case, case.candidates, [100.0, 0.3])
    assert signature_overlap(case, fit, *case.candidates) == pytest.approx(alike, abs=1e-3)


def test_a_gain_is_tested_beside_a_lag_of_the_same_channel_and_a_mounting_is_not():
    case = TrackCase(measured_campaign(small_plan((15.0,), hammer_positions=(24.0,), passages=False), (), 7))
    of = {c.family: c for c in case.candidates if c.where.get("sensor") == "S2"}
    assert not is_same_site(of["sensor_gain"], of["time_offset"])
    assert is_same_site(of["mount_resonance"], of["time_offset"]) and is_same_site(of["sensor_gain"], of["sensor_gain"])


def with_whites(case, base, candidate, size, share):
    """A fit that is 90 nats better, with a candidate of this size and residuals times the ``share`` of their name or
    kind."""
    white = [share.get(o.name, share[o.data_type]) * np.asarray(w) for o, w in zip(case.observations, base.white)]
    found = replace(base, candidates=(candidate,), psi=np.array([size]), white=white, evidence=base.evidence + 90.0)
    return replace(found, covariance=np.eye(len(base.values) + 1))


@pytest.fixture(scope="module")
def passages_and_impacts():
    case = TrackCase(intact_campaign((24.0,), 7))
    return case, fit_jointly(case, iterations=0)


@pytest.mark.parametrize(("kind", "material"), [("hammer", False), ("passage", True)])
def test_friction_is_identified_by_trains(passages_and_impacts, kind, material):
    """In impacts it acts as a damper: without a gain in passages it has no name, for any gain in impacts."""
    case, base = passages_and_impacts
    assert {c.naming.required_data_type for c in case.candidates if c.family == "dry_friction"} == {"passage"}
    friction = next(c for c in case.candidates if c.family == "dry_friction")
    better = with_whites(case, base, friction, 3000.0, {"hammer": 1.0, "passage": 1.0, kind: 0.5})
    assert bool(score_of(Search(case), base, better, friction).is_reportable) == material


class SensorGainCase(Case):
    """Four impacts and four trains that a sensor records with its own gains, noise of 0.1. The gain is known to 2 %,
    and a support, known to 10 %, adds a ramp to impacts."""

    def __init__(self, impacts, trains):
        rng = np.random.default_rng(9)
        gains = [("hammer", impacts)] * 4 + [("passage", trains)] * 4
        self.observations = tuple(
            Observation(
                f"{kind} {k}", f"day {k}", g * self.shape(k) + 0.1 * rng.normal(size=X.size), 0.1, data_type=kind
            )
            for k, (kind, g) in enumerate(gains)
        )
        self.nuisances = (Nuisance("gain_A", "-", 0.0, 0.02), Nuisance("support", "-", 0.0, 0.1))
        hammer = tuple(o.name for o in self.observations if o.data_type == "hammer")
        gain = (Parameter("gain", "-", 1.0, (-3.0, 3.0), "shown over true", "made up 2026", (1.0, 0.3)),)
        self.candidates = (
            Candidate.of(
                "sensor_gain",
                gain,
                lambda p: p["gain"],
                ((0.8,), (1.25,)),
                {"sensor": "A"},
                must_not_oppose=hammer,
                smallest_reportable=0.04,
                masking_parameter="gain_A",
                masking_sd=0.3,
                from_masking=lambda g: 1.0 + g,
            ),
        )

    def shape(self, k):
        return np.sin((9.0 + 2.0 * k) * X)

    def predict(self, values, terms, observations):
        """Gain times shape and ramp."""
        whole = (1.0 + values["gain_A"]) * np.prod([1.0, *terms])
        ramps = [values["support"] * (o.data_type == "hammer") * SHAPES["ramp"] for o in observations]
        return [whole * (self.shape(int(o.name.split()[1])) + ramp) for o, ramp in zip(observations, ramps)]


@pytest.mark.parametrize("gain", [0.76, 1.25, -1.0])
def test_impacts_alone_test_a_gain_against_its_own_estimate(gain):
    """Trains show no gain. With a prior of 0.02 the fit to both is in between; the estimate by impacts alone is their
    own value, reduced by the prior of 0.3: by a hundredth, and more if the residual and thus the noise is large."""
    case = SensorGainCase(gain, 1.0)
    fit = fit_jointly(case, iterations=30)
    error = 0.1 / np.sqrt(4 * X.size * 0.5)
    assert single_type_estimate(case, fit, "hammer", "gain_A", 0.3) == pytest.approx(
        gain - 1.0, abs=4.0 * error, rel=0.03
    )
    assert single_type_estimate(case, fit, "passage", "gain_A", 0.3) == pytest.approx(0.0, abs=4.0 * error)


@pytest.mark.parametrize(
    ("impacts", "trains", "material"), [(0.76, 0.76, True), (-1.0, -1.0, True), (1.0, 0.76, False)]
)
def test_a_gain_that_impacts_contradict_has_no_name(impacts, trains, material):
    """Ballast that softens under trains raises the level of a sensor in trains alone. A gain in both has its name,
    although the fit without it moved the gain to the end of its tolerance and explains impacts as well."""
    case = SensorGainCase(impacts, trains)
    (gain,), base = case.candidates, fit_jointly(case)
    refit = fit_jointly(case, (gain,), [trains])
    assert bool(score_of(Search(case), base, refit, gain).is_reportable) == material


def test_only_impacts_that_a_sensor_recorded_may_contradict_its_gain(passages_and_impacts):
    case, _ = passages_and_impacts
    gains = [c for c in case.candidates if c.family == "sensor_gain"]
    assert any(c.naming.must_not_oppose for c in gains)
    assert all(case.frf_pairs[name].channel == c.where["sensor"] for c in gains for name in c.naming.must_not_oppose)


class Passages(Case):
    """Passages with white residuals of the given mean squares over sensors A and B; level 2."""

    cell_level = {"passage": 2.0}

    def __init__(self, *mean_squares):
        self.observations = tuple(
            Observation(
                str(k), str(k), np.repeat(np.sqrt(row), 50), np.ones(100), data_type="passage",
                cells=np.repeat([0, 1], 50), labels={"sensor": np.array(["A", "B"])}, rows=2,
            )
            for k, row in enumerate(mean_squares)
        )  # fmt: skip

    def predict(self, values, terms, observations):
        return [np.zeros(100) for _ in observations]


@pytest.mark.parametrize(
    ("mean_squares", "is_lone"),
    [
        (((2.3, 0.3), (0.5, 0.4), (1.9, 0.2)), True),
        (((1.9, 0.3), (0.5, 0.4), (1.9, 0.2)), False),  # nothing is above the level
        (((2.3, 0.3), (2.1, 0.4), (0.5, 0.2), (0.5, 0.2)), False),  # A has an excess in two passages: track or sensor
        (((2.3, 2.1), (0.5, 0.4), (0.5, 0.2)), False),  # both sensors have an excess in one passage: a wheel
        (((2.3, 0.3), (0.5, 0.4)), False),  # one other passage is too few to compare with
    ],
)
def test_an_excess_of_one_channel_in_one_recording_is_attributed_to_the_recording(mean_squares, is_lone):
    case = Passages(*mean_squares)
    white = [o.data for o in case.observations]
    assert is_lone_excess(case, SimpleNamespace(white=white)) is is_lone
    assert worst_channel_excess(case, SimpleNamespace(white=white)) == pytest.approx(0.5 * np.max(mean_squares))


@pytest.mark.parametrize(
    ("mean_squares", "where", "gained_there", "share"),
    [
        (((9.2, 2.3), (0.5, 0.4), (1.9, 0.2)), {"sensor": "A"}, 0.0, 1.0),  # one recording alone need not be explained
        (((9.2, 2.3), (0.5, 0.4), (1.9, 0.2)), {"train": "t"}, 0.0, 0.0),  # a train may be in that recording alone
        (((9.2, 2.3), (0.5, 0.4), (1.9, 0.2)), {"sensor": "A"}, 9.0, 0.04),  # most of the evidence is in that recording
        (((9.2, 0.3), (2.4, 0.4), (1.9, 0.2)), {"sensor": "A"}, 0.0, 0.0),  # two recordings show it
        (((9.2, 0.3), (0.5, 0.4)), {"sensor": "A"}, 0.0, 0.0),  # one other passage is too few to compare with
    ],
)
def test_a_name_of_track_or_sensor_need_not_explain_an_excess_of_one_recording(
    mean_squares, where, gained_there, share
):
    """Wheels that lose contact at a nose raise the level of one fast passage. Formerly a sensor with a shift of 13 cm
    and 14 nats lost its name by that."""
    case = Passages(*mean_squares)
    white = [o.data for o in case.observations]
    rest = [white[0] * np.sqrt(1.0 - 2.0 * gained_there / np.sum(white[0] ** 2)), *white[1:]]
    common = {"level": {"passage": 0.3}, "scale": {"passage": 1.0}}
    fit = SimpleNamespace(white=white, evidence=0.0, candidates=(), **common)
    refit = SimpleNamespace(white=rest, evidence=20.0, candidates=(SimpleNamespace(where=where),), **common)
    assert explained_share(Search(case), fit, refit) == pytest.approx(share, abs=0.01)


def test_beside_a_name_an_excess_of_one_recording_is_no_second_effect():
    case = Passages((2.3, 0.3), (0.5, 0.4), (1.9, 0.2))
    fit = SimpleNamespace(white=[o.data for o in case.observations], level={"passage": 0.3}, candidates=())
    score = SimpleNamespace(family="wave", gain=60.0)
    first, second = (
        Verdict("named", ("wave",), "B", 0.97, {}, (score,)),
        Verdict("unknown", (), reason="the residual is above the control level", trail=("excess_without_candidate",)),
    )
    found, stands = add_second(Findings(Search(case), fit, fit, (first,)), second, None)
    assert not stands and found.verdicts[0].reason == "" and found.verdicts[0].trail[-1] == "excess_of_one_recording"
