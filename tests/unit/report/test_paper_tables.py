"""Tables 1 to 4 of the paper from a registry, in three formats."""

import csv
import io
import sys
from datetime import datetime
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "registry"))

from registry_rows import Bench, hammer_result

from turnout.cli.main import main
from turnout.workflow.batches import UnitResult

BLOCK = {
    "a_block": [0.9986, -0.0307, 0.0307, 0.9824], "a_block_se": [0.0001, 0.0016, 0.0016, 0.0011],
    "c_block": [0.3642, 1.2523], "c_block_se": [0.0537, 0.0226], "frequency_se_hz": 5.2, "damping_se": 0.02,
    "stiffness_mn_m": 61.0, "stiffness_low_mn_m": 58.0, "stiffness_high_mn_m": 64.0,
}  # fmt: skip


@pytest.fixture
def registry(tmp_path):
    """Two campaigns of a section with the values of A7 in the paper, low frequencies."""
    (tmp_path / "work").mkdir()
    bench = Bench(tmp_path)
    results = [
        hammer_result(section="A7", day=day, file=day, key=day, frequency=frequency, **BLOCK)
        for day, frequency in (("2017-10-02", 98.0), ("2017-11-02", 99.45))
    ]
    for result in results:
        result.tables["models"][0] |= {
            "hammer_fit_pct": 73.3, "n_impacts_used": 30, "validation_fit_pct": 70.1, "n_validation": 29,
            "sampling_rate_hz": 20e3,
        }  # fmt: skip
    bench.register(*results)
    return str(bench.registry)


def test_the_text_contains_each_value_with_error_and_number(registry, capsys):
    assert main(["paper", "t1", "--registry", registry]) == 0
    text = capsys.readouterr().out
    assert [line[:8] for line in text.splitlines() if line.startswith("Table")] == [f"Table {k}:" for k in (1, 2, 3, 4)]
    assert "0.99860 ± 0.00010  -0.0307 ± 0.0016" in " ".join(text.split("A7", 1)[1].splitlines()[:1])
    assert "99 ± 5" in text and "73.3" in text and "70.1" in text and "98 ± 5" not in text
    assert "61 ± 3" in text


def test_a_campaign_can_be_chosen_by_its_date(registry, capsys):
    assert main(["paper", "t1", "--campaign", "2017-10-02", "--registry", registry, "--format", "csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    (frequency,) = (r for r in rows if r["quantity"] == "frequency [Hz]")
    assert (frequency["table"], frequency["section"], frequency["band"]) == ("3", "A7", "ballast")
    assert (float(frequency["value"]), float(frequency["error"]), frequency["n"]) == (98.0, 5.2, "30")
    a12 = next(r for r in rows if r["quantity"] == "a12")
    assert (a12["table"], float(a12["value"]), float(a12["error"])) == ("1", -0.0307, 0.0016)
    (second,) = (r for r in rows if r["quantity"] == "second response")
    assert (second["value"], second["n"]) == ("70.1", "29")


TRAINS = (
    # train type, speed, track, fit
    ("IC3", 158.0, "main", 50.0), ("IC3", 163.0, "main", 60.0), ("IC3", 120.0, "main", 10.0),
    ("freight", 160.0, "main", 20.0), ("IC3", 60.0, "diverging", 40.0),
)  # fmt: skip


@pytest.fixture
def registry_with_trains(registry, tmp_path):
    bench, results = Bench(tmp_path), []
    for k, (train_type, speed, track, fit) in enumerate(TRAINS):
        at = datetime(2017, 11, 5, 8 + k)
        passage = {
            "passage_id": f"p{k}", "turnout_id": "t1", "recording_id": f"r{k}", "passed_at_utc": at, "n_axles": 8,
            "status": "accepted", "train_type": train_type, "speed_kmh": speed, "track": track, "axle_load_t": 12.0,
        }  # fmt: skip
        score = {
            "passage_id": f"p{k}", "section_id": "t1/A7", "channel": "A7", "model_id": "m", "turnout_id": "t1",
            "passed_at_utc": at, "status": "null_explains", "fit_pct": fit, "fit_null_pct": fit + 5.0,
            "forecast_pct": 1.0, "forecast_null_pct": 2.0, "n_wheels": 8,
        }  # fmt: skip
        tables = {"passages": [passage], "passage_fits": [score]}
        results.append(UnitResult(f"t1/p{k}", "t1", "passage", f"p{k}", "1", "ok", tables))
    bench.register(*results)
    return registry


def test_table_4_has_the_trains_of_the_paper_beside_random_models(registry_with_trains, capsys):
    arguments = ["paper", "t1", "--registry", registry_with_trains, "--table", "4", "--format", "csv"]
    assert main(arguments) == 0
    rows = {r["quantity"]: r for r in csv.DictReader(io.StringIO(capsys.readouterr().out))}
    assert (rows["main track"]["value"], rows["main track"]["n"]) == ("55", "2")
    assert float(rows["main track"]["error"]) == pytest.approx(50**0.5, rel=1e-5)  # of 50 and 60
    assert (rows["random models, main track"]["value"], rows["diverging track"]["value"]) == ("60", "40")
    assert main([*arguments, "--train-type", "freight"]) == 0
    rows = {r["quantity"]: r for r in csv.DictReader(io.StringIO(capsys.readouterr().out))}
    assert (rows["main track"]["value"], rows["main track"]["n"]) == ("20", "1") and "diverging track" not in rows


def test_the_page_of_bars_has_the_values_of_table_5(registry_with_trains, tmp_path, capsys):
    page = tmp_path / "bars.html"
    assert main(["paper", "t1", "--registry", registry_with_trains, "--table", "5", "--figure", str(page)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("Table 5:") and "train type" in text and "160-180 km/h" in text
    assert "10.0-12.5 t 36 ± 21 5 41 5" in " ".join(text.split())  # means of all five scores and of their null models
    html = page.read_text(encoding="utf-8")
    assert html.count("<svg") >= 3 and "fit by speed" in html and "http" not in html.split("</style>")[-1][:50]


def test_bars_without_a_passage_are_an_error(registry, tmp_path, capsys):
    assert main(["paper", "t1", "--registry", registry, "--figure", str(tmp_path / "bars.html")]) == 2
    assert "no scored passage of t1" in capsys.readouterr().err


def test_latex_output_has_four_tables_and_no_unescaped_sign(registry, capsys):
    assert main(["paper", "t1", "--registry", registry, "--format", "latex"]) == 0
    text = capsys.readouterr().out
    assert text.count(r"\begin{tabular}") == text.count(r"\end{table}") == 4
    assert "±" not in text and r"$\pm$" in text
    assert not any("%" in line.replace(r"\%", "") for line in text.splitlines())


@pytest.mark.parametrize(("arguments", "words"), [
    (["t9"], "no model of 't9'. The registry has models of t1"),
    (["t1", "--campaign", "2018-01-01"], "the newest are 2017-10-02, 2017-11-02"),
])  # fmt: skip
def test_an_unknown_turnout_or_campaign_is_an_error(registry, capsys, arguments, words):
    assert main(["paper", *arguments, "--registry", registry]) == 2
    assert words in capsys.readouterr().err
