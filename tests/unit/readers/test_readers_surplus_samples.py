"""More samples than the file states, and rows of separators in place of the last samples, are remarks."""

from dataclasses import replace

import numpy as np
import pytest
from test_readers_notations_of_starts import LAYOUT, NOISE, WRITERS

from turnout.readers import read, read_unconverted
from turnout.readers.interpret import errors_without_layout

N = NOISE.shape[1]
COUNT = "number_of_samples"


def result_of(tmp_path, write, number, description=LAYOUT):
    write(tmp_path / "a", COUNT, number)
    (path,) = tmp_path.iterdir()
    return read(path.name, tmp_path, description)


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("number", [N // 2, N // 3, 20])
def test_a_stated_number_below_that_of_the_samples_is_a_remark(write, number, tmp_path):
    result = result_of(tmp_path, write, number)
    (error,) = result.errors
    assert f"is {number}, and there are {N} samples" in error.problem and error.reason == "entry_unknown"
    np.testing.assert_allclose(result.recordings[0].samples, NOISE)


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("number", [N, N - 1, 1, 2])
def test_the_number_of_samples_channels_or_records_and_the_last_index_are_accepted(write, number, tmp_path):
    assert result_of(tmp_path, write, number).errors == ()


@pytest.mark.parametrize("checked", [{"checked_entries": (COUNT,)}, {"n_samples": N}])
def test_the_layout_silences_the_remark(checked, tmp_path):
    assert result_of(tmp_path, WRITERS[0], N // 2, replace(LAYOUT, **checked)).errors == ()


def text_with_end(tmp_path, end, head="fs: 20000"):
    rows = "".join(f"{a};{b}\n" for a, b in NOISE.T)
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{rows}{end}")
    result = read("a.csv", tmp_path, LAYOUT)
    np.testing.assert_allclose(result.recordings[0].samples, NOISE)
    return result.errors


@pytest.mark.parametrize("row", [";\n", " ; \n", '"";""\n', ";;;\n"])
@pytest.mark.parametrize("n_row", [32, 300])
def test_many_rows_of_separators_below_the_samples_are_a_remark(row, n_row, tmp_path):
    (error,) = text_with_end(tmp_path, n_row * row)
    assert f"{n_row} rows of separators stand below its last sample" in error.problem


@pytest.mark.parametrize("end", ["", ";\n", 5 * ";\n", 300 * "\n", 300 * " \n"])
def test_few_such_rows_and_empty_lines_are_accepted(end, tmp_path):
    assert text_with_end(tmp_path, end) == ()


@pytest.mark.parametrize("name", ["Number of samples", "Anzahl Messwerte"])
def test_a_stated_number_of_samples_explains_them(name, tmp_path):
    assert text_with_end(tmp_path, 300 * ";\n", f"fs: 20000\n{name}: {N}") == ()


def test_fewer_stated_samples_need_no_layout(tmp_path):
    WRITERS[0](tmp_path / "a", COUNT, N // 2)
    source, _, raw = read_unconverted("a.csv", tmp_path)
    (error,) = errors_without_layout(raw, source)
    assert f"is {N // 2}, and there are {N} samples" in error.problem
