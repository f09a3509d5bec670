"""Notes and recordings of others with missing or odd entries: used as far as possible, and reported otherwise."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import small_turnout as small

from turnout.config import load_configuration, with_raw
from turnout.errors import SimulationError
from turnout.hammer_test import find_impacts
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout import HammerInput, PassageInput, TrackCase
from turnout.mismatch.turnout.passage_observation import (
    AlignedPassage,
    observation_of,
    observe_passage,
    passage_nuisances,
)
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.priors import PASSAGE
from turnout.mismatch.turnout.receptance_observation import pairs_of_test
from turnout.mismatch.turnout.track_parameters import vehicle_with
from turnout.readers import MAX_WHOLE_FILE_SIZE, read
from turnout.readers.writing import write
from turnout.simulate import Sensor, load_vehicle
from turnout.simulate.blade import Blade
from turnout.stages import mismatch, mismatch_groups, mismatch_inputs
from turnout.stages.accept_finding import with_entry
from turnout.stages.accepted_effects import AcceptedEffect
from turnout.stages.calibrate import calibrate_to_files
from turnout.stages.mismatch_groups import groups, neighbours_of, unit_of
from turnout.stages.mismatch_inputs import MAX_SIMILAR_PASSAGES, Note, VisitInputs, _thin_out, gather_inputs
from turnout.stages.mismatch_results import Results, diagnose_turnout
from turnout.stages.mismatch_trains import train_notes, train_of
from turnout.stages.recording_choice import select_passages
from turnout.stages.recording_notes import noted_number, rail_temperature
from turnout.stages.track_files import digest_of_model, track_of
from turnout.workflow.scan import scan, unit_id


@pytest.fixture
def folder(tmp_path, repository, monkeypatch):
    """Hammer tests on a uniform turnout; with only two families of effects a diagnosis takes about a second."""
    small.write_configuration(tmp_path, repository)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mismatch, "TrackCase", partial(TrackCase, families=("local_ballast", "sensor_gain")))
    small.write_hammer_tests(tmp_path)
    return tmp_path


def turnout_in(folder):
    return with_raw(load_configuration(folder / "config").turnout("t1"), folder / "raw")


def train(row, noted, repository):
    row = {"speed_kmh": 90.0, "train_type": "locomotive", "n_axles": 4} | row
    return train_of(row, noted, repository / "config" / "vehicles")


@pytest.mark.parametrize(
    ("text", "number"), [("27.8", 27.8), ("27,8", 27.8), (12, 12.0), ("120 km/h", None), (None, None), ("nan", None)]
)
def test_a_number_in_the_notes_is_read_or_is_none(text, number):
    assert noted_number({"speed": text}, "speed") == number


def test_a_direction_is_read_in_any_capitals_and_an_unknown_one_is_reported(repository):
    """One sensor cannot determine it: a wrong direction exchanges the sides of the sensor."""
    found = train({}, {"direction": " Trailing ", "track": "Diverging"}, repository)
    assert (found.direction, found.route) == ("trailing", "diverging")
    unknown = train({"direction": "unknown"}, {"direction": "downhill"}, repository)
    assert unknown.direction == "facing" and any("direction not known" in doubt for doubt in unknown.doubts)


def test_the_noted_speed_is_used_if_impacts_between_the_axles_give_a_wrong_speed(repository):
    """With six of eight axles, 90 km/h of the notes are used; with all eight axles the recorded 74 km/h."""
    noted_values = {"speed": 25.0, "train_type": "ic3"}
    for n_recorded, speed in ((6, 25.0), (8, 74.0 / 3.6)):
        row = {"train_type": "ic3", "n_axles": n_recorded, "speed_kmh": 74.0}
        assert train(row, noted_values, repository).speed == pytest.approx(speed)


@pytest.mark.parametrize(("codes", "name", "speed"), [((), "locomotive", 40.0), (("axles_uncertain",), "ic3", 25.0)])
def test_train_data_override_a_recorded_train_with_uncertain_axles(repository, codes, name, speed):
    row = {"train_type": "locomotive", "n_axles": 4, "speed_kmh": 144.0, "speed_listed_kmh": 90.0}
    row |= {"train_type_listed": "ic3", "reason_codes": list(codes)}
    found = train(row, {}, repository)
    assert found.name == name and found.speed == pytest.approx(speed)


def test_a_recorded_train_with_uncertain_axles_is_used_without_train_data(repository):
    row = {"train_type": "locomotive", "speed_kmh": 144.0, "reason_codes": ["axles_uncertain"]}
    assert train(row, {}, repository).speed == pytest.approx(40.0)


def test_the_noted_number_of_axles_is_used_if_the_recorded_axles_match_no_train(repository):
    """Impacts at a nose add axles: eight axles over the length of two locomotives, and four are noted."""
    one, two = (load_vehicle("locomotive", 0.0, repository / "config/vehicles", n).wheel_positions for n in (1, 2))
    impacts = np.sort(np.concatenate([one, one + 0.6 * (two[-1] - one[-1])]))
    noted_values = {"speed": 35.0, "train_type": "locomotive"}
    for places, noted, axles in ((impacts, {}, 8), (impacts, {"n_axles": 4}, 4), (impacts, {"n_axles": 5}, 8)):
        row = {"n_axles": 8, "speed_kmh": 120.0, "axle_times_s": places / 35.0}
        found = train(row, noted_values | noted, repository)
        assert len(found.vehicle.wheels) == axles and found.speed == 35.0
        assert ("8 axles recorded, 4 assumed as noted" in found.doubts) == (axles == 4)
    nose = {"reason_codes": ["axles_uncertain"], "train_type": "unknown", "n_axles": 8, "speed_kmh": 161.0}
    impacts = np.sort(np.concatenate([one, one + 1.3]))  # within the length of one unit
    for places, noted, axles in ((impacts, {}, 4), (two, {}, 8), (two, {"n_axles": 4}, 4), (impacts, {"units": 2}, 8)):
        found = train(nose | {"axle_times_s": places / 35.0}, noted_values | noted, repository)
        assert len(found.vehicle.wheels) == axles and found.speed == 35.0
        assert any("8 axles recorded, 4 assumed" in doubt for doubt in found.doubts) == (axles == 4)
    row = {
        "n_axles": 8,
        "speed_kmh": 126.0,
        "axle_times_s": two / 35.0,
    }  # two units with the axle distances of the file
    assert len(train(row, noted_values | {"n_axles": 4}, repository).vehicle.wheels) == 8


@pytest.mark.parametrize(
    ("known", "listed_type", "axles"),
    [
        ({}, "ic3", 8),
        ({"train_type": "ic3"}, "ic3", 8),
        ({"train_type": "locomotive"}, "ic3", None),
        ({"n_axles": 16}, "ic3", 16),
    ],
)
def test_train_data_give_the_number_of_axles_that_the_file_does_not_state(known, listed_type, axles, tmp_path):
    rows = ({"passed_at_utc": "2024-07-16T13:00:02", "train_type": listed_type, "n_axles": "8"},)
    settings = {"passage": SimpleNamespace(train_data_tolerance=60.0)}
    turnout = SimpleNamespace(trains=rows, settings=settings)
    recording = SimpleNamespace(conditions=known, started_at=datetime(2024, 7, 16, 13, tzinfo=UTC))
    assert train_notes({}, [], recording, turnout, "p/a.h5", tmp_path).get("n_axles") == axles
    later = {"passed_at_utc": datetime(2024, 7, 16, 13, 30)}
    assert train_notes(later, [], recording, turnout, "p/a.h5", tmp_path) == known


def test_twice_as_many_impacts_as_axles_are_not_taken_as_a_second_unit(repository):
    """A deep dip gives an impact behind every axle: sixteen within the length of one unit.

    Sixteen within the length of two units are two units, also with other distances. The speed is that of the notes."""
    folder = repository / "config/vehicles"
    noted_values = {"speed": 25.0, "train_type": "ic3"}
    one, two = (load_vehicle("ic3", 0.0, folder, units).wheel_positions for units in (1, 2))
    impacts, stretched = np.sort(np.concatenate([one, one + 1.3])), two + 1.0 * np.sin(two)
    for places, axles, doubt in ((impacts, 8, True), (stretched, 16, False)):
        row = {"train_type": "ic3", "n_axles": 16, "speed_kmh": 81.0, "axle_times_s": places / 25.0}
        found = train(row, noted_values, repository)
        assert len(found.vehicle.wheels) == axles and found.speed == 25.0
        assert ("16 axles recorded, 8 assumed by its length" in found.doubts) == doubt
    row |= {"speed_kmh": 90.0, "axle_times_s": two / 25.0}
    found = train(row, noted_values, repository)
    assert len(found.vehicle.wheels) == 16 and not any("axles" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("known", [{"axle_load_t": 14.0}, {"load_share": 0.4}, {}])
def test_the_prior_of_an_unknown_load_spans_empty_to_full(repository, known):
    """The sd of a uniform prior is half of its width over the root of 3. A known load has an sd of 5 %."""
    folder = repository / "config/vehicles"
    row = {"train_type": "freight", "n_axles": None} | {k: v for k, v in known.items() if k == "axle_load_t"}
    found = train(row, {k: v for k, v in known.items() if k == "load_share"}, repository)
    passage = PassageInput("p", None, found.vehicle, found.speed, load_sd=found.load_sd)
    load = next(n for n in passage_nuisances(passage) if n.name == "load@p")
    if known:
        assert load == Nuisance("load@p", "-", 0.0, 0.05, "p", group="load")
        return
    half, full = (load_vehicle("freight", share, folder) for share in (0.5, 1.0))
    heavier = vehicle_with(half, {}, "freight", np.sqrt(3.0) * load.sd)  # as far as the assumption goes
    assert np.sum(heavier.static_loads) == pytest.approx(np.sum(full.static_loads), rel=1e-6)
    assert load.sd > 0.2 and load.bounds == (-2.0 * load.sd, 2.0 * load.sd)


def test_a_passage_with_an_unreadable_temperature_is_used(folder):
    small.write_passages(
        folder, speeds=(100.0,), change=lambda r: replace(r, conditions={**r.conditions, "rail_temperature": "?"})
    )
    assert [f["n_passages"] for f in diagnose_turnout("t1")["mismatch_findings"]] == [1]


def test_a_turnout_without_a_track_file_gives_a_row_of_the_quarantine(folder):
    """It is no fault of the program: the run of the other turnouts continues."""
    (folder / "config/tracks/small.yaml").unlink()
    turnout = turnout_in(folder)
    unit = unit_of("t1", "2026-07-25", scan(turnout, folder / "raw").units, turnout.hashes["mismatch"])
    (row,) = mismatch.mismatch_unit(unit, turnout, folder / "raw")["quarantine"]
    assert row["reason_code"] == "simulation_failed" and "without a track nothing can be simulated" in row["found"]


def test_a_change_of_the_notes_gives_another_finding(folder):
    """The same files with a corrected temperature: the stored result of an earlier run is not used."""
    notes = folder / "raw/t1/campaigns.csv"
    found = []
    for temperature in ("11.0", "25.0"):
        notes.write_text(f"campaign,started_at_utc,rail_temperature_c\n2026-07-25,2026-07-25T09:00:00Z,{temperature}\n")
        found.append(diagnose_turnout("t1")["mismatch_findings"][0]["finding_id"])
    assert found[0] != found[1] == diagnose_turnout("t1")["mismatch_findings"][0]["finding_id"]


def test_other_content_of_the_same_size_gives_another_finding(folder):
    """A corrected file replaces the old one: name, size and notes are the same."""
    (file, _) = sorted((folder / "raw/t1/hammer").rglob("*.h5"))
    first, size = diagnose_turnout("t1")["mismatch_findings"][0]["finding_id"], file.stat().st_size
    small.write_hammer_tests(folder, seed=7)
    assert file.stat().st_size == size
    assert diagnose_turnout("t1")["mismatch_findings"][0]["finding_id"] != first


def test_the_temperature_in_the_files_is_their_median():
    recordings = [SimpleNamespace(conditions={"rail_temperature": t}) for t in ("11,5", "?", 14.0, 30)]
    assert rail_temperature(recordings) == 14.0 and rail_temperature(recordings[1:2]) is None


def test_a_change_of_an_extended_track_file_changes_the_digest(folder):
    tracks = folder / "config/tracks"
    (tracks / "ground.yaml").write_text((tracks / "small.yaml").read_text())
    (tracks / "t1.yaml").write_text("extends: ground\n")
    turnout, before = turnout_in(folder), digest_of_model(turnout_in(folder))
    with open(tracks / "ground.yaml", "a", encoding="utf-8") as file:
        file.write("# measured again\n")
    assert digest_of_model(turnout) != before


def test_a_section_on_a_route_that_the_track_lacks_is_reported_and_not_used(folder):
    """A hammer test on the diverging track is not simulated on the main track."""
    layout = folder / "config/layouts/small.yaml"
    layout.write_text(layout.read_text().replace("B: {panel: CP, track: main", "B: {panel: AS, track: diverging"))
    turnout = turnout_in(folder)
    tests = [HammerInput(f"{k} x", small.PLACES[k], (), "force", "x", {}) for k in ("A", "B")]
    found = VisitInputs(tests, {t.name: t.name[0] for t in tests})
    made = list(groups(turnout, track_of(turnout)[0], found))
    assert [g.labels for g in made] == [("A",)]
    assert [str(note) for note in found.notes] == ["sections B: the track's file has no route diverging; not used"]


def test_a_case_in_a_switch_has_a_third_of_the_axles(folder, monkeypatch):
    """An axle needs three times as much computation there; given limits are not changed."""
    limits = []
    monkeypatch.setattr(mismatch_groups, "_campaign", lambda *arguments: limits.append(arguments[-1]))
    turnout = turnout_in(folder)
    plain = track_of(turnout)[0]
    switch = plain.with_track(blade=Blade(12.0, 17.0, 22.0, plain.track.rail, 3e8, 3e4))
    for track, given in ((plain, None), (switch, None), (switch, (60, 1000))):
        assert list(groups(turnout, track, VisitInputs([], {}), limits=given)) == []
    assert dict.fromkeys(limits) == dict.fromkeys([(8, 96), (8, 32), (60, 1000)])


def test_the_result_of_the_newest_recordings_is_used(tmp_path, monkeypatch):
    def row(name, day):
        return {"finding_id": name, "found_at_utc": datetime(2026, day, 1), "term_json": "[]"}

    results = Results(tmp_path, "t1")
    results.save({"mismatch_findings": [row("july", 7)]})
    for month, name in ((5, "july"), (10, "other")):
        monkeypatch.setattr(Results, "_registry_rows", lambda self, month=month: [row("other", month)])
        assert results.finding()["finding_id"] == name


@pytest.mark.parametrize(
    "edit",
    [
        lambda text: text.replace('"none"', '"named"'),
        lambda text: text.replace('"verdict"', '"verdikt"'),
        lambda text: text[:-9],
        lambda text: text.partition("\n")[2],  # as an earlier version wrote it
        lambda text: "[1, 2]",
        lambda text: "",
    ],
)
def test_a_stored_result_that_was_edited_or_damaged_is_rejected(tmp_path, edit):
    row = {"finding_id": "a", "found_at_utc": "2026-07-01", "term_json": "[]", "verdict": "none"}
    results = Results(tmp_path, "t1")
    results.save({"mismatch_findings": [row]})
    assert results.finding()["verdict"] == "none"
    results.path.write_text(edit(results.path.read_text()))
    with pytest.raises(SimulationError, match=r"t1\.json: it is damaged, was edited, .* Run turnout diagnose"):
        results.finding()


def test_corrugation_at_another_position_is_another_entry():
    text = "name: a\nterms:\n  - term: rail_corrugation\n    start: 10\n    end: 14\n"
    both = with_entry(text, "  - term: rail_corrugation\n    start: 30\n    end: 34\n")
    assert both.count("rail_corrugation") == 2
    assert with_entry(both, "  - term: rail_corrugation\n    start: 30\n    end: 34\n").count("rail_corrugation") == 2
    accepted = AcceptedEffect("rail_corrugation", {"start": 10.0, "end": 14.0}, {"sine": (1e-5, 1e-6)})
    assert accepted.is_of("rail_corrugation", {"place": 12.0, "wavelength": 0.3})
    assert not accepted.is_of("rail_corrugation", {"place": 32.0, "wavelength": 0.3})


WARM = {None: (25.0, None), "as warm": (25.0, 27.0), "warmer": (10.0, 25.0)}


@pytest.mark.parametrize(("case_name", "offered"), [(None, False), ("as warm", False), ("warmer", True)])
def test_pad_temperature_is_a_candidate_only_if_temperatures_are_known_and_differ(case_name, offered):
    """Recordings at one temperature cannot distinguish a soft pad from a warm pad."""
    campaign = measured_campaign(small_plan((15.0,), passages=False, hammer_positions=(21.6, 24.0)), (), 3)
    tests = tuple(
        replace(t, conditions={} if w is None else {"rail_temperature": w})
        for t, w in zip(campaign.hammer, WARM[case_name])
    )
    case = TrackCase(replace(campaign, hammer=tests), families=("pad_temperature", "zener_pad"))
    assert ("pad_temperature" in {c.family for c in case.candidates}) == offered
    assert "zener_pad" in {c.family for c in case.candidates}


@pytest.mark.parametrize("rate", [500.0, 1e3, 1e4])
def test_passages_of_slow_loggers_are_resampled_correctly(rate):
    """Three tones in the band, sampled in the middle of steps: at the times of the observation to 1 %."""
    found, exact = _tones_at(rate)
    assert np.linalg.norm(found - exact) < 0.01 * np.linalg.norm(exact)


def test_a_train_outside_its_recording_is_reported_and_the_impacts_are_used(monkeypatch):
    def nowhere(*_):
        raise SimulationError("the train lies outside the recording")

    monkeypatch.setattr("turnout.mismatch.turnout.passage_observation.observe_passage", nowhere)
    case = TrackCase(measured_campaign(small_plan((15.0,), (40.0,), hammer_positions=(24.0,)), (), 5), families=())
    assert not case.aligned_passages and case.observations
    assert any("outside the recording" in note for note in case.notes)


def test_a_logger_that_is_too_slow_for_the_band_is_rejected():
    with pytest.raises(SimulationError, match="200 samples per second are too few for 107 Hz"):
        _tones_at(200.0)


def _tones_at(rate):
    """(data, expected data) of a passage at 40 m/s whose sensors record tones, without the edges."""
    passage = measured_campaign(small_plan((15.0,), (40.0,), hammer_positions=()), (), 5).passages[0]
    sensors = small_plan().sensors
    n = round(passage.recording.duration * rate)

    def tones(t):
        return sum(a * np.sin(2.0 * np.pi * f * t + a) for f, a in ((23.0, 1.0), (61.0, 0.7), (98.0, 1.3)))

    samples = np.tile(tones((np.arange(n) + 0.5) / rate), (len(passage.recording.channels), 1))
    recorded_passage = replace(passage, recording=replace(passage.recording, samples=samples, rate=rate))
    made, observation = observe_passage(recorded_passage, sensors, 0.9, passage.speed, 0.06)
    data = observation.data.reshape(len(sensors), -1)
    inside = slice(data.shape[1] // 4, -data.shape[1] // 4)
    return data[:, inside], np.tile(tones(made.time), (len(sensors), 1))[:, inside]


def test_the_notes_of_a_group_are_listed_before_those_of_others():
    from turnout.stages.mismatch_rows import _visit_notes

    notes = [*(Note("load not known", f"{k}") for k in range(20)), Note("section C: elsewhere")]
    campaign = SimpleNamespace(passages=[SimpleNamespace(name="17")])
    assert _visit_notes({"notes": notes}, campaign)[:2] == ["passage 17: load not known", "section C: elsewhere"]


def test_the_number_of_omitted_notes_is_stated():
    from turnout.stages.mismatch_rows import MAX_NOTES, _first_notes

    notes = [f"note {k}" for k in range(MAX_NOTES + 3)]
    assert _first_notes(notes) == [*notes[:MAX_NOTES], "and 3 more"]
    assert _first_notes(notes[:MAX_NOTES]) == notes[:MAX_NOTES]


def test_a_passage_with_the_minimum_number_of_samples_is_an_observation():
    """It is shorter than the window of the amplitude, so the amplitude is that of all samples."""
    rng, time = np.random.default_rng(0), np.arange(PASSAGE.min_samples) / 300.0
    vehicle = SimpleNamespace(wheel_positions=np.zeros(1), static_loads=[1e5])
    passage = PassageInput("p", None, vehicle, 30.0, "x")
    sensors = tuple(SimpleNamespace(name=f"S{k}", place=0.6 * k) for k in range(2))
    data = rng.normal(size=(2, PASSAGE.min_samples))
    found = observation_of(AlignedPassage("p", passage, sensors, time, 0.04, 30.0), data, np.zeros(2), 0.06)
    assert found.data.size == 2 * PASSAGE.min_samples and np.all(found.sigma > 0.02 * np.std(data, axis=1).min())


def test_sections_that_the_user_selects_are_diagnosed_together():
    """Two sections 13 m apart are two groups of a turnout, and one group if the user selects them."""
    places = {"A": 2.0, "B": 15.0, "C": 40.0}
    sections = [SimpleNamespace(label=n, position=x, track="main") for n, x in places.items()]
    turnout = SimpleNamespace(sections=sections)
    assert list(neighbours_of(turnout, ())) == [("main", ("A",)), ("main", ("B",)), ("main", ("C",))]
    assert list(neighbours_of(turnout, ("A", "B"))) == [("main", ("A", "B"))]


def test_a_month_of_passages_keeps_the_extremes_of_speed_of_each_train():
    """A case chooses the same passages from the kept ones as from all of them."""
    rng, passages, every = np.random.default_rng(1), [], []
    for k in range(200):
        vehicle, recording = SimpleNamespace(wheels=range(8)), SimpleNamespace(channels=())
        name = ("ic3", "freight")[k % 2]
        new = PassageInput(f"{k}", recording, vehicle, float(rng.uniform(20.0, 45.0)), name, "facing", "main", {})
        every.append(new)
        passages.append(new)
        _thin_out(passages)
    assert len(passages) == 2 * MAX_SIMILAR_PASSAGES
    assert {p.name for p in select_passages(passages)} == {p.name for p in select_passages(every)}


@pytest.fixture
def logged(folder):
    """Two trains in one file, with 70 s of noise before, between and after them."""
    small.write_passages(folder, speeds=(80.0, 110.0), vehicle="locomotive")
    files = sorted((folder / "raw/t1/passages").iterdir())
    turnout = turnout_in(folder)
    parts = [read(f"t1/passages/{f.name}", folder / "raw", turnout.passages.description).recordings[0] for f in files]
    rng, rate = np.random.default_rng(0), parts[0].rate

    def noise(seconds):
        return 0.02 * rng.standard_normal((len(parts[0].channels), round(seconds * rate)))

    samples = np.concatenate([noise(70), parts[0].samples, noise(70), parts[1].samples, noise(70)], axis=1)
    for file in files[1:]:
        file.unlink()
    noted = {k: v for k, v in parts[0].conditions.items() if k == "train_type"}
    write([replace(parts[0], samples=samples, conditions=noted)], files[0], "hdf5", single=True)
    return folder


def gathered(folder, kind="passage"):
    turnout = turnout_in(folder)
    units = [u for u in scan(turnout, folder / "raw").units if u.kind == kind]
    return gather_inputs(units, turnout, folder / "raw", track_of(turnout)[0], {})


@pytest.mark.parametrize("held", [MAX_WHOLE_FILE_SIZE, 0])
def test_both_trains_of_a_continuous_recording_are_used(logged, monkeypatch, held):
    """Each train is a separate passage, also in a file that is too large to be read as a whole."""
    monkeypatch.setattr(mismatch_inputs, "read", partial(read, max_whole_file_size=held))
    found = gathered(logged)
    assert [round(3.6 * p.speed, -1) for p in found.passages] == [80.0, 110.0], found.notes
    assert len({p.name for p in found.passages}) == 2 and not [n for n in found.notes if "trains in it" in n.text]


def test_passages_without_a_clear_row_of_the_passage_stage_are_reported_and_not_used(logged, monkeypatch):
    """The passage stage lost the first of two trains: its only row could give a train the wrong speed and load."""
    plain = mismatch_inputs.passage_unit

    def lost(*arguments, **more):
        tables = plain(*arguments, **more)
        return {**tables, "passages": tables["passages"][1:]}

    monkeypatch.setattr(mismatch_inputs, "passage_unit", lost)
    found = gathered(logged)
    assert not found.passages and len([n for n in found.notes if "speed is not known" in n.text]) == 2
    assert [n for n in found.notes if "2 trains in it, 1 where passages were analysed" in n.text]


def gathered_with(folder, quarantine=(), **facts):
    """Inputs from the only passage, with facts that the passage stage states about it."""
    turnout = turnout_in(folder)
    (unit,) = (u for u in scan(turnout, folder / "raw").units if u.kind == "passage")
    tables = mismatch_inputs.passage_unit(unit, turnout, folder / "raw")
    tables = {"passages": [row | facts for row in tables["passages"]], "quarantine": list(quarantine)}
    return gather_inputs([unit], turnout, folder / "raw", track_of(turnout)[0], {unit_id(unit): tables})


@pytest.mark.parametrize(
    ("channels", "used"), [(["B"], ["A"]), (["A7"], ["A", "B"]), (["A", "B"], []), (None, ["A", "B"])]
)
def test_channels_that_the_passage_stage_excludes_are_not_used(folder, channels, used):
    """The channels are a list: two exchanged channels are two entries, and A7 is not A."""
    small.write_passages(folder, speeds=(100.0,))
    found = gathered_with(folder, [{"reason_code": "channels_swapped", "channels": channels, "place": "record 1, A"}])
    assert [c.name for p in found.passages for c in p.recording.channels] == used
    assert any("not used (channels_swapped)" in n.text for n in found.notes) == (len(used) < 2)


@pytest.mark.parametrize(("codes", "used"), [(["train_cut_off", "two_trains"], 0), (["train_cut_off"], 1), (None, 1)])
def test_two_trains_at_the_same_time_are_not_simulated_whatever_the_first_reason(folder, codes, used):
    small.write_passages(folder, speeds=(100.0,))
    found = gathered_with(folder, reason_codes=codes, detail="another train at about 90 km/h, facing")
    assert len(found.passages) == used
    assert [n.text for n in found.notes if "two trains" in n.text] == ["two trains at the same time, not used"] * (
        1 - used
    )


def test_results_of_an_earlier_version_without_reason_codes_are_computed_again(monkeypatch):
    results = [
        SimpleNamespace(unit="t1/passage/old", tables={"passages": [{"passage_id": "a", "status": "partly"}]}),
        SimpleNamespace(unit="t1/passage/new", tables={"passages": [{"passage_id": "b", "reason_codes": []}]}),
    ]
    monkeypatch.setattr(mismatch_inputs, "current_results", lambda *_: iter(results))
    assert set(mismatch_inputs.mismatch_context("t1")[1]) == {"t1/passage/new"}


@pytest.mark.parametrize(("softest", "used"), [(50.0, True), (50_000.0, False)])
def test_impacts_are_accepted_by_the_same_settings_as_in_the_hammer_stage(folder, softest, used):
    """Both use the settings of the turnout, so both reject the same impacts as too soft."""
    file = folder / "config/config.yaml"
    file.write_text(file.read_text() + f"receptance: {{minimum_peak_force: {softest:g}}}\n")
    tests = gathered(folder, "hammer").tests
    turnout = turnout_in(folder)
    force, response = turnout.hammer.force["A"], turnout.hammer.response["A"]
    for test in tests:
        judged = find_impacts(test.recordings, force, response, turnout.settings["receptance"])
        assert any(i.accepted for i in judged) is used
        assert bool(pairs_of_test(test, [Sensor(response, test.place)], 0.03)) is used
    assert tests


def test_a_hammer_test_with_a_faulty_response_is_used_with_its_other_responses(folder):
    """Only a fault of the force removes a record; a fault of one response removes this response."""
    turnout = turnout_in(folder)
    response = turnout.hammer.response["A"]
    for path in (folder / "raw/t1/hammer").rglob("A_*.h5"):
        recordings = read(path, folder / "raw", turnout.hammer.descriptions["A"]).recordings
        spoilt = []
        for recording in recordings:
            row = recording.index(response)
            other = replace(recording.channels[row], name="other")
            samples = np.vstack([recording.samples, recording.samples[row]])
            samples[row] = 0.0
            spoilt.append(replace(recording, samples=samples, channels=(*recording.channels, other)))
        path.unlink()
        write(spoilt, path, "hdf5")
    layout, rail = folder / "config/layouts/small.yaml", "    rail: {source: rail, quantity: acceleration, unit: m/s²"
    named = layout.read_text().replace(rail, rail.replace("rail", "other") + ", mounting: rail web}\n" + rail)
    layout.write_text(named)
    found = gathered(folder, "hammer")
    (test,) = (t for t in found.tests if t.name.startswith("A "))
    assert {c.name for r in test.recordings for c in r.channels} == {"force", "other"}
    assert any(response in note.text for note in found.notes)


def test_spikes_in_recordings_are_replaced_and_stated_once_for_each_channel(folder):
    def spoil(recording):
        samples = recording.samples.copy()
        samples[0, [200, 400, 600]] = 1e4
        return replace(recording, samples=samples)

    small.write_passages(folder, speeds=(100.0, 110.0), change=spoil)
    found = gathered(folder, "passage")
    assert all(np.abs(p.recording.samples).max() < 1e3 for p in found.passages) and len(found.passages) == 2
    (note,) = (n.text for n in found.notes if "stand out" in n.text)
    assert "3 samples replaced" in note and "Other records with this fault: 1." in note


def test_hum_of_all_channels_is_subtracted_and_stated_once(folder):
    def hum(recording):
        line = 2.0 * np.sin(2.0 * np.pi * 50.0 * np.arange(recording.n_sample) / recording.rate)
        return replace(recording, samples=recording.samples + line)

    small.write_passages(folder, speeds=(100.0, 110.0))
    bare = {p.name: p.recording.samples for p in gathered(folder, "passage").passages}
    small.write_passages(folder, speeds=(100.0, 110.0), change=hum)
    found = gathered(folder, "passage")
    (note,) = (n.text for n in found.notes if "hum" in n.text)
    assert "line of 50.0 Hz subtracted" in note and "Other records with this fault: 1." in note
    for passage in found.passages:
        assert np.max(np.abs(passage.recording.samples - bare[passage.name])) < 0.2


def test_a_rail_temperature_that_no_rail_has_is_stated_once(folder):
    """29.5 °C are 85.1 degrees Fahrenheit; a broken thermometer notes 85."""
    hot = {"rail_temperature": 85.1}
    small.write_passages(folder, speeds=(100.0, 110.0), change=lambda r: replace(r, conditions={**r.conditions, **hot}))
    found = gathered(folder, "passage")
    assert len(found.passages) == 2 and not any("rail_temperature" in p.conditions for p in found.passages)
    (note,) = (n.text for n in found.notes if "rail temperature" in n.text)
    assert "85.1 °C" in note and "Other records with this fault: 1." in note


def test_a_calibration_accepts_impacts_by_the_settings_of_the_turnout(folder):
    file, track = folder / "config/config.yaml", folder / "config/tracks/small.yaml"
    file.write_text(file.read_text() + "receptance: {minimum_peak_force: 50000}\n")
    files = sorted((folder / "raw/t1/hammer").rglob("A_*"))
    with pytest.raises(SimulationError, match="calibration of A: 0 accepted impacts"):
        calibrate_to_files(str(track), "A", files, "t1", folder / "config")


def test_a_calibration_replaces_spikes_and_states_them(folder, monkeypatch, caplog):
    file = sorted((folder / "raw/t1/hammer").rglob("A_*"))[0]
    turnout = turnout_in(folder)
    result = read(file.name, file.parent, turnout.hammer.descriptions["A"])
    recording, *others = result.recordings
    samples = recording.samples.copy()
    at = recording.index("rail"), int(0.8 * samples.shape[1])
    samples[at] = 3.0 * np.abs(samples[at[0]]).max()
    write([replace(recording, samples=samples), *others], file, "hdf5")
    used = []
    monkeypatch.setattr("turnout.stages.calibrate.find_impacts", lambda recordings, *_: used.extend(recordings) or [])
    track = folder / "config/tracks/small.yaml"
    with pytest.raises(SimulationError, match="0 accepted impacts"):
        calibrate_to_files(str(track), "A", [file], "t1", folder / "config")
    assert abs(used[0].samples[at]) < 0.1 * abs(samples[at])
    assert f"{file.name}, record 1: rail: 1 sample replaced" in caplog.text


def test_files_that_a_calibration_cannot_use_are_reported(folder, tmp_path, caplog):
    """Without the layout of the turnout, no channel of the file is known."""
    track = folder / "config/tracks/small.yaml"
    files = sorted((folder / "raw/t1/hammer").rglob("A_*"))
    with pytest.raises(SimulationError, match=r"no record can be used\. .*there is no channel 'hammer'"):
        calibrate_to_files(str(track), "A", files[:1])
    damaged = tmp_path / files[0].name
    damaged.write_bytes(files[0].read_bytes()[:-200])
    # the impacts are read; the small track has no sections
    with pytest.raises(SimulationError, match="no section 'A'"):
        calibrate_to_files(str(track), "A", [*files, damaged], "t1", folder / "config")
    assert damaged.name in caplog.text and "not used" in caplog.text
