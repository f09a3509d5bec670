"""Arrays that are built without ``pa.array`` equal those of ``pa.array``, and registration does not import pandas."""

import subprocess
import sys
from datetime import datetime

import numpy as np
import pyarrow as pa
import pytest

from turnout.registry.arrow_arrays import arrow_array
from turnout.registry.intake import to_arrow
from turnout.registry.schema import column

CASES = [
    (["a", None, "äöü", ""], pa.string()), ([], pa.string()), ([None, None], pa.string()),
    ([1.5, None, float("inf"), -0.0], pa.float64()), ([1, 2.5, None, 2**53], pa.float64()),
    ([1e300, 0.1], pa.float32()),
    ([1, None, -(2**31)], pa.int32()), ([2**63 - 1, None], pa.int64()), ([], pa.float64()), ([None], pa.int32()),
    ([datetime(2026, 1, 5, 10, 0, 0, 7), None, datetime(1, 1, 1)], pa.timestamp("us")),
    ([True, None, False], pa.bool_()), ([np.float64(2.5), np.int32(3)], pa.float64()), ([np.int64(3)], pa.int32()),
    ([*range(100), *[None] * 33], pa.int64()),
]  # fmt: skip


@pytest.mark.parametrize(("values", "type_"), CASES, ids=str)
def test_an_array_equals_that_of_arrow(values, type_):
    array = arrow_array(values, type_)
    array.validate(full=True)
    assert array.type == type_ and array.equals(pa.array(values, type_))


def test_nan_is_not_stored_as_null():
    array = arrow_array([float("nan"), None], pa.float64())
    assert array.null_count == 1 and np.isnan(array[0].as_py())


@pytest.mark.parametrize(
    ("values", "type_"),
    [
        ([2**31], pa.int32()),
        ([2**63], pa.int64()),
        ([1], pa.string()),
        (["1"], pa.float64()),
        ([10**400], pa.float64()),
    ],
    ids=str,
)
def test_a_value_that_does_not_fit_is_rejected(values, type_):
    with pytest.raises((pa.ArrowException, TypeError, ValueError, OverflowError)):
        arrow_array(values, type_)


def test_lists_of_numbers_and_missing_lists_are_converted():
    values = [np.array([1.0, 2.0]), None, np.zeros(0), *[np.arange(3.0)] * 8]
    array, wrong = to_arrow(column("models", "a_matrix"), values)
    array.validate(full=True)
    assert wrong == [] and array.to_pylist() == [None if v is None else v.tolist() for v in values]
    assert to_arrow(column("models", "a_matrix"), [])[0].to_pylist() == []


@pytest.mark.parametrize("name", ["passed", "coherence"])
def test_lists_of_every_type_are_read_back_as_written(name):
    """Arrow packs eight booleans into a byte; bytes taken as bits would leave one of eight values true."""
    rng = np.random.default_rng(4)
    values = [rng.random(n) > 0.3 if name == "passed" else rng.random(n).astype(np.float32) for n in (19, 1, 0, 64)]
    array, wrong = to_arrow(column("receptances", name), [*values, None])
    array.validate(full=True)
    assert wrong == [] and array.to_pylist() == [*(v.tolist() for v in values), None]


def test_registration_of_results_imports_no_pandas(tmp_path):
    code = (
        "import sys; from pathlib import Path; from turnout.registry.job import register\n"
        "from turnout.workflow.batches import UnitResult, read_results, write_batch\n"
        "import numpy as np; folder = Path(sys.argv[1])\n"
        "row = {'model_id': 'm', 'section_id': 't/A', 'turnout_id': 't', 'measured_at_utc': '2026-01-05T10:00:00', "
        "'method': 'joint', 'status': 'accepted', 'a_matrix': np.eye(4).ravel(), 'n_impacts_used': 3}\n"
        "result = UnitResult('t/hammer/A/2026-01-05', 't', 'hammer', 'k', '1', 'ok', {'models': [row]})\n"
        "batch = write_batch(folder, [result])\n"
        "print(register([batch], folder / 'registry', read=read_results).n_units, 'pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True)
    assert done.stdout.split() == ["1", "False"], done.stdout + done.stderr
