"""Frequency responses in files: UFF58 function type 4, text with complex columns or pairs, npz."""

import gzip

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers.frequency_responses import check_evaluable, find_responses
from turnout.readers.writing import write

F = np.arange(1, 801) * 0.5
H = 1.0 / (100.0**2 - F**2 + 2j * 0.01 * 100.0 * F)  # one mode of 100 Hz and 1 %


def cells(value):
    return f"{value.real:.9e}", f"{value.imag:.9e}"


TEXTS = {
    "complex cells": ("Frequency [Hz],H1 [m/N]\n", lambda f, h: f"{f},{h.real:.9e}{h.imag:+.9e}j\n"),
    "complex cells with i": ("f;H1\n", lambda f, h: f"{f};{h.real:.9e} {'+-'[int(h.imag < 0)]} {abs(h.imag):.9e} i\n"),
    "brackets": ("Frequency\tH1\n", lambda f, h: f"{f}\t({h.real:.9e},{h.imag:.9e})\n"),
    "pairs with a head": (
        "SignalCalc export\nDate: 13.05.2026\nX Hz\tH(1,2) Real (g/N)\tH(1,2) Imag (g/N)\n",
        lambda f, h: "\t".join((str(f), *cells(h))) + "\n",
    ),
    "pairs without titles": (
        "Frequency response, real and imaginary, Hz\n",
        lambda f, h: " ".join((f"{f:12.3f}", *cells(h))) + "\n",
    ),
    "magnitude and degrees, decimal comma": (
        "Frequenz (Hz);Betrag (m/N);Phase (°)\n",
        lambda f, h: f"{f};{abs(h):.9e};{np.degrees(np.angle(h)):.9f}\n".replace(".", ","),
    ),
    "dB and degrees": (
        "Freq [Hz],Magnitude [dB],Phase [deg]\n",
        lambda f, h: f"{f},{20 * np.log10(abs(h)):.9f},{np.degrees(np.angle(h)):.9f}\n",
    ),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_frequency_responses_of_a_text_are_read_to_their_digits(kind, tmp_path):
    head, row = TEXTS[kind]
    (tmp_path / "a.txt").write_text(head + "".join(map(row, F, H)))
    found = find_responses("a.txt", tmp_path)
    assert found.frequency == pytest.approx(F, rel=1e-9)
    assert found.frf[0] == pytest.approx(H, rel=1e-7)
    assert found.frf.shape == (1, len(F))


def test_two_frequency_responses_of_a_text_have_their_names_and_units(tmp_path):
    head = "Hz,A Real [g/N],A Imag [g/N],B Real [m/s²/N],B Imag [m/s²/N]\n"
    rows = (",".join((str(f), *cells(h), *cells(2.0 * h))) + "\n" for f, h in zip(F, H))
    (tmp_path / "a.csv").write_text(head + "".join(rows), encoding="utf-8")
    found = find_responses("a.csv", tmp_path)
    assert found.units == ("g/N", "m/s²/N") and [name[0] for name in found.names] == ["A", "B"]
    assert found.frf == pytest.approx(np.array([H, 2.0 * H]), rel=1e-7)


def test_frequency_responses_in_numpy_arrays_are_read(tmp_path):
    np.savez(tmp_path / "a.npz", frequency=F, frf=np.stack([H, 2.0 * H]).T, units="m/N")
    found = find_responses("a.npz", tmp_path)
    assert found.frf == pytest.approx(np.array([H, 2.0 * H])) and found.units == ("m/N", "m/N")


def test_three_accelerances_of_a_measured_beam_are_read(shared_data, tmp_path):
    packed = shared_data / "uff58_reader_samples" / "beam.uff.gz"
    (tmp_path / "beam.uff").write_bytes(gzip.decompress(packed.read_bytes()))
    for root, name in ((tmp_path, "beam.uff"), (packed.parent, packed.name)):
        found = find_responses(name, root)
        assert found.frf.shape == (3, 64000) and found.units == ("(m/s²)/(N)",) * 3
        assert found.frequency[1] == pytest.approx(0.1)


@pytest.mark.parametrize("file_format", ["uff58", "csv", "npz", "lvm", "hdf5", "tdms"])
def test_recordings_are_not_read_as_frequency_responses(file_format, hammer_test, in_si, tmp_path, name_of):
    name = name_of(file_format)
    write(hammer_test, tmp_path / name, file_format, in_si)
    assert find_responses(name, tmp_path) is None


def test_a_text_with_a_time_column_is_not_read_as_a_frequency_response(tmp_path):
    rows = "".join(f"{t},{h.real:.6e},{h.imag:.6e}\n" for t, h in zip(F, H))
    (tmp_path / "a.csv").write_text("time [s],force real,frequency imag\n" + rows)
    assert find_responses("a.csv", tmp_path) is None


@pytest.mark.parametrize(
    ("frequency", "frf", "words"),
    [
        (F[:20], H[:20], "20 frequencies, 40 are needed"),
        (F**1.1, H, "not evenly spaced"),
        (F, np.where(F == 7.0, np.nan, H), "'h' is no number at 7 Hz"),
    ],
)
def test_the_error_of_responses_that_cannot_be_evaluated_states_the_reason(frequency, frf, words, tmp_path):
    np.savez(tmp_path / "a.npz", frequency=frequency, h=frf.astype(complex))
    with pytest.raises(ReadError, match=words):
        check_evaluable(find_responses("a.npz", tmp_path), "a.npz")


UNITS = {"Hz": 1.0, "kHz": 1e-3, "rad/s": 2.0 * np.pi, "rpm": 60.0, "1/min": 60.0}
PLACES = ("Frequency [{}];Real;Imag", "Freq in {};Real;Imag", "Frequency;Real;Imag\n{};m/s²/N;m/s²/N",
          "Real, imaginary part over frequency in {}")  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("head", PLACES)
def test_frequencies_of_a_text_are_in_the_unit_that_it_states(head, unit, tmp_path):
    rows = [";".join((f"{UNITS[unit] * f:.12g}", *cells(h))) for f, h in zip(F[:60], H)]
    (tmp_path / "a.csv").write_text("\n".join((head.format(unit), *rows)) + "\n", encoding="utf-8")
    assert find_responses("a.csv", tmp_path).frequency == pytest.approx(F[:60], rel=1e-9)


TITLES = {"Frequency [Hz] (bin)": 1.0, "Frequency (FFT) [kHz]": 1e-3, "Frequency (FFT)": 1.0, "Frequency [mHz]": 1e3}


@pytest.mark.parametrize("title", TITLES)
def test_a_remark_in_the_title_of_the_frequencies_is_not_read_as_a_unit(title, tmp_path):
    rows = [";".join((f"{TITLES[title] * f:.12g}", *cells(h))) for f, h in zip(F[:60], H)]
    (tmp_path / "a.csv").write_text("\n".join((f"{title};Real;Imag", *rows)) + "\n")
    assert find_responses("a.csv", tmp_path).frequency == pytest.approx(F[:60], rel=1e-9)


@pytest.mark.parametrize("unit", ["ms", "order", "V"])
def test_a_column_with_another_unit_is_not_read_as_frequencies(unit, tmp_path):
    rows = [";".join((f"{f}", *cells(h))) for f, h in zip(F[:60], H)]
    (tmp_path / "a.csv").write_text("\n".join((f"Frequency [{unit}];Real;Imag", *rows)) + "\n")
    with pytest.raises(ReadError, match=f"'{unit}' is no unit of a frequency") as error:
        find_responses("a.csv", tmp_path)
    assert error.value.reason == "wrong_rate"
    if unit != "order":
        (tmp_path / "a.csv").write_text("\n".join((f"Frequency ({unit});Real;Imag", *rows)) + "\n")
        with pytest.raises(ReadError, match=f"'{unit}' is no unit of a frequency"):
            find_responses("a.csv", tmp_path)


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Frequency [Hz];Imag;Real", lambda h: (h.imag, h.real)),
        ("Frequency [Hz];Phase [rad];Magnitude", lambda h: (np.angle(h), abs(h))),
        ("Frequency [Hz];Magnitude;Phase [rad]", lambda h: (abs(h), np.angle(h))),
    ],
)
def test_the_titles_determine_the_columns_of_a_pair_and_the_unit_of_a_phase(head, row, tmp_path):
    """A phase in radians over several turns is not read as degrees."""
    values = H / np.abs(H).max()
    turns = np.arange(len(F)) // 100
    lines = [row(h) for h in values]
    if head.endswith("Phase [rad]"):
        lines = [(a, np.angle(h) - 2.0 * np.pi * n) for (a, _), h, n in zip(lines, values, turns)]
    text = "".join(f"{f};{a:.12e};{b:.12e}\n" for f, (a, b) in zip(F, lines))
    (tmp_path / "a.csv").write_text(f"{head}\n{text}")
    assert find_responses("a.csv", tmp_path).frf[0] == pytest.approx(values, rel=1e-7)


def write_function(path, abscissa, ordinate, code=1, scale=1.0):
    """Write a Universal File of one frequency response, with data set 164 of SI or of mm and mN (5)."""
    step, (size, n) = scale * (F[1] - F[0]), ((1000.0, len(F)) if code == 5 else (1.0, len(F)))
    axes = [(18, abscissa), (12, ordinate), (13, "NONE"), (0, "NONE")]
    lines = [
        "    -1", "   164", f"{code:10d}{'units':20}{2:10d}", f"{size:25.17E}{size:25.17E}{1.0:25.17E}",
        f"{273.15:25.17E}", "    -1", "    -1", "    58", "rail", "NONE", "NONE", "NONE", "NONE",
        f"{4:5d}{0:10d}{1:5d}{0:10d} {'NONE':10}{1:10d}{3:4d} {'NONE':10}{1:10d}{3:4d}",
        f"{6:10d}{n:10d}{1:10d}{scale * F[0]:13.5E}{step:13.5E}{0.0:13.5E}",
        *(f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20} {label:20}" for kind, label in axes),
        *(f"{a.real:20.11E}{a.imag:20.11E}{b.real:20.11E}{b.imag:20.11E}" for a, b in zip(H[::2], H[1::2])),
        "    -1", "",
    ]  # fmt: skip
    path.write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.parametrize("unit", UNITS)
def test_frequencies_of_a_universal_file_are_in_the_unit_of_their_label(unit, tmp_path):
    write_function(tmp_path / "a.uff", unit, "m/s²", scale=UNITS[unit])
    found = find_responses("a.uff", tmp_path)
    assert found.frequency == pytest.approx(F, rel=1e-4) and found.frf[0] == pytest.approx(H, rel=1e-9)
    write_function(tmp_path / "a.uff", "s", "m/s²")
    with pytest.raises(ReadError, match="the unit of its abscissa is 's', which is none of a frequency"):
        find_responses("a.uff", tmp_path)


@pytest.mark.parametrize(
    ("code", "label", "unit"), [
        (1, "m/s²", "(m/s²)/(N)"), (5, "NONE", "(mm/s²)/(mN)"),
        (1, "g", "not known: its label says 'g', data set 164 of the file 'm/s²'"),
        (5, "m/s²", "not known: its label says 'm/s²', data set 164 of the file 'mm/s²'"),
    ],
)  # fmt: skip
def test_a_label_of_a_frequency_response_that_contradicts_dataset_164_is_not_used(code, label, unit, tmp_path):
    write_function(tmp_path / "a.uff", "Hz", label, code)
    assert find_responses("a.uff", tmp_path).units == (unit,)
