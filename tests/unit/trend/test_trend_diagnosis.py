"""An alarm and the diagnosis of the same section: one statement in the worklist, or why there is none."""

import pandas as pd
import pytest
from tests.unit.trend.test_trend_list import fallen, viewed

SECTION = "T00001/S4"


def finding(found_at, verdict, sentence, sections="S3, S4"):
    row = {
        "finding_id": "f1", "turnout_id": "T00001", "found_at_utc": found_at, "verdict": verdict, "sentence": sentence,
        "sections": sections, "visit": f"{found_at:%Y-%m-%d}",
    }  # fmt: skip
    return pd.DataFrame([row])


@pytest.fixture(scope="module")
def rows():
    return fallen()


@pytest.mark.parametrize(
    ("weeks_ago", "verdict", "sections", "expected"),
    [
        (0, "named", "S3, S4", "soft ballast at 21.6 m"),
        (0, "none", "S3, S4", "no decision: within the tolerances of the track file"),
        (110, "named", "S3, S4", "is older than the change"),
        (0, "named", "S1", "no decision: no diagnosis of this section yet"),
    ],
    ids=["one result", "tolerances", "too old", "of another section"],
)
def test_an_alarm_has_the_diagnosis_of_its_section_or_a_reason(settings, rows, weeks_ago, verdict, sections, expected):
    found_at = rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago)
    findings = finding(found_at, verdict, "soft ballast at 21.6 m", sections)
    query = "select diagnosis, state from worklist where section_id = ?"
    with viewed(rows, settings, mismatch_findings=findings) as con:
        ((diagnosis, state),) = con.execute(query, [SECTION]).fetchall()
        others = con.execute("select diagnosis from worklist where raised_at_utc is null").fetchall()
    assert state == "inspect this week" and expected in diagnosis
    assert all(d is None for (d,) in others)
