"""The candidates that an oracle receives, and the rows that the bridge writes. Neither runs a simulation here."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.blind_bridge import rows_of
from benchmarks.blind_oracle import _candidates, _true_start, clear_singles
from benchmarks.blind_visit_efficiency import best_rival, has_enough

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch import Candidate
from turnout.physics import Parameter
from turnout_blind.score.answers import answers_of
from turnout_blind.score.matching import judge

FACTOR = Parameter("factor", "-", 1.0, (0.05, 5.0), "of stiffness", "a test")


def candidate(family, **where):
    return Candidate.of(family, (FACTOR,), dict, ((0.4,), (2.5,)), where, "place" if "place" in where else "sensor", 7)


PADS = [candidate("local_pad", sleeper=j, place=0.6 * j) for j in range(10)]
CASE = SimpleNamespace(
    candidates=(*PADS, candidate("local_ballast", place=3.0), candidate("sensor_gain", sensor="A2"),
                candidate("sensor_gain", sensor="A3"), candidate("unsprung_mass", train="loaded"))
)  # fmt: skip
EFFECT = {"kind": "pad", "where": {"position": 3.1, "sleeper": 40}, "parameters": {"factor": 0.33}, "rung": 4,
          "locked_to": "place"}  # fmt: skip


def test_an_oracle_receives_only_the_right_name_at_the_true_position():
    assert [c.where["place"] for c in _candidates(CASE, EFFECT)] == [3.0]
    gain = {"kind": "gain", "where": {"sensor": "A3"}, "parameters": {"gain": 1.2}}
    assert [c.where for c in _candidates(CASE, gain)] == [{"sensor": "A3"}]
    mass = {"kind": "unsprung_mass", "where": {"train": "railcar"}, "parameters": {"factor": 1.4}}
    assert not list(_candidates(CASE, mass))
    assert not list(_candidates(CASE, {"kind": "guard_rail_rattle", "where": {"position": 3.0}, "parameters": {}}))


def test_an_oracle_starts_from_the_true_values_within_the_bounds():
    assert _true_start(PADS[5], EFFECT) == [0.33]
    assert _true_start(PADS[5], {**EFFECT, "parameters": {"factor": 0.01}}) == [0.05]
    assert _true_start(PADS[5], {**EFFECT, "kind": "void", "parameters": {"gap": 1e-3}}) == [0.4]


def test_clear_singles_are_sorted_by_id():
    def truth(stratum, share, kind="pad", **where):
        return {
            "stratum": stratum,
            "visible": {"hammer_pct": 0.0, "passage_pct": share},
            "effects": [{"kind": kind, "where": where}],
        }

    truths = {"T3": truth("single", 60.0), "T1": truth("single", 40.0), "T2": truth("single", 5.0)}
    truths |= {"T0": truth("double", 60.0), "T4": truth("outside", 60.0), "T5": truth("single", 60.0, "squeal")}
    truths |= {"T6": truth("single", 60.0, "flat", train="railcar", axle=3)}
    assert clear_singles(truths) == ["T1", "T3"]


def test_rows_of_the_bridge_are_read_by_the_scorer():
    fit = SimpleNamespace(psi=np.array([0.35]), psi_se=np.array([0.02]), part=lambda _: slice(0, 1))
    best = SimpleNamespace(candidate=PADS[5], fit=fit)
    verdict = SimpleNamespace(
        answer="named", names=("local_pad",), grade="A", probability=0.9, scores=(best,), reason="because"
    )
    seen = SimpleNamespace(before=40.0, after=48.0, rival=44.0, decoy=float("nan"), n=2)
    found = SimpleNamespace(verdicts=(verdict,), verification=seen, frames=(), where=None, fit=fit)
    found.possible_positions = (None,)
    rows = rows_of(found)
    assert json.loads(json.dumps(rows)) == rows
    truth = {
        "case": "T1",
        "stratum": "single",
        "effects": [EFFECT],
        "visible": {"hammer_pct": 40.0, "passage_pct": 5.0},
    }
    judged = judge(truth, answers_of(rows))
    assert judged.matches == ("named",) and judged.located == {"lock": True, "place": True}
    assert judged.fits == (40.0, 48.0)
    assert judged.parameters == ((pytest.approx(0.02 / 0.67), True),)


def test_a_rival_of_the_true_effect_has_another_name_and_no_negative_gain():
    ranking = [{"family": "local_pad", "nats": 30.0}, {"family": "sensor_gain", "nats": 9.0}]
    rows = [{"evidence_json": json.dumps({"ranking": ranking})}]
    assert best_rival(rows, ("local_pad",)) == ("sensor_gain", 9.0)
    assert best_rival(rows, ("local_pad", "sensor_gain")) == ("", 0.0)
    opposed = [{"evidence_json": json.dumps({"ranking": [{"family": "rail_shear", "nats": -4.0}]})}]
    assert best_rival(opposed, ("local_pad",)) == ("rail_shear", 0.0)
    assert best_rival([{"evidence_json": None}], ("local_pad",)) == best_rival([], ("local_pad",)) == ("", 0.0)


@pytest.mark.parametrize(
    ("gain", "rival", "reportable", "expected"),
    [(12.1, 0.0, True, True), (12.0, 0.0, True, False), (20.0, 14.0, True, True), (20.0, 14.1, True, False),
     (50.0, 0.0, False, False)],
)  # fmt: skip
def test_evidence_is_enough_above_the_threshold_and_the_margin_of_a_name(gain, rival, reportable, expected):
    settings = MismatchSettings(threshold=12.0, margin=6.0)
    assert has_enough(SimpleNamespace(gain=gain, is_reportable=reportable), rival, settings) is expected
    assert not has_enough(None, 0.0, settings)
