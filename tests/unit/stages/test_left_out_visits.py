"""Visits of a turnout with an error in its configuration wait; those of the others of its shard are diagnosed."""

import json

from turnout.config import load_configuration
from turnout.stages.mismatch_groups import enabled_visit, every_visit

LAYOUT = """\
sections: {A7: {panel: CP, track: main, position: 24.6}}
passages:
  files: "{time}.csv"
  channels: {a: {source: 0, quantity: acceleration, section: A7}}
settings: {mismatch: {enabled: true}}
"""


def test_a_turnout_that_is_left_out_does_not_stop_the_diagnoses_of_its_shard(tmp_path):
    for name, text in {
        "turnouts.tsv": "turnout\tlayout\nt1\tmain\nt2\tmain\n",
        "layouts/main.yaml": LAYOUT,
        "overrides/t2.yaml": "sections: [",
    }.items():
        (tmp_path / "config" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "config" / name).write_text(text)
    units = [["passage", "20260101T100000Z", None, None, "", [["20260101T100000Z.csv", 100, 1]]]]
    entries = [{"turnout": t, "raw": t, "units": units, "hashes": {"passage": "h"}} for t in ("t1", "t2")]
    (tmp_path / "plan.json").write_text(json.dumps({"turnouts": entries}))
    configuration = load_configuration(tmp_path / "config", leave_out=True)
    for visits in (every_visit, enabled_visit):
        assert [p.unit.turnout for p in visits(tmp_path / "plan.json", configuration)] == ["t1"]
