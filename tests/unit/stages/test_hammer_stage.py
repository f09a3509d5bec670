"""The whole hammer stage from files to rows, compared with true values that the stage never gets."""

import json
from collections import Counter
from dataclasses import replace
from datetime import date, datetime

import h5py
import numpy as np
import pytest
from benchmarks.published.models import published_model
from benchmarks.published.response import paper_response

from turnout.config import load_configuration, with_raw
from turnout.demo.hammer import hammer_test
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import Impact
from turnout.registry.intake import Arrival, gather
from turnout.signal.cleaning import without_artefacts
from turnout.stages.hammer import hammer_unit
from turnout.stages.hammer_curve_rows import density_columns
from turnout.workflow.guard import compute_guarded, status_of
from turnout.workflow.scan import scan

DAY = date(2024, 5, 13)
EXTENSIONS = {"uff58b": "uff", "tdms": "tdms", "hdf5": "h5"}


def write_tests(raw, section="A7", file_format="hdf5", n_test=3, ballast=1.0, railpad=1.0, seed=5, change=None):
    """Write files of one section and campaign of tommerup_s1; return its unit, configuration and true impacts."""
    folder = raw / "tommerup_s1" / "hammer" / DAY.isoformat()
    folder.mkdir(parents=True)
    rng, truth = np.random.default_rng(seed), []
    for test in range(1, n_test + 1):
        recordings, impacts = hammer_test(paper_response(section, ballast, railpad), 12.0, DAY, test, rng)
        if change is not None:
            recordings = change(test, recordings)
        write(recordings, folder / f"{section}_{test}.{EXTENSIONS[file_format]}", file_format)
        truth += impacts
    notes = (
        "campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator\n2024-05-13,2024-05-13T09:00:00,12.0,,,\n"
    )
    (raw / "tommerup_s1" / "campaigns.csv").write_text(notes)
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), raw)
    return scan(turnout, raw).units[0], turnout, truth


@pytest.fixture(autouse=True)
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


@pytest.mark.parametrize("file_format", EXTENSIONS)
def test_modes_are_within_five_standard_errors_of_the_true_values(tmp_path, file_format):
    unit, turnout, _ = write_tests(tmp_path, "A7", file_format, ballast=1.21, railpad=0.81)
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    modes = {m["band"]: m for m in rows["modes"]}
    model = published_model("CP A7")
    # a resonance is proportional to the square root of the stiffness: 1.1 and 0.9
    for band, frequency, factor, damping in zip(model.bands, model.frequency, (1.1, 0.9), model.damping):
        mode = modes[band]
        assert abs(mode["frequency_hz"] - factor * frequency) < 5 * mode["frequency_se_hz"]
        assert abs(mode["damping_ratio"] - damping) < 5 * mode["damping_se"]
        # poles differ by 0.6 % between impacts, so the standard error of the mean of 30 is 0.1 % or more
        assert 0.0005 < mode["frequency_se_hz"] / mode["frequency_hz"] < 0.005
        assert mode["rail_temperature_c"] == 12.0


def test_every_faulty_impact_is_rejected_with_a_reason_and_nearly_all_others_are_accepted(tmp_path):
    unit, turnout, truth = write_tests(tmp_path, "OT", seed=11)
    fault = {(b.test, b.record): b.fault for b in truth}
    assert sum(bool(f) for f in fault.values()) >= 1, "the seed must give at least one faulty impact"
    impacts = hammer_unit(unit, turnout, tmp_path, algo="1")["impacts"]
    assert len(impacts) == 30
    for impact in impacts:
        true_fault = fault[impact["test"], impact["record"]]
        if true_fault:
            assert impact["status"] == "rejected" and impact["reason"], (impact, true_fault)
    without_fault = [i for i in impacts if not fault[i["test"], i["record"]]]
    assert np.mean([i["status"] == "accepted" for i in without_fault]) >= 0.95


def test_a_dead_channel_removes_one_file_and_the_quarantine_states_a_remedy(tmp_path):
    from turnout.demo import scenario

    def change(test, recordings):
        return [scenario.dead_channel(r) for r in recordings] if test == 2 else recordings

    unit, turnout, _ = write_tests(tmp_path, "CLP", change=change)
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert {q["reason_code"] for q in rows["quarantine"]} == {"dead_channel"}
    assert all("CLP_2" in q["path"] and q["remedy"] for q in rows["quarantine"])
    assert [q["record"] for q in rows["quarantine"]] == list(range(10))
    assert rows["models"][0]["status"] == "accepted" and len(rows["impacts"]) == 20


@pytest.mark.parametrize("is_force", [True, False])
def test_spikes_change_no_mode_and_are_stated(tmp_path, is_force):
    """Six samples of each record of one file are wrong, by 1.5 times the peak of the force or of the response."""

    def spoil(test, recordings):
        spoilt = []
        for recording in recordings:
            samples, row = recording.samples.copy(), [c.quantity == "force" for c in recording.channels].index(is_force)
            at = np.random.default_rng(recording.record).choice(np.arange(40, samples.shape[1] - 40, 40), 6, False)
            samples[row, at] += 1.5 * np.abs(samples[row]).max()
            spoilt.append(replace(recording, samples=samples))
        return spoilt if test == 2 else recordings

    rows = []
    for name, change in (("clean", None), ("spoilt", spoil)):
        unit, turnout, _ = write_tests(tmp_path / name, "A8", change=change)
        rows.append(hammer_unit(unit, turnout, tmp_path / name, algo="1"))
    clean, spoilt = rows
    assert [(q["reason_code"], q["measured_value"]) for q in spoilt["quarantine"]] == [("spikes", 6.0)] * 10
    assert all("A8_2" in q["path"] and len(q["channels"]) == 1 for q in spoilt["quarantine"])
    assert status_of(spoilt) == "ok"  # all records are used
    assert [i["status"] for i in spoilt["impacts"]] == [i["status"] for i in clean["impacts"]]
    for mode, other in zip(clean["modes"], spoilt["modes"], strict=True):
        assert abs(mode["frequency_hz"] - other["frequency_hz"]) < 0.1 * mode["frequency_se_hz"]


@pytest.mark.parametrize(("amplitude", "reasons"), [(3.0, set()), (20.0, {"mains_hum"})])
def test_hum_changes_no_mode_and_strong_hum_is_stated(tmp_path, amplitude, reasons):
    """The responses have peaks of 190 to 310 m/s²: 2 % of these, 4 to 6 m/s², are worth a row."""

    def hum(test, recordings):
        changed = []
        for k, r in enumerate(recordings):
            line = amplitude * np.sin(2 * np.pi * 50.02 * np.arange(r.n_sample) / r.rate + 1.7 * k)
            hums = np.array([c.quantity == "acceleration" for c in r.channels])
            changed.append(replace(r, samples=r.samples + hums[:, None] * line))
            assert [f.reason for f in without_artefacts(changed[-1])[1]] == ["mains_hum"]
        return changed

    rows = []
    for name, change in (("clean", None), ("hum", hum)):
        unit, turnout, _ = write_tests(tmp_path / name, "A8", change=change)
        rows.append(hammer_unit(unit, turnout, tmp_path / name, algo="1"))
    clean, hums = rows
    assert {q["reason_code"] for q in hums["quarantine"]} == reasons and status_of(hums) == "ok"
    assert [i["status"] for i in hums["impacts"]] == [i["status"] for i in clean["impacts"]]
    for mode, other in zip(clean["modes"], hums["modes"], strict=True):
        assert abs(mode["frequency_hz"] - other["frequency_hz"]) < 0.2 * mode["frequency_se_hz"]


def test_an_impact_that_the_modes_do_not_describe_is_rejected_and_not_counted(tmp_path):
    """Only one impact of ten has a resonance of 1350 Hz, at half of the peak, as from a hit elsewhere."""

    def change(_, recordings):
        first = recordings[0]
        samples, row = first.samples.copy(), first.index(next(c.name for c in first.channels if c.quantity != "force"))
        top = int(np.argmax(np.abs(samples[row])))
        t = np.arange(samples.shape[1] - top) / first.rate
        ring = 0.5 * np.abs(samples[row]).max() * np.exp(-60.0 * t) * np.sin(2 * np.pi * 1350.0 * t)
        samples[row, top:] += ring
        return [replace(first, samples=samples), *recordings[1:]]

    unit, turnout, _ = write_tests(tmp_path, "A7", n_test=1, change=change)
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    odd = [i for i in rows["impacts"] if i["record"] == 0]
    assert [(i["status"], i["reason"]) for i in odd] == [("rejected", "odd_one_out")]
    used = {i["impact_id"] for i in rows["impacts"] if i["status"] == "accepted"}
    (model,) = rows["models"]
    assert (model["n_impacts_used"], model["n_impacts_rejected"]) == (len(used), 10 - len(used))
    assert {r["n_impacts"] for r in (*rows["modes"], *rows["receptances"])} == {len(used)}
    assert {r["impact_id"] for r in rows["impact_modes"]} == used


def test_rates_that_differ_only_by_rounding_are_one_rate(tmp_path):
    rates = iter([20000.0, 20000.000000004, 20000.0000013])
    unit, turnout, _ = write_tests(
        tmp_path, "A7", change=lambda _, rs: (lambda r: [replace(x, rate=r) for x in rs])(next(rates))
    )
    descriptions = dict(turnout.hammer.descriptions) | {"A7": replace(turnout.hammer.descriptions["A7"], rate=None)}
    turnout = replace(turnout, hammer=replace(turnout.hammer, descriptions=descriptions))
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert rows["quarantine"] == [] and len(rows["impacts"]) == 30
    assert rows["models"][0]["sampling_rate_hz"] == pytest.approx(20000.0, rel=1e-9)


def test_a_file_with_another_day_is_used_and_reported(tmp_path):
    """The clock of the logger may have been wrong although its data are right."""

    def change(test, recordings):
        return [replace(r, started_at=datetime(2010, 1, 1)) for r in recordings] if test == 2 else recordings

    unit, turnout, _ = write_tests(tmp_path, "A7", change=change)
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert [(q["reason_code"], "A7_2" in q["path"]) for q in rows["quarantine"]] == [("start_unknown", True)]
    assert len(rows["impacts"]) == 30 and rows["models"][0]["measured_at_utc"] == datetime(2024, 5, 13, 9)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_force_beyond_any_hammer_is_rejected_with_the_reason(tmp_path, factor):
    """Newtons stated as kilonewtons, and kilonewtons stated as newtons."""

    def change(_, recordings):
        return [
            replace(r, samples=r.samples * [[factor if c.quantity == "force" else 1.0] for c in r.channels])
            for r in recordings
        ]

    unit, turnout, _ = write_tests(tmp_path, "A7", n_test=1, change=change)
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert {i["reason"] for i in rows["impacts"]} == {"out_of_scale"} and rows["models"][0]["status"] == "rejected"
    assert all("scale" in i["detail"] for i in rows["impacts"])


def test_a_small_force_is_accepted_if_the_configuration_allows_it(tmp_path):
    def change(_, recordings):
        return [
            replace(r, samples=r.samples * [[1e-3 if c.quantity == "force" else 1.0] for c in r.channels])
            for r in recordings
        ]

    unit, turnout, _ = write_tests(tmp_path, "A7", n_test=1, change=change)
    settings = {**turnout.settings, "receptance": replace(turnout.settings["receptance"], minimum_peak_force=0.0)}
    rows = hammer_unit(unit, replace(turnout, settings=settings), tmp_path, algo="1")
    assert rows["models"][0]["status"] == "accepted"


def test_no_impact_is_lost_if_the_number_of_a_test_is_a_time_stamp(tmp_path):
    """Fourteen digits exceed a column of 32 bits; the largest number that fits is kept."""
    unit, turnout, _ = write_tests(tmp_path, "A7")
    folder = tmp_path / "tommerup_s1/hammer" / DAY.isoformat()
    for test, label in ((1, "20240513101500"), (2, "2147483648"), (3, "2147483647")):
        (folder / f"A7_{test}.h5").rename(folder / f"A7_{label}.h5")
    (unit,) = scan(turnout, tmp_path).units
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    arrival = Arrival(0, "tommerup_s1/hammer/A7/2024-05-13", "tommerup_s1", "hammer", "key", "1", rows)
    gathered, rejected_rows = gather("impacts", [arrival])
    assert rejected_rows == [] and gathered.num_rows == len(rows["impacts"]) == 30
    assert Counter(row["test"] for row in rows["impacts"]) == {0: 20, 2**31 - 1: 10}


def test_a_reversed_force_is_rejected_with_the_reason(tmp_path):
    from turnout.demo import scenario

    unit, turnout, _ = write_tests(tmp_path, "SP", change=lambda _, rs: [scenario.swapped_sign(r) for r in rs])
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert rows["models"][0]["status"] == "rejected" and rows["models"][0]["reason"] == "too_few_impacts"
    assert {i["reason"] for i in rows["impacts"]} == {"sign_reversed"}


def test_the_same_files_give_the_same_rows(tmp_path):
    unit, turnout, _ = write_tests(tmp_path, "A8", n_test=1)
    first, second = (hammer_unit(unit, turnout, tmp_path, algo="1") for _ in range(2))
    as_text = [json.dumps(r, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v)) for r in (first, second)]
    assert as_text[0] == as_text[1]
    assert first["models"][0]["measured_at_utc"] == datetime(2024, 5, 13, 9)


def test_a_file_copied_under_another_name_is_used_once(tmp_path):
    unit, turnout, _ = write_tests(tmp_path, "A9", n_test=2)
    folder = tmp_path / "tommerup_s1" / "hammer" / DAY.isoformat()
    (folder / "A9_3.h5").write_bytes((folder / "A9_1.h5").read_bytes())
    unit = scan(turnout, tmp_path).units[0]
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    assert len(unit.files) == 3 and len(rows["impacts"]) == 20
    assert [q["reason_code"] for q in rows["quarantine"]] == ["duplicate"]
    assert "A9_1" in rows["quarantine"][0]["found"] and "A9_3" in rows["quarantine"][0]["path"]


def test_a_test_exported_again_in_another_format_is_used_once(tmp_path):
    """Other bytes, the same impacts and another test number: each impact is reported with its original."""
    unit, turnout, _ = write_tests(tmp_path, n_test=2)
    once = hammer_unit(unit, turnout, tmp_path, algo="1")
    folder = tmp_path / "tommerup_s1" / "hammer" / DAY.isoformat()
    recordings = read("A7_1.h5", folder, replace(turnout.hammer.descriptions["A7"], n_records=None)).recordings
    write(recordings, folder / "A7_3.uff", "uff58")
    twice = hammer_unit(scan(turnout, tmp_path).units[0], turnout, tmp_path, algo="1")
    again = [i for i in twice["impacts"] if i["test"] == 3]
    assert all("A7_1.h5" in i["detail"] for i in again)
    assert [i["reason"] for i in again] == ["duplicate"] * 10
    assert twice["models"][0]["n_impacts_used"] == once["models"][0]["n_impacts_used"]


def test_a_file_that_no_reader_can_read_does_not_affect_the_others(tmp_path):
    unit, turnout, _ = write_tests(tmp_path, n_test=2)
    folder = tmp_path / "tommerup_s1" / "hammer" / DAY.isoformat()
    (folder / "A7_3.csv").write_text("# rate: 20000,0\nforce;acc\n1;2\n3;4\n")
    unit = scan(turnout, tmp_path).units[0]
    result = compute_guarded(hammer_unit, unit, turnout, tmp_path, "key", "1", False)
    assert result.status == "partly" and len(result.tables["impacts"]) == 20
    assert {q["path"][-8:] for q in result.tables["quarantine"]} == {"A7_3.csv"}


def test_an_unexplained_entry_of_all_files_is_one_remark_and_the_status_is_ok(tmp_path):
    unit, turnout, _ = write_tests(tmp_path)
    for path, *_ in unit.files:
        with h5py.File(tmp_path / path, "a") as file:
            file.attrs["Hub"] = 2.5
    unit = scan(turnout, tmp_path).units[0]
    result = compute_guarded(hammer_unit, unit, turnout, tmp_path, "key", "1", False)
    assert [q["reason_code"] for q in result.tables["quarantine"]] == ["entry_unknown"]
    assert result.status == "ok" and len(result.tables["impacts"]) == 30


def test_the_row_of_a_receptance_has_the_decay_of_the_window_and_the_level_of_the_gate(tmp_path):
    unit, turnout, _ = write_tests(tmp_path, n_test=2)
    for decay in (0.0, 50.0):
        own = replace(turnout.settings["receptance"], exponential_window=decay, gate_level=0.7)
        windowed = replace(turnout, settings={**turnout.settings, "receptance": own})
        (row,) = hammer_unit(unit, windowed, tmp_path, algo="1")["receptances"]
        assert row["window_decay_per_s"] == decay and row["gate_required"] == 0.7


def test_a_corrected_temperature_gives_the_model_of_the_same_impacts_another_id(tmp_path):
    unit, turnout, _ = write_tests(tmp_path)
    warm = replace(turnout.campaigns[unit.campaign], rail_temperature=22.0)
    other = replace(turnout, campaigns={**turnout.campaigns, unit.campaign: warm})
    one, two, again = (hammer_unit(unit, t, tmp_path, algo="1")["models"][0] for t in (turnout, other, turnout))
    assert one["model_id"] == again["model_id"] != two["model_id"]


def test_a_file_at_another_rate_is_left_out_and_the_others_are_used(tmp_path):
    def slower(test, recordings):
        if test != 2:
            return recordings
        return [replace(r, samples=r.samples[:, ::2], rate=r.rate / 2) for r in recordings]

    unit, turnout, _ = write_tests(tmp_path, change=slower)
    layout = replace(turnout.hammer.descriptions["A7"], rate=None, n_samples=None)
    hammer = replace(turnout.hammer, descriptions={**turnout.hammer.descriptions, "A7": layout})
    rows = hammer_unit(unit, replace(turnout, hammer=hammer), tmp_path, algo="1")
    assert [(q["reason_code"], q["path"][-7:]) for q in rows["quarantine"]] == [("wrong_rate", "A7_2.h5")]
    assert {i["test"] for i in rows["impacts"]} == {1, 3} and rows["models"][0]["status"] == "accepted"


def test_rows_contain_tables_1_and_2_of_the_paper_with_errors_stiffness_and_density(tmp_path):
    unit, turnout, _ = write_tests(tmp_path, "A7")
    rows = hammer_unit(unit, turnout, tmp_path, algo="1")
    (receptance,) = rows["receptances"]
    for mode in rows["modes"]:
        a11, a12, a21, a22 = mode["a_block"]
        assert a12 == pytest.approx(-a21) and a12 < 0.0
        pole = np.linalg.eigvals(np.reshape(mode["a_block"], (2, 2)))[0]
        s = np.log(pole) * 20e3
        assert abs(s) / (2.0 * np.pi) == pytest.approx(mode["frequency_hz"])
        assert -s.real / abs(s) == pytest.approx(mode["damping_ratio"])
        # det A = exp(-2 zeta w / rate): its error, computed from independent errors of the elements, is not smaller
        error_of_log = 2.0 / 20e3 * 2.0 * np.pi * mode["frequency_hz"] * mode["damping_se"]
        independent = np.hypot(a22 * mode["a_block_se"][0], a11 * mode["a_block_se"][3])
        assert 0.5 * abs(pole) ** 2 * error_of_log < np.hypot(independent, 2.0 * a12 * mode["a_block_se"][1])
        assert np.all(np.array(mode["c_block_se"]) > 0.0)
        line = np.argmin(np.abs(receptance["frequency_hz"] - mode["frequency_hz"]))
        h1 = np.hypot(receptance["h1_real_m_n"][line], receptance["h1_imag_m_n"][line])
        assert mode["stiffness_mn_m"] == pytest.approx(1e-6 / h1, rel=0.05)
        assert mode["stiffness_low_mn_m"] < mode["stiffness_mn_m"] < mode["stiffness_high_mn_m"]
        parts = np.hypot(mode["frequency_repeatability_hz"], mode["frequency_systematic_hz"])
        assert mode["frequency_se_hz"] == pytest.approx(parts)
    decibel = 10.0 * np.log10([receptance["density_low_factor"], receptance["density_high_factor"]])
    assert receptance["n_impacts"] >= 28
    np.testing.assert_allclose(decibel, [-1.4, 1.7], atol=0.1)  # thirty impacts, published
    assert len(receptance["response_density_m2_s3"]) == len(receptance["frequency_hz"])


def test_the_density_of_white_noise_is_its_variance_over_the_nyquist_frequency():
    rng = np.random.default_rng(4)
    samples = 3.0 * rng.standard_normal((40, 2000))
    impacts = [Impact(x, x, 1000.0, 0, 1, 2, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0) for x in samples]
    columns = density_columns(impacts, np.arange(20.0, 480.0, 2.0))
    assert np.mean(columns["response_density_m2_s3"]) == pytest.approx(9.0 / 500.0, rel=0.05)


def rows_with_second_response(folder, channel, use="validate"):
    """Rows of a section with the second accelerometer ``channel`` of the layout; None: without one."""
    unit, turnout, _ = write_tests(folder, "A7", n_test=1, change=with_second_response)
    description = turnout.hammer.descriptions["A7"]
    second = replace(description.channels[1], name="rail_2", source="rail_2")
    description = replace(description, channels=(*description.channels, second))
    hammer = replace(turnout.hammer, descriptions={"A7": description}, validation={"A7": channel})
    settings = {**turnout.settings, "identify": replace(turnout.settings["identify"], second_response=use)}
    return hammer_unit(unit, replace(turnout, hammer=hammer, settings=settings), folder, algo="1")


def test_the_second_response_validates_the_modes_of_the_first(tmp_path):
    (without,), (model,) = (rows_with_second_response(tmp_path / str(c), c)["models"] for c in (None, "rail_2"))
    assert (without["validation_fit_pct"], without["n_validation"]) == (None, None)
    impact_count = without["n_impacts_used"]
    assert model["n_validation"] == impact_count
    assert 60.0 < model["validation_fit_pct"] <= 100.0


def test_a_second_response_in_the_fit_reduces_the_errors_and_validates_nothing(tmp_path):
    alone, both = (rows_with_second_response(tmp_path / use, "rail_2", use) for use in ("validate", "joint"))
    assert both["models"][0]["validation_fit_pct"] is None
    error = [np.array([m["frequency_se_hz"] for m in rows["impact_modes"]]) for rows in (alone, both)]
    assert len(error[0]) == len(error[1]) > 0
    # half of the signal with 0.94 times the noise of the first: information 1.28, error 0.88
    assert 0.85 < np.median(error[1] / error[0]) < 0.95


def test_a_second_response_adds_the_ratio_of_both_responses_and_changes_nothing_else(tmp_path):
    """The second sensor records half of the response; tolerance of 5 standard errors in both parts."""
    without, both = (rows_with_second_response(tmp_path / str(c), c)["modes"] for c in (None, "rail_2"))
    assert len(without) == len(both) > 0
    for plain, mode in zip(without, both, strict=True):
        ratio, (v_re, _, v_im) = mode.pop("shape_ratio"), mode.pop("shape_covariance")
        assert mode.pop("n_shape") == 10
        assert abs(ratio[0] - 0.5) < 5.0 * np.sqrt(v_re) < 0.1 and abs(ratio[1]) < 5.0 * np.sqrt(v_im) < 0.1
        assert "shape_ratio" not in plain
        same = [{k: str(v) for k, v in row.items()} for row in (plain, mode)]
        assert same[0] == same[1]


def with_second_response(test, recordings):
    """The same recordings with a second accelerometer, which records half of the response and its own noise."""
    rng = np.random.default_rng(test)
    changed = []
    for recording in recordings:
        second = 0.5 * recording.samples[1] + 0.005 * np.ptp(recording.samples[1]) * rng.standard_normal(
            recording.samples.shape[1]
        )
        channel = replace(recording.channels[1], name="rail_2")
        changed.append(
            replace(recording, samples=np.vstack([recording.samples, second]), channels=(*recording.channels, channel))
        )
    return changed
