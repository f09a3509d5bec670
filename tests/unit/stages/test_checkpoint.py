"""Checkpoints of a diagnosis are exact to the last bit, and no checkpoint file can execute code."""

import pickle
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.stages.budget import Budget, BudgetSpentError, Watch
from turnout.stages.checkpoint import Checkpoint, Replay, read_value, write_value

WAVE = np.sin(np.linspace(0.0, 7.0, 50))


class Amount(Case):
    nuisances = (Nuisance("amount", "-", 0.0, 1.0),)
    observations = (Observation("o", "day", 0.7 * WAVE, 0.1),)

    def predict(self, values, terms, observations):
        return [values["amount"] * WAVE]


class Trap:
    """To unpickle it is a failure of the test."""

    def __reduce__(self):
        return pytest.fail, ("a pickle was loaded",)


def test_a_stored_fit_is_read_exactly_to_the_last_bit(tmp_path):
    fit = fit_jointly(Amount())
    Checkpoint(tmp_path, "t1")["base"] = fit
    back = Checkpoint(tmp_path, "t1")["base"]
    assert isinstance(back, Fit) and back.values == fit.values and back.cost == fit.cost
    for name in ("predictions", "residuals", "jacobian", "white"):
        for a, b in zip(getattr(fit, name), getattr(back, name), strict=True):
            assert a.dtype == b.dtype and a.tobytes() == b.tobytes() and a.flags.c_contiguous == b.flags.c_contiguous
    assert np.array_equal(fit.covariance, back.covariance)


def test_stored_rows_are_read_in_their_order_with_their_types(tmp_path):
    row = {
        "z": 1, "a": float("nan"), "at": datetime(2026, 7, 25, 9, 0, 0, 5), "low": -np.inf, "sure": np.bool_(True),
        "x": np.arange(3, dtype=np.float32), "none": None, "where": ("S1", 24.0), "names": [], "third": 1.0 / 3.0,
        "transposed": np.arange(6.0).reshape(2, 3).T,
    }  # fmt: skip
    store = Checkpoint(tmp_path, "t1")
    store["rows"] = {"mismatch_findings": [row], "quarantine": []}
    back = Checkpoint(tmp_path, "t1")["rows"]
    (found,) = back["mismatch_findings"]
    assert list(found) == list(row) and back["quarantine"] == []
    assert (
        found["at"] == row["at"] and np.isnan(found["a"]) and found["sure"] is True and found["where"] == row["where"]
    )
    assert found["x"].dtype == np.float32 and found["third"] == row["third"] and found["low"] == -np.inf
    assert found["transposed"].flags.f_contiguous and np.array_equal(found["transposed"], row["transposed"])


def test_a_pickle_of_an_earlier_version_is_not_read(tmp_path):
    """Neither under its former name nor under the present one."""
    store = Checkpoint(tmp_path, "t1", ("identity",))
    store["base"] = 1.0
    path = store._path("base")
    for name in (path.name, path.with_suffix(".fit").name):
        (path.parent / name).write_bytes(pickle.dumps(Trap()))
    assert "base" not in Checkpoint(tmp_path, "t1", ("identity",))
    array = np.empty(1, dtype=object)
    array[0] = Trap()
    np.savez(path, content=array)
    assert "base" not in Checkpoint(tmp_path, "t1", ("identity",))


@pytest.mark.parametrize("content", [b"", b"nothing", b"PK\x03\x04broken"])
def test_a_damaged_file_is_treated_as_missing(tmp_path, content):
    store = Checkpoint(tmp_path, "t1")
    store["base"] = {"a": np.arange(3)}
    whole = store._path("base").read_bytes()
    for damaged in (content, whole[: len(whole) // 2]):
        store._path("base").write_bytes(damaged)
        assert "base" not in Checkpoint(tmp_path, "t1")


def test_a_file_of_another_version_is_not_read(tmp_path, monkeypatch):
    Checkpoint(tmp_path, "t1", ("one",))["base"] = 1.0
    assert "base" not in Checkpoint(tmp_path, "t1", ("two",))
    monkeypatch.setattr("turnout.stages.checkpoint.VERSION", 99)
    write_value(tmp_path / "later.npz", 1.0)
    monkeypatch.undo()
    with pytest.raises(KeyError):
        read_value(tmp_path / "later.npz")


@pytest.mark.parametrize("value", [Trap(), {"f": print}, np.array([Trap()], dtype=object)])
def test_values_that_could_only_be_pickled_are_not_written(tmp_path, value):
    with pytest.raises(TypeError, match="a checkpoint holds no"):
        write_value(tmp_path / "v.npz", value)
    assert not list(tmp_path.iterdir())


class Doubling:
    """Predictor that counts its calls, with its own rail."""

    def __init__(self, shear=0.0):
        self.rail, self.n = {"rail_shear": shear}, 0

    def predict(self, values, terms, observations):
        self.n += 1
        return [np.array([2.0 * values["a"] + self.rail["rail_shear"]])]

    def nuisance_jacobian(self, nuisances, values, terms, observations, base):
        self.n += 1
        return [np.array([[2.0]])]


def test_a_replay_computes_nothing_twice_and_distinguishes_rails(tmp_path):
    """The same request with another rail is another prediction; formerly it got the stored one."""
    seen = [SimpleNamespace(name="p")]
    for n in (2, 0):
        plain, softer = Doubling(), Doubling(0.5)
        budget = Budget(Watch(), Replay(tmp_path, "predictions"))
        first = [budget(plain, False).predict({"a": 1.0}, (), seen)[0] for _ in range(2)]
        assert [v.tolist() for v in first] == [[2.0], [2.0]]
        assert budget(softer, False).predict({"a": 1.0}, (), seen)[0].tolist() == [2.5]
        assert plain.n + softer.n == n


def test_the_first_prediction_and_hammer_tests_never_exceed_the_budget(tmp_path):
    reported = []
    budget = Budget(Watch(deadline=0.0, tell=reported.append), Replay(tmp_path, "predictions"))
    hammer, passage = budget(Doubling(), True), budget(Doubling(), False)
    for _ in range(3):
        hammer.predict({"a": 1.0}, (), ())
    passage.predict({"a": 1.0}, (), ())
    with pytest.raises(BudgetSpentError):
        passage.predict({"a": 2.0}, (), ())
    assert reported == [1, 2, 3, 4, 5]


def test_a_changed_bit_of_the_index_of_the_archive_is_treated_as_a_missing_file(tmp_path):
    """Formerly a file that seems to be encrypted, or of a later version of zip, ended the diagnosis."""
    path = tmp_path / "value.npz"
    value = {"mean": np.arange(6.0), "visit": "2026-05-01"}
    write_value(path, value)
    whole = path.read_bytes()
    start = whole.index(b"PK\x01\x02")
    n_damaged = 0
    for place in range(start, len(whole)):
        for bit in range(8):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ (1 << bit)]) + whole[place + 1 :])
            try:
                assert str(read_value(path)) == str(value)  # a bit of no meaning, as of its time
            except KeyError:
                n_damaged += 1
    assert n_damaged > 100
