"""The whole passage stage: from a file on disk to rows of the registry."""

import csv
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, impact_train, paper_model, rolling_noise

from turnout.config import load_configuration, with_raw
from turnout.passage.clusters import Cluster, Clusters
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.stages.passage import PassageContext, SectionModel, passage_unit
from turnout.stages.passage_context import applicable_models
from turnout.workflow.scan import scan

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "A9": 28.2, "ASM": 36.0, "ASD": 36.0}
LOCATIONS = dict(zip(PLACES, ("OT", "SP", "CLP", "CP A7", "CP A8", "CP A9", "AS main", "AS diverging")))
DIVERGING = ("A9", "ASD")


@pytest.fixture(autouse=True)
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


def lay_out(raw, recording, name="20240513T100000Z", trains=""):
    folder = raw / "tommerup_s1" / "passages"
    folder.mkdir(parents=True, exist_ok=True)
    write([recording], folder / f"{name}.h5", "hdf5")
    if trains:
        (raw / "tommerup_s1" / "trains.csv").write_text(trains)
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), raw)
    return scan(turnout, raw).units[0], turnout


def on_main(seed=1, speed=44.4):
    """Responses of the paper's models to an IC3 on the main track; sensors of the diverging track record nothing."""
    rng = np.random.default_rng(seed)
    recording, times = impact_train(rng, LOCATIONS.values(), list(PLACES.values()), speed=speed)
    samples = recording.samples.copy()
    for i, name in enumerate(PLACES):
        if name in DIVERGING:
            samples[i] = 0.003 * rng.standard_normal(samples.shape[1])
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    started = datetime(2024, 5, 13, 10, 0, 0)
    return replace(recording, samples=samples, channels=channels, started_at=started), times


def with_model(rows):
    """Rows of passage_fits at sections that have a model."""
    return [fit for fit in rows["passage_fits"] if fit["model_id"] != "none"]


def context(names=("A7",)):
    models = {
        name: (SectionModel(f"model-{name}", datetime(2024, 1, 1), paper_model(LOCATIONS[name])),) for name in names
    }
    return PassageContext(models, PATTERNS)


def allowed(repository):
    with open(repository / "src/turnout/registry/columns.csv", encoding="utf-8") as file:
        return {(r["table"], r["column"]): r for r in csv.DictReader(file)}


def test_rows_of_a_passage_have_the_stated_columns_and_the_true_values(tmp_path, repository):
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, recording)
    rows = passage_unit(unit, turnout, tmp_path, context(PLACES))
    columns = allowed(repository)
    for table, made in rows.items():
        required = {c for (t, c), r in columns.items() if t == table and r["required"] == "yes"}
        for row in made:
            assert not set(row) - {c for t, c in columns if t == table}
            assert required - {"run_id", "result_id"} <= {k for k, v in row.items() if v is not None}
            for name, value in row.items():
                choices = columns[table, name]["allowed"]
                assert not choices or value is None or value in choices.split("|"), (table, name, value)
    passage = rows["passages"][0]
    assert (passage["status"], passage["n_axles"], passage["train_type"]) == ("accepted", 8, "IC3")
    assert (passage["direction"], passage["track"]) == ("facing", "main")
    assert passage["speed_kmh"] == pytest.approx(3.6 * 44.4, rel=3e-3)
    assert passage["passed_at_utc"] == datetime(2024, 5, 13, 10, 0, 1, 270000).replace(
        microsecond=passage["passed_at_utc"].microsecond
    )
    fits = {f["channel"]: f for f in rows["passage_fits"]}
    assert set(fits) == set(PLACES) - set(DIVERGING)
    assert all(f["status"] == "accepted" for f in fits.values())
    assert all(f["fit_pct"] > 95 for f in fits.values())
    assert rows["quarantine"] == []


def test_the_same_file_gives_the_same_rows(tmp_path):
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, recording)
    first, second = (passage_unit(unit, turnout, tmp_path, context()) for _ in range(2))
    assert repr(first) == repr(second)


def test_the_model_is_the_latest_before_the_passage(tmp_path):
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, recording)
    old, new, later = (
        SectionModel(name, datetime(year, 1, 1), paper_model("CP A7"))
        for name, year in (("old", 2023), ("new", 2024), ("later", 2025))
    )
    rows = passage_unit(unit, turnout, tmp_path, PassageContext({"A7": (old, new, later)}, PATTERNS))
    assert [f["model_id"] for f in with_model(rows)] == ["new"]
    rows = passage_unit(unit, turnout, tmp_path, PassageContext({"A7": (later,)}, PATTERNS))
    assert [f["model_id"] for f in with_model(rows)] == ["later"]


def test_a_train_without_a_load_has_a_cluster_by_its_speed(tmp_path):
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, recording)
    slow, fast = (
        Cluster(f"IC3/{k}", "IC3", np.log([kmh]), np.array([[1e-3]]), 0.5, 9) for k, kmh in ((1, 80.0), (2, 160.0))
    )
    judged = replace(context(), clusters=Clusters(1, (slow, fast)))
    (passage,) = passage_unit(unit, turnout, tmp_path, judged)["passages"]  # at 44.4 m/s, 160 km/h
    assert passage["axle_load_source"] == "unavailable" and passage["cluster_id"] == "IC3/2"


def test_train_data_are_listed_beside_the_recording_and_differences_are_reported(tmp_path):
    recording, _ = on_main()
    trains = (
        "passed_at_utc,train_type,speed_kmh,axle_load_t,track,n_axles\n"
        "2024-05-13T10:00:20Z,IC3,140,12.1,main,8\n2024-05-13T10:00:25Z,freight,80,,main,60\n"
    )
    unit, turnout = lay_out(tmp_path, recording, trains=trains)
    row = passage_unit(unit, turnout, tmp_path, context())["passages"][0]
    assert row["speed_source"] == "both" and row["speed_listed_kmh"] == 140
    assert "km/h here, 140 in the train data" in row["detail"]
    assert row["train_type_source"] == "both" and row["axle_load_source"] == "timetable"
    assert row["axle_load_t"] == 12.1


def test_a_file_without_a_train_is_in_quarantine_and_has_a_rejected_passage(tmp_path):
    recording, _ = on_main()
    noise = np.random.default_rng(2).standard_normal(recording.samples.shape)
    unit, turnout = lay_out(tmp_path, replace(recording, samples=noise))
    rows = passage_unit(unit, turnout, tmp_path, context())
    assert rows["passages"][0]["status"] == "rejected" and rows["passages"][0]["reason"] == "no_train"
    assert [q["reason_code"] for q in rows["quarantine"]] == ["no_train"]
    assert rows["passage_fits"] == []


def test_a_clipped_channel_is_quarantined_by_name_and_the_others_are_fitted(tmp_path):
    recording, _ = on_main()
    samples = recording.samples.copy()
    samples[3] = np.clip(samples[3], -1.0, 1.0)
    unit, turnout = lay_out(tmp_path, replace(recording, samples=samples))
    rows = passage_unit(unit, turnout, tmp_path, context(("A7", "SP")))
    assert [(q["reason_code"], q["place"]) for q in rows["quarantine"]] == [("clipped", "record 1, A7")]
    fits = {f["channel"]: f["status"] for f in rows["passage_fits"]}
    assert fits["A7"] == "rejected" and fits["SP"] == "accepted"
    assert {fits[name] for name in set(PLACES) - set(DIVERGING) - {"A7", "SP"}} == {"peak_only"}  # no model there
    assert rows["passages"][0]["status"] == "partly"


def test_a_rolling_train_is_no_impulse_and_has_scores_nevertheless(tmp_path):
    rng = np.random.default_rng(3)
    recording = rolling_noise(rng, IC3, 40.0, list(PLACES.values()))
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    recording = replace(recording, channels=channels, started_at=datetime(2024, 5, 13, 10))
    unit, turnout = lay_out(tmp_path, recording)
    rows = passage_unit(unit, turnout, tmp_path, context())
    assert {f["status"] for f in with_model(rows)} <= {"not_an_impulse", "null_explains"}
    assert all(f["forecast_null_pct"] is not None for f in with_model(rows))


def test_the_name_of_the_file_may_state_the_time(tmp_path):
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, replace(recording, started_at=None), "20240102T030405Z")
    row = passage_unit(unit, turnout, tmp_path, context())["passages"][0]
    assert row["passed_at_utc"].replace(microsecond=0) in (datetime(2024, 1, 2, 3, 4, 6), datetime(2024, 1, 2, 3, 4, 5))


def test_a_continuous_loggers_file_gives_a_passage_per_train(tmp_path):
    """Three trains in fifty seconds: each has its own time, speed and id; the quiet times are no passages."""
    rng, length = np.random.default_rng(41), int(50.0 * 20000)
    samples = 0.003 * rng.standard_normal((len(PLACES), length))
    speeds, starts = (40.0, 44.4, 36.0), (3.0, 18.0, 33.0)
    for k, (speed, start) in enumerate(zip(speeds, starts)):
        recording, _ = on_main(seed=50 + k, speed=speed)
        first = int(start * 20000)
        samples[:, first : first + recording.n_sample] += recording.samples
    recording = replace(recording, samples=samples)
    unit, turnout = lay_out(tmp_path, recording)
    own = replace(turnout.settings["passage"], longest=20.0)
    turnout = replace(turnout, settings={**turnout.settings, "passage": own})
    rows = passage_unit(unit, turnout, tmp_path, context())
    found = rows["passages"]
    assert [p["n_axles"] for p in found] == [8, 8, 8] and len({p["passage_id"] for p in found}) == 3
    assert [p["speed_kmh"] for p in found] == pytest.approx([3.6 * v for v in speeds], rel=3e-3)
    late = [(p["passed_at_utc"] - datetime(2024, 5, 13, 10)).total_seconds() for p in found]
    assert np.diff(late) == pytest.approx(np.diff(starts), abs=0.3)
    assert len(with_model(rows)) == 3 and rows["quarantine"] == [] and len(rows["recordings"]) == 1


def test_the_id_of_a_passage_depends_on_train_data_and_fitted_sections(tmp_path):
    recording, _ = on_main()
    listed = "passed_at_utc,train_type\n2024-05-13T10:00:20Z,{}\n"
    found = {}
    for kind, names in (("IC3", ("A7",)), ("freight", ("A7",)), ("IC3", ("A7", "SP"))):
        unit, turnout = lay_out(tmp_path, recording, trains=listed.format(kind))
        rows = passage_unit(unit, turnout, tmp_path, context(names))
        (passage,) = rows["passages"]
        assert {f["passage_id"] for f in rows["passage_fits"]} == {passage["passage_id"]}
        assert rows["recordings"][0]["passage_id"] == passage["passage_id"]
        found[kind, names] = passage["passage_id"]
    assert len(set(found.values())) == 3


@pytest.mark.parametrize(("noted", "kept"), [(21.5, 21.5), (85.0, None), (999.0, None)])
def test_a_reading_of_a_broken_thermometer_is_left_out_alone(tmp_path, noted, kept):
    """85 °C is the value of a sensor that has not measured since it was switched on."""
    recording, _ = on_main()
    unit, turnout = lay_out(tmp_path, replace(recording, conditions={"rail_temperature": noted}))
    rows = passage_unit(unit, turnout, tmp_path, context())
    assert rows["passages"][0]["rail_temperature_c"] == kept and rows["passage_fits"]
    if noted > 100.0:  # readers leave out what no thermometer shows
        (row,) = rows["quarantine"]
        assert "condition_lost" in row.values() and "999" in str(row)
        return
    assert (f"rail temperature {noted:g} °C noted, not used" in str(rows["passages"][0]["detail"])) == (kept is None)


class Counted:
    """A model that counts the accesses to its time."""

    looks = 0

    def __init__(self, time):
        self.time = time

    @property
    def measured_at(self):
        Counted.looks += 1
        return self.time


def test_only_models_that_apply_to_a_file_make_its_results_outdated():
    models = tuple(SectionModel(f"m{month}", datetime(2024, month, 1), None) for month in (3, 5, 7))
    at = {"20240513T100000Z.h5": ["m5"], "20240101T000000Z.h5": ["m3"], "20240630T120000Z.h5": ["m5", "m7"]}
    for label, names in at.items():
        assert [m.model_id for m in applicable_models(models, label)] == names
    counted = tuple(Counted(datetime(2020, 1, 1) + timedelta(weeks=k)) for k in range(200))
    assert (
        applicable_models(counted, "20230101T000000Z.h5") == counted[156:157] and Counted.looks < 40
    )  # not one after the other
    for label in ("run 17.h5", "20241399T250000Z.h5"):  # its time is inside; digits that are no time
        assert applicable_models(models, label) == models
