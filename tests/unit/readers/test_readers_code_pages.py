"""Texts in code pages of DOS, of the Macintosh and of East Asia: ², µ, ° and names are read where they can be known."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE, RAIL = np.random.default_rng(1).normal(size=(2, 400)).round(4)
ROWS = "".join(f"{k * 200.0};{f};{r}\n" for k, (f, r) in enumerate(zip(FORCE, RAIL)))


def read_table(tmp_path, head, encoding, channels):
    (tmp_path / "a.csv").write_bytes(f"{head}\n{ROWS}".encode(encoding))
    return read("a.csv", tmp_path, RawDescription(channels, rate=5000.0))


@pytest.mark.parametrize(
    ("encoding", "head"),
    [
        *((e, "time [µs];Prüfkraft [N];rail [m/s²]") for e in ("cp437", "cp850", "cp1252", "utf-8", "utf-16-le")),
        *((e, "time [µs];Prüfkraft [N];rail [m/s^2]") for e in ("mac_roman", "utf-16-be")),
        *((e, "t [us];force [N];rail [m/s²]") for e in ("cp949", "gb18030", "koi8_r")),
        *((e, "t [us];force [Н];rail [м/с2]") for e in ("cp1251", "cp866", "koi8_r", "utf-8")),
    ],
)
def test_units_and_names_are_read_in_the_encoding_in_which_they_are_known(encoding, head, tmp_path):
    name = head.split(";")[1].partition(" ")[0]
    channels = (RawChannel("force", name, "force"), RawChannel("rail", "rail", "acceleration"))
    result = read_table(tmp_path, head, encoding, channels)
    np.testing.assert_array_equal(result.recordings[0].samples, [FORCE, RAIL])
    assert result.errors == ()


@pytest.mark.parametrize("encoding", ["cp1251", "cp866", "koi8_r", "utf-8", "utf-16"])
@pytest.mark.parametrize(
    "head", ["Время, мс;Сила, кН;Рельс, м/с2", "Время, мкс;Сила, Н;Рельс, g", "Сила, Н;Рельс, мм/с2"]
)
def test_units_behind_a_comma_are_read_in_the_encoding_in_which_they_are_known(encoding, head, tmp_path):
    channels = (RawChannel("force", "Сила", "force"), RawChannel("rail", "Рельс", "acceleration"))
    rows = (
        ROWS
        if "мкс" in head
        else "".join(f"{k / 5:.1f};{row.partition(';')[2]}\n" for k, row in enumerate(ROWS.split()))
    )
    rows = rows if "Время" in head else "".join(row.partition(";")[2] + "\n" for row in ROWS.split())
    (tmp_path / "a.csv").write_bytes(f"{head}\n{rows}".encode(encoding))
    result = read("a.csv", tmp_path, RawDescription(channels, rate=5000.0))
    scales = [1e3 if "кН" in head else 1.0, 9.80665 if "g" in head else 1e-3 if "мм" in head else 1.0]
    np.testing.assert_allclose(result.recordings[0].samples, [FORCE * scales[0], RAIL * scales[1]], rtol=1e-12)


def test_a_unit_that_no_encoding_explains_names_the_way_out(tmp_path):
    channels = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration"))
    result = read_table(tmp_path, "t [us];force;rail [m/sþ]", "cp1252", channels)
    assert "save the file as UTF-8" in result.errors[0].remedy


def test_the_temperature_of_a_dos_logger_is_in_degrees(tmp_path):
    air = "".join(f"{f};{r};{12.5 + k // 100}\n" for k, (f, r) in enumerate(zip(FORCE, RAIL)))
    (tmp_path / "a.csv").write_bytes(f"force [N];rail [g];air [°F]\n{air}".encode("cp437"))
    channels = (
        RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"),
        RawChannel("air", "air", "temperature"),
    )  # fmt: skip
    signal = read("a.csv", tmp_path, RawDescription(channels, rate=5000.0)).recordings[0].signal("air")
    assert signal[0] == pytest.approx((12.5 - 32.0) / 1.8)
