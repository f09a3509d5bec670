"""The order of precedence is defaults, config.yaml, layout, row, override; hashes change exactly when results can."""

import pickle

import pytest

from turnout.config import load_configuration, with_raw
from turnout.config.configuration import sources
from turnout.config.document import load, merge_branches, plain_values
from turnout.errors import ConfigError

LAYOUT = """\
sections:
  A7: {panel: CP, track: main, position: 24.6, pad: EVA}
  A8:
    panel: CP
    track: diverging
    position: 26.5
    hammer:
      channels: {rail: {offset: 0.3, limit: 500}}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  rate: 20000
  records: 10
  force: force
  response: rail
  channels:
    force: {source: 1, quantity: force, unit: V, sensitivity: 0.23, sensitivity_unit: mV/N}
    rail: {source: acc, quantity: acceleration, unit: m/s²}
settings: {receptance: {gate_level: 0.7}}
"""


@pytest.fixture
def folder(tmp_path):
    config = tmp_path / "config"
    (config / "layouts").mkdir(parents=True)
    (config / "overrides").mkdir()
    (config / "layouts/main.yaml").write_text(LAYOUT)
    (config / "config.yaml").write_text("receptance: {gate_level: 0.6, minimum_impacts: 5}\n")
    header = "turnout\tlayout\tname\thammer_rate_hz\tpad_type\n"
    (config / "turnouts.tsv").write_text(header + "t1\tmain\tOne\t\t\nt2\tmain\tTwo\t5000\tHDPE\nt3\tmain\t\t\t\n")
    (config / "overrides/t3.yaml").write_text(
        "hammer: {rate: 8000, records: null}\nsettings: {receptance: {gate_level: 0.9}}\n"
    )
    return config


def test_a_later_file_overrides_an_earlier_one_key_by_key(folder):
    one, two, three = map(load_configuration(folder).turnout, ("t1", "t2", "t3"))
    assert [t.settings["receptance"].gate_level for t in (one, two, three)] == [0.7, 0.7, 0.9]
    assert {t.settings["receptance"].minimum_impacts for t in (one, two, three)} == {5}
    assert [t.hammer.descriptions["A7"].rate for t in (one, two, three)] == [20000.0, 5000.0, 8000.0]
    assert [t.hammer.descriptions["A7"].n_records for t in (one, two, three)] == [10, 10, None]
    assert [[s.pad for s in t.sections] for t in (one, two)] == [["EVA", ""], ["HDPE", "HDPE"]]


def test_a_section_can_override_the_layout(folder):
    hammer = load_configuration(folder).turnout("t1").hammer
    rails = {label: d.channels[1] for label, d in hammer.descriptions.items()}
    assert (rails["A7"].limit, rails["A8"].limit) == (None, 500.0)
    assert (rails["A7"].position, rails["A8"].position) == pytest.approx((24.6, 26.8))
    force = hammer.descriptions["A8"].channels[0]
    assert (force.source, force.position, force.sensitivity) == (1, None, 0.23)


def test_every_value_has_its_source_file_and_line(folder):
    found = {key: (value, source) for key, value, source in sources(load_configuration(folder), "t3")}
    assert found["hammer.rate"] == (8000, "config/overrides/t3.yaml, line 1")
    assert found["hammer.force"] == ("force", "config/layouts/main.yaml, line 13")
    assert found["settings.receptance.minimum_impacts"] == (5, "config/config.yaml, line 1")
    assert found["settings.fleet.shards"] == (1, "default")
    assert found["turnout"] == ("t3", "config/turnouts.tsv, line 4")


def changed_hashes(folder, change):
    """Kinds of hash of turnout t1 that ``change`` alters; "" is the hash of everything."""
    before = load_configuration(folder)
    change(folder)
    after = load_configuration(folder)
    return {kind for kind in ("", "hammer", "passage") if before.hash_of("t1", kind) != after.hash_of("t1", kind)}


def rewrite(name, old, new):
    def change(folder):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return change


@pytest.mark.parametrize(
    "change, changed",
    [
        (rewrite("config.yaml", "minimum_impacts: 5", "minimum_impacts: 6"), {"", "hammer"}),
        (rewrite("config.yaml", "minimum_impacts: 5", "minimum_impacts:   5"), set()),
        (rewrite("config.yaml", "gate_level: 0.6", "gate_level: 0.5"), set()),  # the layout overrides it with 0.7
        (rewrite("config.yaml", "receptance", "fleet: {shards: 64}\nreceptance"), set()),
        (rewrite("turnouts.tsv", "One", "Number one"), set()),
        (rewrite("layouts/main.yaml", "records: 10", "records: 12"), {"", "hammer"}),
        (rewrite("layouts/main.yaml", "sections:", "description: new words\nsections:"), set()),
        (rewrite("layouts/main.yaml", "24.6", "24.7"), {"", "hammer", "passage"}),
        (rewrite("overrides/t3.yaml", "8000", "9000"), set()),
    ],
)
def test_a_hash_changes_when_a_result_can_change(folder, change, changed):
    assert changed_hashes(folder, change) == changed


def test_a_default_that_is_written_out_changes_no_hash(folder):
    from turnout.config.settings.receptance import ReceptanceSettings

    default = ReceptanceSettings().weak
    change = rewrite("config.yaml", "minimum_impacts: 5", f"minimum_impacts: 5, weak: {default}")
    assert changed_hashes(folder, change) == set()


def test_a_list_is_replaced_completely(tmp_path):
    (tmp_path / "a.yaml").write_text("a: {x: [1, 2, 3], y: 1}")
    (tmp_path / "b.yaml").write_text("a: {x: [9]}")
    assert plain_values(merge_branches(load(tmp_path / "a.yaml"), load(tmp_path / "b.yaml"))) == {
        "a": {"x": (9,), "y": 1}
    }


def test_a_turnout_can_be_pickled(folder):
    turnout = load_configuration(folder).turnout("t1")
    assert pickle.loads(pickle.dumps(turnout)) == turnout


def test_an_unknown_turnout_is_an_error(folder):
    with pytest.raises(ConfigError, match=r"no turnout 't4'\. Allowed: t1, t2, t3"):
        load_configuration(folder).turnout("t4")


CAMPAIGNS = """\
campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator
2024-05-13,2024-05-13T09:30:00,18.5,086D50-1,plastic,crew 1
2024-06-17,2024-06-17T10:00:00Z,,086D50-1,plastic,crew 1
2024-07-15,2024-07-15T10:00:00,warm,086D50-1,plastic,crew 1
2024-08-15,2024-05-15T10:00:00,15,086D50-1,plastic,crew 1
2024-05-13,2024-05-13T10:00:00,15,086D50-1,plastic,crew 1
2024-09-15,2024-09-15T10:00:00,15,086D50-1,plastic,crew 1, late
"""


def test_faulty_campaigns_are_reported_and_the_others_are_used(folder, tmp_path):
    from turnout.config.campaign_notes import read_notes

    (tmp_path / "raw/t1").mkdir(parents=True)
    (tmp_path / "raw/t1/campaigns.csv").write_text(CAMPAIGNS)
    turnout, errors = read_notes(load_configuration(folder).turnout("t1"), tmp_path / "raw")
    temperatures = {d: c.rail_temperature for d, c in turnout.campaigns.items()}
    assert temperatures == {"2024-05-13": 18.5, "2024-06-17": None, "2024-07-15": None, "2024-08-15": 15.0}
    assert [e.where.split(",")[0] for e in errors] == ["line 4", "line 5", "line 6", "line 7"]
    assert "rail_temperature_c is 'warm'. Write a number" in str(errors[0])
    assert "is not on the campaign's day" in str(errors[1]) and "second time" in str(errors[2])
    assert not turnout.campaigns["2031-01-01"].listed


def test_a_turnout_without_campaign_notes_is_no_error(folder, tmp_path):
    turnout = with_raw(load_configuration(folder).turnout("t1"), tmp_path)
    assert len(turnout.campaigns) == 0 and turnout.trains == ()
