"""Small cases that led to wrong statements, although every part of the statement seemed right."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout import physics
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.evidence import assess, explained_share, score_of, worst_excess
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.two_effects import settle_pair
from turnout.mismatch.engine.verification import Verification, predict_with_decoy
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, channel_sites
from turnout.mismatch.turnout.passage_observation import AlignedPassage, observe_passage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
from turnout.mismatch.turnout.residual_spaces import _force_space, source_spaces
from turnout.mismatch.turnout.saturation import raw_peak
from turnout.physics import Parameter
from turnout.simulate.track import uniform_track
from turnout.stages.finding_row import finding_row


class Alike(Case):
    """Two shapes with a similarity of 0.62; only one of them is in the data."""

    def __init__(self):
        rng = np.random.default_rng(3)
        shapes = np.linalg.qr(rng.normal(size=(300, 2)))[0].T * np.sqrt(300)
        self.shape = {"there": shapes[0], "like it": 0.62 * shapes[0] + np.sqrt(1.0 - 0.62**2) * shapes[1]}
        self.observations = tuple(
            Observation(f"o{k}", f"day {k}", shapes[0] + 0.7 * rng.normal(size=300), 1.0) for k in range(2)
        )
        self.nuisances = (Nuisance("offset", "-", 0.0, 0.1),)
        self.control_level = {"response": 0.5}
        size = (Parameter("size", "-", 0.0, (-5.0, 5.0), "", "made up 2026", (0.0, 1.0)),)
        self.candidates = tuple(
            Candidate.of(
                name,
                size,
                lambda p, name=name: (name, p["size"]),
                ((0.5,),),
                {"place": float(k)},
                smallest_reportable=0.02,
            )
            for k, name in enumerate(("like it", "there"))
        )

    def predict(self, values, terms, observations):
        return [values["offset"] + sum((a * self.shape[n] for n, a in terms), np.zeros(300)) for _ in observations]


def test_a_first_effect_is_not_named_for_the_evidence_of_the_second():
    """Alone it leaves most of the residual and is rejected. Beside the second its size is 0: the gain is the
    second's, which is in the data and has the name."""
    case = Alike()
    search = Search(case)
    like, there = case.candidates
    base = fit_jointly(case)
    first = fit_jointly(case, (like,), [0.5])
    rejected, _ = assess(search, base, [score_of(search, base, first, like)])
    pair = fit_jointly(case, (like, there), [*first.psi, 0.5], first.values)
    second, _ = assess(search, first, [score_of(search, first, pair, there)])
    assert (rejected.answer, second.answer) == ("unknown", "named")
    found = settle_pair(Findings(search, base, pair, (rejected, second)))
    assert [v.names for v in found.verdicts] == [("there",)]
    assert found.verdicts[0].trail[-1] == "second_passes_without_first"


class OneChannelAbove(Case):
    """A channel at twice its control level in one recording, all others at their control level."""

    def __init__(self):
        labels = {"sensor": np.array(["S1"], dtype=object)}
        self.observations = (
            Observation("p", "p", np.zeros(100), 1.0, data_type="passage", cells=np.zeros(100, int), labels=labels),
        )
        self.control_level, self.cell_level = {"passage": 0.7, "hammer": 0.9}, {"passage": 2.0}


def with_squares(square, hammer):
    """A fit that leaves these mean squares in the raised channel and in impacts."""
    level, white = {"passage": 0.5, "hammer": hammer}, [np.full(100, np.sqrt(square))]
    psi, part = np.array([0.4]), lambda candidate: slice(0, 1)
    return SimpleNamespace(level=level, white=white, candidates=(), psi=psi, psi_se=0.1 * psi, part=part, jacobian={})


@pytest.mark.parametrize(("after", "answer", "grade"), [(4.0, "unknown", ""), (2.2, "named", "B"), (1.9, "named", "A")])
def test_a_name_has_to_lower_the_channel_with_the_excess(after, answer, grade):
    """A name of 13 nats that does not lower the level of the channel does not explain the excess."""
    search = Search(OneChannelAbove())
    factor = Parameter("factor", "-", 1.0, (0.05, 20.0), "", "made up 2026")
    pad = Candidate.of("local_pad", (factor,), lambda p: p, ((0.4,),), {"place": 3.0})
    base, refit = with_squares(4.0, 0.5), with_squares(after, 0.45)
    share = explained_share(search, base, refit)
    assert share == pytest.approx(min(1.0, (4.0 - after) / 2.0))
    verdict, _ = assess(search, base, [Score(pad, 13.0, 0.0, share, refit)])
    assert verdict.answer == answer
    assert ("A" if worst_excess(search, refit) <= 1.0 else "B") == (grade or "B")
    assert assess(search, base, [])[0].answer == "unknown"


def test_a_second_effect_need_not_explain_the_residual_of_a_name_in_its_channel():
    """A mounting with an error of shape leaves an excess in its channel; a flat beside it does not explain that."""
    first, both = (SimpleNamespace(**{**vars(with_squares(4.0, 0.5)), "candidates": c}) for c in ("m", "mf"))
    assert explained_share(Search(OneChannelAbove()), first, both) == 1.0


@pytest.mark.parametrize("place", [12.0, 12.07, 12.2])
def test_the_receptance_is_continuous_at_the_position_of_the_hammer(place):
    """The local compliance between two nodes counts for any position of the sensor between them."""
    model = ReceptanceModel(uniform_track(24.0), ())
    here, beside = (model.receptance(place, place + way) for way in (0.0, 1e-6))
    assert np.max(np.abs(beside / here - 1.0)) < 1e-5


def test_the_seat_of_a_sensor_beside_the_impact_has_the_derivative_of_its_receptance():
    """And on a sleeper, which the seat on the rail does not move, it is 0."""
    model, way = ReceptanceModel(uniform_track(24.0), ()), RECEPTANCE.seat_step
    difference = (model.receptance(12.2, 12.26 + way) - model.receptance(12.2, 12.26 - way)) / (2.0 * way)
    seats = {("S", 12.26, "rail"): 12.26, ("S", 12.26, "sleeper"): ("sleeper", 20)}
    sensitivity = ReceptanceSensitivity(model, [(12.2, seat) for seat in seats], seats, SimpleNamespace())
    on_rail, on_sleeper = sensitivity.seat_gradients
    assert np.allclose(on_rail, difference, atol=0.0, rtol=1e-9)
    assert np.all(on_sleeper == 0.0)
    nodes_alone = (model.nodal_motion(12.2, 12.26 + way) - model.nodal_motion(12.2, 12.26 - way)) / (2.0 * way)
    assert np.max(np.abs(nodes_alone / difference - 1.0)) > 0.05  # the part that would be missing


def channel_signal(reference, term):
    """Signal of a channel with ``term`` for a train that comes ``reference`` seconds after the start of the
    recorder."""
    time = np.arange(reference - 0.08, reference + 1.0, 1.0 / 360.0)
    sensor = SimpleNamespace(name="A", place=20.0)
    made = AlignedPassage("p", SimpleNamespace(), (sensor,), time, reference, 30.0)
    predictor = Predictor.__new__(Predictor)
    predictor.solver = SimpleNamespace(rate=1800.0)
    row = np.cos(2.0 * np.pi * 20.0 * np.arange(14400) / 7200.0)
    return time, predictor.channel_output({"time@p": 0.0, "gain_A": 0.0}, (term,), made, sensor, row), row


@pytest.mark.parametrize("reference", [0.45, 0.457, 1.237])
def test_the_phase_of_hum_refers_to_the_clock_of_the_recorder_and_not_to_the_train(reference):
    time, with_hum, _ = channel_signal(reference, physics.Hum("A", 0.8, 0.6))
    _, without, _ = channel_signal(reference, physics.Hum("A", 0.0, 0.0))
    hum = 0.8 * np.sin(2.0 * np.pi * 50.0 * time) + 0.6 * np.cos(2.0 * np.pi * 50.0 * time)
    # the signal's samples lie at the middle of their steps of 1/7200 s: 1.3 degrees at 50 Hz
    assert np.allclose((with_hum - without)[20:-20], hum[20:-20], atol=0.05)


def test_the_error_of_a_drifting_clock_grows_from_the_start_of_the_record():
    """A share of 1e-3, five seconds after the start: the train appears 5 ms early, and little more at its end."""
    time, drifted, _ = channel_signal(5.0, physics.ClockDrift("A", 1e-3))
    _, sound, _ = channel_signal(5.0, physics.ClockDrift("A", 0.0))
    lags = np.arange(-8e-3, 8.1e-3, 2.5e-4)
    middle = slice(60, -60)
    fits = [np.sum((np.interp(time + lag, time, sound) - drifted)[middle] ** 2) for lag in lags]
    assert lags[int(np.argmin(fits))] == pytest.approx(5.4e-3, abs=5e-4)  # 5 ms, and half a second of the train's own


class Topped(Case):
    """A channel whose swings of 10 are cut at 6, in two recordings."""

    def __init__(self):
        rng, time = np.random.default_rng(1), np.arange(2000) / 1000.0
        self.true = 10.0 * np.sin(2.0 * np.pi * 7.0 * time) * np.exp(-(((time - 1.0) / 0.4) ** 2))
        data = [np.clip(self.true, -6.0, 6.0) + 0.1 * rng.normal(size=time.size) for _ in range(2)]
        sigma = 0.1 + 0.06 * np.abs(self.true)
        self.observations = tuple(Observation(f"o{k}", f"day {k}", d, sigma) for k, d in enumerate(data))
        self.sensor = SimpleNamespace(name="A", place=3.0, mounting="rail head")
        self.candidates = tuple(_limits_of(self.sensor, 6.2))

    def predict(self, values, terms, observations):
        found = self.true
        for term in terms:
            found = term.channel(found, 1000.0, self.sensor)
        return [found for _ in observations]


def _limits_of(sensor, peak, whole=None):
    """The candidate limits of one channel with a peak of ``peak`` in the band and ``whole`` in total."""
    recording = SimpleNamespace(
        channels=(SimpleNamespace(name="B"), sensor), index=["B", "A"].index,
        samples=np.array([[0.0, 99.0, 1.0], [0.1, -0.3, -1.0]]) * np.array([[1.0], [whole or peak]]),
    )  # fmt: skip
    campaign = SimpleNamespace(sensors=(sensor,), passages=(SimpleNamespace(recording=recording),))
    made = SimpleNamespace(
        campaign=campaign, frf_pairs={}, aligned_passages={"p": None}, saturated={},
        settings=MismatchSettings(), band_peak=lambda name: peak, raw_peak=lambda name: raw_peak(campaign, name),
    )  # fmt: skip
    (site,) = channel_sites(made)
    return [candidate_of(physics.Clipping, limit) for limit in physics.Clipping.hypotheses(site)]


def test_a_limit_of_a_channel_is_found_from_any_start_of_the_library():
    """A change of the limit by 1 m/s² changes the clipped peaks, a fifth of the samples, by ten standard errors."""
    case = Topped()
    (candidate,) = case.candidates
    base = fit_jointly(case)
    for start in candidate.starts:
        fit = fit_jointly(case, (candidate,), start, iterations=12)
        assert fit.psi[0] == pytest.approx(6.0, abs=0.05) and fit.evidence - base.evidence > 100.0
    assert np.array_equal(
        candidate.term(candidate.neutral).channel(case.true, 1.0, case.sensor), np.clip(case.true, -12.4, 12.4)
    )


@pytest.mark.parametrize("whole, is_limit", [(6.2, True), (13.0, True), (14.0, False), (586.6, False)])
def test_no_candidate_limit_of_a_channel_is_below_its_peaks(whole, is_limit):
    """12.4 in the band are not exceeded; 0.9 of 13 is below that, 0.9 of 14 is not."""
    found = _limits_of(SimpleNamespace(name="A", place=3.0), 6.2, whole)
    assert bool(found) == is_limit
    assert all(0.9 * whole <= start[0] <= 12.4 for c in found for start in c.starts)


def test_the_decoy_is_fitted_to_recordings_like_those_that_it_predicts():
    """Two taps correct passages that are two samples late; impacts that fit already must not prevent that."""
    rng = np.random.default_rng(0)

    def late(k):
        p = np.convolve(rng.normal(size=820), np.hanning(9), "same")[10:-10]
        return Observation(f"p{k}", "c", np.roll(p, 2), 0.1, 0.35, "passage"), p

    def impact(k):
        p = rng.normal(size=80)
        return Observation(f"b{k}", "h", p, 0.03, 0.7, "hammer"), p

    passages, (reserved, simulated) = [late(k) for k in range(3)], late(9)
    for seen in (passages, passages + [impact(k) for k in range(32)]):
        made = predict_with_decoy([o for o, _ in seen], [p for _, p in seen], [reserved], [simulated], 4)
        assert fit_percent([reserved], made) > 85.0 > 20.0 > fit_percent([reserved], [simulated])
    alone = [impact(1)]
    assert predict_with_decoy([o for o, _ in alone], [p for _, p in alone], [reserved], [simulated], 4) == [simulated]


def dip(place, shift):
    """A diagnosis that names a dip with a ``shift`` from ``place`` on the grid, and a misplaced sensor."""
    parameters = physics.SurfaceDip.parameters
    candidate = Candidate.of(
        "surface_dip", parameters, lambda p: physics.SurfaceDip(place, **p), (), {"place": place}, "place"
    )
    other = Candidate.of("sensor_position", physics.SensorPosition.parameters,
                      lambda p: physics.SensorPosition("S1", **p), (), {"sensor": "S1"}, "sensor")  # fmt: skip
    names = [p.name for p in parameters]
    psi = np.array([*({"shift": shift, "depth": 4e-4, "length": 0.4}.get(n, 0.5) for n in names), 0.7])
    se = np.array([*(0.03 if n == "shift" else 0.01 for n in names), 0.2])
    fit = SimpleNamespace(
        candidates=(candidate, other), psi=psi, psi_se=se, terms=(candidate.term(psi[:-1]), other.term(psi[-1:])),
        part=lambda c: slice(0, len(names)) if c is candidate else slice(len(names), None),
    )  # fmt: skip
    verdict = SimpleNamespace(answer="named", names=("surface_dip",), grade="A", probability=0.97, reason="")
    check = Verification(1, 1.0, 2.0, 1.0, 1.0, 0.5)
    return SimpleNamespace(
        fit=fit, verdict=verdict, verdicts=(verdict,), probability=0.97, verification=check, frames=(), where=None,
        possible_positions=(None, None),
    )  # fmt: skip


def test_a_dip_is_reported_at_its_fitted_position_and_not_at_that_of_the_grid():
    row = finding_row(dip(23.0, 0.25), {})
    assert (row["position_m"], row["position_se_m"]) == (23.25, 0.03)


def test_the_position_error_of_a_sensor_is_not_that_of_a_sleeper():
    found = dip(23.0, 0.25)
    hangs = Candidate.of("hanging_sleeper", physics.HangingSleeper.parameters,
                      lambda p: physics.HangingSleeper(4, **p), (), {"place": 23.4, "sleeper": 4}, "place")  # fmt: skip
    found.fit.candidates = (hangs, found.fit.candidates[1])
    found.fit.psi, found.fit.psi_se = np.array([1e-3, 0.0, 0.7]), np.array([1e-4, 0.1, 0.2])
    row = finding_row(found, {})
    assert (row["position_m"], row["position_se_m"]) == (23.4, None)
    found.possible_positions = ((22.8, 23.4), None)  # half of the distance to the end of an interval of 95 %
    assert finding_row(found, {})["position_se_m"] == pytest.approx(0.3)


@pytest.fixture(scope="module")
def case_with_passages():
    return TrackCase(intact_campaign((24.0,), 7))


def test_noise_is_not_measured_while_the_train_comes(case_with_passages):
    """The same passage without its start, up to a twentieth of a second before the first wheel: the sensors then record
    the train, and this must not count as noise of a channel."""
    made = next(iter(case_with_passages.aligned_passages.values()))
    passage, sigma = made.passage, []
    for cut in (0.0, made.reference - 0.05):
        first = round(cut * passage.recording.rate)
        recording = SimpleNamespace(**vars(passage.recording))
        recording.samples = passage.recording.samples[:, first:]
        recording.duration = recording.samples.shape[1] / passage.recording.rate
        recording.index = passage.recording.index
        shorter = SimpleNamespace(**vars(passage))
        shorter.recording = recording
        _, seen = observe_passage(shorter, made.sensors, made.reference - cut, made.speed, 0.05)
        sigma.append(np.median(seen.sigma.reshape(len(made.sensors), -1), axis=1))
    assert np.all(sigma[1] < 1.3 * sigma[0])


def test_one_sensor_does_not_distinguish_a_position_from_its_own_channel(case_with_passages):
    fit = fit_jointly(case_with_passages, iterations=0)
    passages = [
        s for s in source_spaces(case_with_passages, fit) if any(kind == "sensor" for kind, _ in s.combinations)
    ]
    assert any(kind == "place" for s in passages for kind, _ in s.combinations)
    name, made = next(iter(case_with_passages.aligned_passages.items()))
    one = AlignedPassage(name, made.passage, made.sensors[:1], made.time, made.reference, made.speed)
    kinds = {kind for kind, _ in _force_space(case_with_passages, fit, one).combinations}
    assert kinds == {"clock", "sensor"}


def test_reserved_passages_alone_give_no_candidates_and_no_error():
    """Waves of the rail have no size if no fitted recording depends on them."""
    campaign = intact_campaign((24.0,), 7)
    case = TrackCase(replace(campaign, reserved=tuple(p.name for p in campaign.passages)))
    assert case.aligned_passages and not any(o.name in case.aligned_passages for o in case.observations)
    assert case.residual_candidates(fit_jointly(case, iterations=0)) == ()
