"""Frequency responses of files: UFF58 function type 4, text with complex columns or pairs, npz."""

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
def test_responses_of_a_text_are_read_to_its_digits(kind, tmp_path):
    head, row = TEXTS[kind]
    (tmp_path / "a.txt").write_text(head + "".join(map(row, F, H)))
    found = find_responses("a.txt", tmp_path)
    assert found.frequency == pytest.approx(F, rel=1e-9)
    assert found.frf[0] == pytest.approx(H, rel=1e-7)
    assert found.frf.shape == (1, len(F))


def test_two_responses_of_a_text_have_their_names_and_units(tmp_path):
    head = "Hz,A Real [g/N],A Imag [g/N],B Real [m/s²/N],B Imag [m/s²/N]\n"
    rows = (",".join((str(f), *cells(h), *cells(2.0 * h))) + "\n" for f, h in zip(F, H))
    (tmp_path / "a.csv").write_text(head + "".join(rows), encoding="utf-8")
    found = find_responses("a.csv", tmp_path)
    assert found.units == ("g/N", "m/s²/N") and [name[0] for name in found.names] == ["A", "B"]
    assert found.frf == pytest.approx(np.array([H, 2.0 * H]), rel=1e-7)


def test_arrays_of_numpy(tmp_path):
    np.savez(tmp_path / "a.npz", frequency=F, frf=np.stack([H, 2.0 * H]).T, units="m/N")
    found = find_responses("a.npz", tmp_path)
    assert found.frf == pytest.approx(np.array([H, 2.0 * H])) and found.units == ("m/N", "m/N")


def test_the_measured_beam_has_three_accelerances(shared_data, tmp_path):
    packed = shared_data / "uff58_reader_samples" / "beam.uff.gz"
    (tmp_path / "beam.uff").write_bytes(gzip.decompress(packed.read_bytes()))
    for root, name in ((tmp_path, "beam.uff"), (packed.parent, packed.name)):
        found = find_responses(name, root)
        assert found.frf.shape == (3, 64000) and found.units == ("(m/s²)/(N)",) * 3
        assert found.frequency[1] == pytest.approx(0.1)


@pytest.mark.parametrize("file_format", ["uff58", "csv", "npz", "lvm", "hdf5", "tdms"])
def test_recordings_are_no_responses(file_format, hammer_test, in_si, tmp_path, name_of):
    name = name_of(file_format)
    write(hammer_test, tmp_path / name, file_format, in_si)
    assert find_responses(name, tmp_path) is None


def test_a_text_over_time_is_no_response(tmp_path):
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
def test_responses_that_cannot_be_evaluated_say_why(frequency, frf, words, tmp_path):
    np.savez(tmp_path / "a.npz", frequency=frequency, h=frf.astype(complex))
    with pytest.raises(ReadError, match=words):
        check_evaluable(find_responses("a.npz", tmp_path), "a.npz")
