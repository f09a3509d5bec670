"""JSON in a comment of a table is read as the metadata of other formats are."""

import json

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
FORCE, RAIL = np.random.default_rng(13).normal(size=(2, 400))
IN_SI = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=RATE,
)


def reasons(name, root):
    """Reasons of the errors."""
    try:
        return [error.reason for error in read(name, root, IN_SI).errors]
    except ReadError as error:
        return [error.reason]


@pytest.mark.parametrize("mark", ["# ", "", "% "])
@pytest.mark.parametrize(
    ("facts", "is_reported"),
    [
        ({"units": {"force": "kN"}}, True),
        ({"rail": {"scale": 0.5}}, True),
        ({"fs": 51200}, True),
        ({"units": {"force": "N", "rail": "m/s²"}, "fs": RATE, "operator": "JH"}, False),
    ],
)
def test_a_comment_in_json_is_compared_as_in_npz(mark, facts, is_reported, tmp_path):
    rows = "".join(f"{f:.5f};{r:.5f}\n" for f, r in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"{mark}{json.dumps(facts)}\nforce;rail\n{rows}", encoding="utf-8")
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, meta=np.array(json.dumps(facts)))
    assert reasons("a.csv", tmp_path) == reasons("a.npz", tmp_path)
    assert bool(reasons("a.csv", tmp_path)) == is_reported
