"""Positions in turnouts.tsv that contradict others: ``turnout check`` prints a remark, and no run fails."""

import pytest
from tests.unit.config.test_config_wrong_input import LAYOUT, configuration

from turnout.cli.main import main
from turnout.config.positions import position_remarks
from turnout.errors import ConfigErrors

HEADER = "turnout\tlayout\tline\tkm\tlat_deg\tlon_deg\n"


def remarks(folder, rows, zone=""):
    table = HEADER + "".join(f"t{i}\tmain\t{row}\n" for i, row in enumerate(rows))
    read = configuration(folder, table=table)
    return [remark.partition(": ")[2] for remark in position_remarks(read.rows, lambda name: zone)]


@pytest.mark.parametrize(
    ("rows", "zone", "n"),
    [
        (["A\t1\t55.3\t10.4", "A\t2\t55.4\t10.3", "A\t3\t10.3\t55.4"], "", 1),
        (["A\t1\t55.3\t10.4", "A\t2\t55.4\t10.3"], "Europe/Copenhagen", 0),
        (["A\t1\t10.4\t55.3", "A\t2\t10.3\t55.4"], "Europe/Copenhagen", 2),
        (["A\t1\t10.4\t55.3"], "UTC", 0),
        (["A\t1\t10.4\t55.3"], "Etc/GMT-1", 0),
        (["A\t1\t40.4\t-3.7"], "Europe/Madrid", 0),
        (["A\t1\t39.5\t76.0"], "Asia/Shanghai", 0),
        (["A\t1\t-33.9\t151.2", "A\t2\t-37.8\t145.0"], "Australia/Sydney", 0),
        (["A\t1\t151.2\t-33.9"], "", None),
        (["A\t1\t\t10.4", "A\t2\t55.4\t"], "Europe/Copenhagen", 0),
        (["A\t1\t55.3\t10.4", "A\t2\t10.3\t55.4"], "Europe/Copenhagen", 1),
        (["A\t1\t39.9\t32.9", "A\t2\t39.8\t32.8", "A\t3\t40.6\t43.1"], "Europe/Istanbul", 0),
        (["A\t1\t-33.9\t151.2", "A\t2\t-31.9\t115.9"], "", 0),
    ],
)
def test_coordinates_that_fit_only_if_they_are_swapped_are_reported(rows, zone, n, tmp_path):
    if n is None:
        with pytest.raises(ConfigErrors, match=r"lat_deg is 151.2. Write a number from -90 to 90"):
            remarks(tmp_path, rows)
        return
    found = remarks(tmp_path, rows, zone)
    assert len(found) == n and all("seem to be swapped. Compare them with a map" in remark for remark in found)


@pytest.mark.parametrize(
    ("cells", "n"),
    [(("12.4", "13.1", "9100"), 1), (("12.4", "13.1", "210.7"), 0), (("0", "0.1", "8.2"), 0), (("9100", "8200"), 0)],
)
def test_a_kilometre_in_metres_is_found_by_comparison_with_the_same_line(cells, n, tmp_path):
    found = remarks(tmp_path, [f"A\t{km}\t\t" for km in (*cells,)] + ["B\t4000\t\t"])
    assert [("km 9100 of t2 seems to be in metres" in r, r.endswith("such as 9.1")) for r in found] == [
        (True, True)
    ] * n


def test_turnouts_without_a_line_are_not_compared_by_kilometre(tmp_path):
    assert remarks(tmp_path, ["\t0.3\t\t", "\t0.5\t\t", "\t650.2\t\t"]) == []


@pytest.mark.parametrize("km", ["12,345,678", "12345678", "12345"])
def test_a_kilometre_above_10000_is_an_error(km, tmp_path):
    with pytest.raises(ConfigErrors, match=r"km is .*Write a number from 0 to 10000"):
        remarks(tmp_path, [f"A\t{km}\t\t"])


def test_check_prints_positions_and_train_types_without_pattern(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    configuration(tmp_path, layout=LAYOUT, table=HEADER + "t1\tmain\tA\t1\t55\t10\nt2\tmain\tA\t2\t10\t55\n")
    (tmp_path / "config/vehicles").mkdir()
    (tmp_path / "config/vehicles/axle_patterns.yaml").write_text(
        "vehicles: {a: {length: 20.0, axles: [3.0, 17.0]}}\ntrains: {IC3: {units: [a]}}\n"
    )
    (tmp_path / "raw/t1").mkdir(parents=True)
    passed = ("10:00:00,IC3", "11:00:00,IC 3", "11:30:00,X31", "12:00:00,")
    trains = "passed_at_utc,train_type\n" + "".join(f"2024-05-13T{row}\n" for row in passed)
    (tmp_path / "raw/t1/trains.csv").write_text(trains)
    main(["check"])
    printed = capsys.readouterr().out
    assert "turnouts.tsv, line 3, column 13: lat_deg 10 and lon_deg 55 of t2 seem to be swapped" in printed
    assert (
        "trains.csv: no axle pattern is called 'IC 3', 'X31', so no recording is recognised as such a train. Correct"
        in printed
    )
    assert "'IC3'" not in printed
