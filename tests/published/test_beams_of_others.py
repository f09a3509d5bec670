"""Beams that other authors measured: their published modes are found, and a page and a table list them."""

import csv
import gzip
import shutil

import pytest

from turnout.demo.others import SDYPY_FILE
from turnout.demo.published_modes import SDYPY_BEAM, UFF_BEAM, beam_modes
from turnout.report.beams import write_beams


@pytest.fixture(scope="module")
def beams(shared_data, tmp_path_factory):
    raw = tmp_path_factory.mktemp("raw")
    (raw / "frf").mkdir()
    shutil.copy(shared_data / "frf_beam_sdypy" / "acc_data.npy", raw / SDYPY_FILE)
    packed = (shared_data / "uff58_reader_samples" / "beam.uff.gz").read_bytes()
    (raw / "frf/beam.uff").write_bytes(gzip.decompress(packed))
    return list(beam_modes(raw))


def test_all_modes_are_found_and_no_other(beams):
    assert [len(b.rows) for b in beams] == [len(SDYPY_BEAM), len(UFF_BEAM)]
    assert all(published is not None and mode is not None for b in beams for published, _, mode in b.rows)


def test_frequencies_and_damping_are_those_published(beams):
    for beam in beams:
        for published, damping, mode in beam.rows:
            # the authors print 0.1 Hz and 0.01 % of damping, and fit all responses with one set of poles
            assert mode.frequency.mean == pytest.approx(published, abs=0.05 + 1e-3 * published)
            if damping is not None:
                assert 100 * mode.damping.mean == pytest.approx(damping, abs=0.005 + 0.05 * damping)


def test_page_and_table_list_the_modes(beams, tmp_path):
    page = write_beams(beams, tmp_path)
    text = page.read_text()
    with open(page.with_suffix(".csv"), encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(SDYPY_BEAM) + len(UFF_BEAM) and text.count("<circle") == len(rows)
    for row in rows:
        low, value, high = (float(row[c]) for c in ("frequency_low_hz", "frequency_hz", "frequency_high_hz"))
        assert low <= value <= high and int(row["n_responses"]) > 2
        digits = f"{0.5 * (high - low):.1e}"  # two of half the interval, and three decimals at most
        assert f"{value:.{min(3, max(0, 1 - int(digits.partition('e')[2])))}f} ± " in text
