"""Universal Files of several vendors, compared with pyuff if it can read them, and difficult cases of the format."""

import gzip
import re
from dataclasses import replace

import numpy as np
import pytest
import pyuff

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.uff import read_frf
from turnout.readers.uff_datasets import read_datasets
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording
from turnout.stages.file_contents import file_contents

VENDORS = (
    "Sample_UFF58_ascii.uff",
    "Sample_UFF58b_bin.uff",
    "TestLab 161 164 18 15 82.uff",
    "binary8byte.uff",
    "dataset_milestone_in_header.uff",
    "non_ascii_header.uff",
    "time-history-not-all-columns-filled.uff",
)


@pytest.fixture
def vendors(shared_data):
    return shared_data / "uff58_reader_samples"


@pytest.mark.parametrize("name", VENDORS)
def test_every_set_of_a_vendor_file_equals_the_set_that_pyuff_reads(name, vendors):
    ours = read_datasets((vendors / name).read_bytes())
    theirs = pyuff.UFF(str(vendors / name)).read_sets()
    theirs = theirs if isinstance(theirs, list) else [theirs]
    assert [int(s.dataset_type.rstrip("b")) for s in ours] == [s["type"] for s in theirs]
    for one, other in zip(ours, theirs):
        if other["type"] == 58:
            np.testing.assert_array_equal(one.data, other["data"])
            assert (one.func_type, one.promised, one.step) == (
                other["func_type"],
                other["num_pts"],
                other["abscissa_inc"],
            )
            assert [line.rstrip() for line in one.ids] == [other[f"id{i}"] for i in range(1, 6)]


@pytest.mark.parametrize("name", ["Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff"])
def test_a_recording_of_a_microphone_in_pascals_is_read(name, vendors):
    """1.52588E-05 s is 1/65536 s: 65536 Hz is the only whole number of Hz with this printed step."""
    for source in ("Mic 01.0Scalar", "Mic 01", "Pressure", 0):
        description = RawDescription((RawChannel("p", source, "pressure"),))
        (recording,) = read(name, vendors, description).recordings
        assert recording.rate == 65536.0
        assert recording.n_sample == 79292
        assert f"{recording.started_at:%Y-%m-%d %H:%M:%S}" == "2016-04-18 13:49:58"
    assert read(name, vendors, replace(description, rate=65536.0)).errors == ()
    (error,) = read(name, vendors, replace(description, rate=65537.0)).errors
    assert error.reason == "wrong_rate"


def test_eight_byte_binary_numbers_are_the_sine_of_the_header(vendors):
    """The header states a sine, 5 Hz, and 100 samples per second."""
    description = RawDescription((RawChannel("a", "sine 5 Hz", "acceleration"),), rate=100.0, n_samples=250)
    (recording,) = read("binary8byte.uff", vendors, description).recordings
    spectrum = np.abs(np.fft.rfft(recording.samples[0]))
    assert np.fft.rfftfreq(250, 0.01)[spectrum.argmax()] == pytest.approx(5.0, abs=0.2)  # half a line of 0.4 Hz
    assert np.abs(recording.samples[0]).max() == pytest.approx(9.80665, rel=2e-3)  # 1 g, no sample on the crest


def test_a_file_with_a_unit_outside_ascii_and_a_short_last_line_is_read(vendors):
    description = RawDescription((RawChannel("a", "1x", "acceleration"),), rate=20000.0, n_samples=13)
    (recording,) = read("time-history-not-all-columns-filled.uff", vendors, description).recordings
    np.testing.assert_array_equal(recording.samples[0, [0, 12]], [-3.81956, -5.84096])  # as printed, m/s²


def test_an_excerpt_is_reported_as_truncated(vendors):
    """The file has 42 of the 2 508 876 stated samples; pyuff returns the 42 without a message."""
    description = RawDescription((RawChannel("p", 0, "pressure"),))
    (error,) = read("dataset_milestone_in_header.uff", vendors, description).errors
    assert error.reason == "truncated"
    assert "byte 0: ends after 42 of 2508876 samples. Copy the file again" in str(error)


def test_the_error_of_a_file_without_time_responses_states_its_content(vendors):
    with pytest.raises(ReadError, match="it holds 1 x frequency response and no time response"):
        read("non_ascii_header.uff", vendors, RawDescription((RawChannel("a", 0, "acceleration"),)))
    with pytest.raises(ReadError, match=r"1 x header, .* and no time response"):
        read(VENDORS[2], vendors, RawDescription((RawChannel("a", 0, "acceleration"),)))


def test_frequency_responses_have_their_unit(vendors):
    frf = read_frf(vendors / "non_ascii_header.uff", vendors)
    assert frf.units == ("(1/N)*(m/s²)",)
    assert frf.frequency == pytest.approx(0.195313 * np.arange(6))
    assert frf.frf[0, 1] == -0.0599924 - 0.0553260j  # as printed
    with pytest.raises(ReadError, match="no frequency response"):
        read_frf("binary8byte.uff", vendors)


def test_the_frequency_responses_of_the_beam_have_their_peaks_at_the_known_resonances(vendors):
    """Peaks of the plotted curves: 52.6, 144.6, 283.1, 468.3, 698.5, 973.0, 1293 Hz."""
    frf = read_frf("beam.uff.gz", vendors)
    assert frf.frf.shape == (3, 64000)
    assert frf.frequency[[0, -1]] == pytest.approx([0.0, 6399.9])
    for peak in (52.6, 144.6, 283.1, 468.3, 698.5, 973.0, 1293.0):
        near = np.abs(frf.frequency - peak) < 3.0
        sum_of_squares = (np.abs(frf.frf[:, near]) ** 2).sum(axis=0)
        assert frf.frequency[near][sum_of_squares.argmax()] == pytest.approx(peak, abs=0.5)


def test_truncated_frequency_responses_are_an_error(vendors, tmp_path):
    whole = gzip.decompress((vendors / "beam.uff.gz").read_bytes())
    (tmp_path / "beam.uff").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ReadError, match="the set is not closed by -1"):
        read_frf("beam.uff", tmp_path)


def test_a_step_truncated_in_the_header_gives_the_exact_rate(hammer_test, in_si, tmp_path):
    """1/51200 s = 1.953125E-05; a header may state 1.95312E-05, which is 51200.13 Hz."""
    path = write(hammer_test, tmp_path / "a.uff", "uff58b")
    cut = path.read_bytes().replace(b" 1.95313e-05", b" 1.95312E-05")
    assert cut.count(b" 1.95312E-05") == 8
    path.write_bytes(cut)
    assert read("a.uff", tmp_path, in_si).recordings[0].rate == 51200.0
    assert read("a.uff", tmp_path, replace(in_si, rate=None)).recordings[0].rate == 51200.0
    assert read("a.uff", tmp_path, replace(in_si, rate=51201.0)).errors[0].reason == "wrong_rate"


def test_bytes_like_the_delimiter_do_not_divide_a_binary_set(hammer_test, in_si, tmp_path):
    """pyuff searches the samples for the delimiter too, and finds an odd number of delimiters here."""
    delimiter = np.frombuffer(b"\n    -1\n", dtype="<f8")[0]
    samples = hammer_test[1].samples.copy()
    samples[0, 10] = delimiter
    hammer_test[1] = replace(hammer_test[1], samples=samples)
    path = write(hammer_test, tmp_path / "a.uff", "uff58b")
    assert pyuff.UFF(str(path)).get_n_sets() == 8  # of 17 delimiters; intact sets after the false one are lost
    assert np.count_nonzero(pyuff.UFF(str(path)).get_set_types() == 58) < 8
    result = read("a.uff", tmp_path, in_si)
    assert result.errors == () and len(result.recordings) == 4
    np.testing.assert_array_equal(result.recordings[1].samples, samples)


@pytest.mark.parametrize("ending", [b"\r\n", b"\n"])
def test_the_closing_delimiter_can_have_its_own_line(ending, hammer_test, in_si, tmp_path):
    """Some exporters write a line break after the binary numbers, others do not."""
    path = write(hammer_test, tmp_path / "a.uff", "uff58b")
    data = path.read_bytes()
    at = 0
    parts = []
    for one in read_datasets(data):
        end = data.find(b"    -1\n", one.offset + 13 * 80 + 301 * 8 - 100)
        parts.append(data[at:end] + ending)
        at = end
    path.write_bytes(b"".join(parts) + data[at:])
    result = read("a.uff", tmp_path, in_si)
    assert result.errors == ()
    for got, put in zip(result.recordings, hammer_test, strict=True):
        np.testing.assert_array_equal(got.samples, put.samples)


def test_big_endian_numbers_and_crlf_are_read(hammer_test, in_si, tmp_path):
    head, numbers, tail = _first_set(write(hammer_test[:1], tmp_path / "a.uff", "uff58b").read_bytes())
    swapped = head.replace(b"    58b     1", b"    58b     2").replace(b"\n", b"\r\n")
    big = np.frombuffer(numbers, "<f8").astype(">f8").tobytes()
    one = replace(in_si, channels=in_si.channels[:1])
    (tmp_path / "a.uff").write_bytes(swapped + big + tail.replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(read("a.uff", tmp_path, one).recordings[0].samples[0], hammer_test[0].samples[0])


def test_another_floating_point_format_is_rejected(hammer_test, in_si, tmp_path):
    head, numbers, tail = _first_set(write(hammer_test[:1], tmp_path / "a.uff", "uff58b").read_bytes())
    (tmp_path / "a.uff").write_bytes(head.replace(b"     1     2", b"     1     1", 1) + numbers + tail)
    (error,) = read("a.uff", tmp_path, replace(in_si, channels=in_si.channels[:1])).errors
    assert "floating-point format 1 is not IEEE 754 (2)" in str(error)


def _first_set(data):
    """(head, numbers, closing delimiter) of the first set."""
    at = sum(len(line) + 1 for line in data.split(b"\n", 13)[:13])
    return data[:at], data[at : at + 301 * 8], b"    -1\n"


def test_unnumbered_sets_of_one_channel_after_the_other_are_paired_by_order(hammer_test, in_si, tmp_path):
    """pyuff states single precision and writes double precision; all forces precede all accelerations."""
    file = pyuff.UFF(str(tmp_path / "a.uff"))
    for i, (name, unit) in enumerate((("force", "N"), ("rail", "m/s²"))):
        for recording in hammer_test:
            one = pyuff.prepare_58(
                binary=1, func_type=1, rsp_node=i, rsp_dir=3, ref_node=0, ref_dir=0, id1=name, abscissa_spacing=1,
                ord_data_type=2, abscissa_spec_data_type=17, ordinate_spec_data_type=12, orddenom_spec_data_type=0,
                ordinate_axis_units_lab=unit, data=recording.samples[i], x=np.arange(301) / 51200.0,
            )  # fmt: skip
            file._write_set(one, "add", force_double=False)
    result = read("a.uff", tmp_path, in_si)
    assert result.errors == ()
    for got, put in zip(result.recordings, hammer_test, strict=True):
        np.testing.assert_array_equal(got.samples, put.samples)


def test_unnumbered_sets_with_a_lost_header_are_not_paired(hammer_test, in_si, tmp_path):
    """The force of one impact with the acceleration of the next would look like an intact record."""
    path = write(hammer_test, tmp_path / "a.uff", "uff58")
    data = path.read_bytes()
    for k in range(4):
        data = data.replace(f"    1         0{k + 1:5d}".encode(), b"    1         0    0")
    data = re.sub(rb"\d\d-\w\w\w-\d\d \d\d:\d\d:\d\d", b"NONE              ", data)
    assert len(_read_bytes(path, data, in_si).recordings) == 4
    third = data.find(b"    -1\n    58", data.find(b"    -1\n    58", data.find(b"    -1\n    58") + 7) + 7)
    broken = data[: third + 11] + b"??" + data[third + 13 :]
    with pytest.raises(ReadError, match="no numbers or times say which belong together"):
        _read_bytes(path, broken, in_si)


def _sets_without_numbers(hammer_test, tmp_path, line_3=None):
    """Text of each set F1 R1 F2 R2 ... without sequence numbers and with the given texts in ID line 3."""
    text = write(hammer_test, tmp_path / "a.uff", "uff58").read_text(encoding="utf-8")
    sets = ["    -1\n    58" + part for part in text.split("    -1\n    58")[1:]]
    sets = [re.sub(r"^(    1         0) {4}\d", r"\1    0", part, flags=re.MULTILINE) for part in sets]
    if line_3 is not None:
        lines = [part.split("\n") for part in sets]
        sets = ["\n".join([*one[:4], stamp, *one[5:]]) for one, stamp in zip(lines, line_3, strict=True)]
    return sets


STAMPS = [f"13-May-24 10:0{k // 2}:0{k % 2}" for k in range(8)]  # equal for both sets of an impact except for rounding
SAME = ["13-May-24 10:00:00"] * 8
CHANNEL_AFTER_CHANNEL = (0, 2, 4, 6, 1, 3, 5, 7)
MOVED_AND_LOST = {
    "shuffled": (5, 0, 3, 6, 1, 7, 2, 4),
    "swapped in a record": (0, 1, 3, 2, 4, 5, 6, 7),
    "one lost": (0, 2, 3, 4, 5, 6, 7),
    "two lost, in turn": (0, 3, 4, 7),
    "two lost, shifted": (0, 3, 2, 5, 4, 7),
    "channel after channel, two lost": (0, 2, 6, 1, 5, 7),
    "channel after channel, one lost": (2, 4, 6, 1, 3, 5, 7),
}


def _impacts(result, hammer_test):
    """Number of the impact of each recording, each with force and response of one impact."""
    impacts = []
    for recording in result.recordings:
        same = [
            [np.allclose(recording.samples[i], h.samples[i], rtol=1e-5, atol=1e-9) for h in hammer_test]
            for i in range(2)
        ]
        assert same[0] == same[1] and sum(same[0]) == 1
        impacts.append(same[0].index(True))
    return impacts


@pytest.mark.parametrize("order", MOVED_AND_LOST.values(), ids=MOVED_AND_LOST)
def test_sets_without_numbers_are_paired_by_their_times(order, hammer_test, in_si, tmp_path):
    sets = _sets_without_numbers(hammer_test, tmp_path, STAMPS)
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in order).encode(), in_si)
    assert _impacts(result, hammer_test) == [k for k in range(4) if {2 * k, 2 * k + 1} <= set(order)]
    assert all("is missing from this record" in e.problem for e in result.errors if e.where.startswith("record"))


@pytest.mark.parametrize("line_3", [SAME, ["NONE"] * 8])
@pytest.mark.parametrize("name", ["shuffled", "swapped in a record", "one lost", "channel after channel, one lost"])
def test_sets_in_irregular_order_without_times_are_an_error(name, line_3, hammer_test, in_si, tmp_path):
    sets = _sets_without_numbers(hammer_test, tmp_path, line_3)
    with pytest.raises(ReadError, match="come in no regular order, and neither numbers, times nor nodes") as caught:
        _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in MOVED_AND_LOST[name]).encode(), in_si)
    assert "field 3 of record 6" in caught.value.remedy


@pytest.mark.parametrize("order", [range(8), CHANNEL_AFTER_CHANNEL])
@pytest.mark.parametrize("line_3", [SAME, STAMPS, ["NONE"] * 8, [*STAMPS[:4], *["NONE"] * 4]])
def test_sets_in_regular_order_are_paired_without_times(line_3, order, hammer_test, in_si, tmp_path):
    sets = _sets_without_numbers(hammer_test, tmp_path, line_3)
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in order).encode(), in_si)
    assert _impacts(result, hammer_test) == [0, 1, 2, 3]


@pytest.mark.parametrize(("lost_force", "lost_rail"), [(0, 8), (8, 0), (2, 7), (None, None), (4, 4)])
@pytest.mark.parametrize("seed", range(5))
def test_the_ratio_of_response_to_force_shows_that_two_lost_sets_shifted_the_others(
    lost_force, lost_rail, seed, hammer_test, in_si, tmp_path
):
    """Nine impacts of different strength; one force and the response of another impact are lost."""
    rng = np.random.default_rng(seed)
    scatter = np.exp(0.01 * rng.normal(size=(9, 2, 1)))
    shape = rng.normal(size=(2, 301)) * [[100.0], [30.0]]
    strengths = rng.uniform(5.0, 10.0, size=9)
    impacts = [replace(hammer_test[0], samples=shape * a * b) for a, b in zip(strengths, scatter)]
    sets = _sets_without_numbers(impacts, tmp_path, ["NONE"] * 18)
    forces = [one for k, one in enumerate(sets[::2]) if k != lost_force]
    rails = [one for k, one in enumerate(sets[1::2]) if k != lost_rail]
    data = "".join(forces + rails).encode()
    if lost_force == lost_rail:
        result = _read_bytes(tmp_path / "a.uff", data, in_si)
        assert len(result.recordings) == (9 if lost_rail is None else 8)
        return
    with pytest.raises(ReadError, match="have lost their partners") as caught:
        _read_bytes(tmp_path / "a.uff", data, in_si)
    assert "field 3 of record 6" in caught.value.remedy


def test_records_without_times_are_not_paired_by_order_if_other_times_contradict_it(hammer_test, in_si, tmp_path):
    """Impacts 1 and 2 have no times; the rail of 3 and the force of 4 are lost and must not be joined."""
    sets = _sets_without_numbers(hammer_test, tmp_path, [*["NONE"] * 4, *STAMPS[4:]])
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in (0, 1, 2, 3, 4, 7)).encode(), in_si)
    assert result.recordings == ()
    problems = [e.problem for e in result.errors if e.where.startswith("record ")]
    contradiction = "states 2024-05-13 10:02:00 in ID line 3, channel 'rail' 2024-05-13 10:03:01 in ID line 3"
    unsettled = "record 3 shows that sets are lost or moved, and nothing confirms those of this record"
    assert problems[:2] == [unsettled] * 2 and contradiction in problems[2]
    sets = _sets_without_numbers(hammer_test, tmp_path, [*STAMPS[:2], *["NONE"] * 2, *STAMPS[4:]])
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in (0, 1, 2, 3, 4, 7)).encode(), in_si)
    assert _impacts(result, hammer_test) == [0]


def _at_nodes(sets, nodes):
    """Sets with these reference nodes."""
    lines = [one.split("\n") for one in sets]
    return [
        "\n".join([*one[:7], f"{one[7][:66]}{node:10d}{one[7][76:]}", *one[8:]])
        for one, node in zip(lines, nodes, strict=True)
    ]


def test_sets_without_times_are_paired_by_the_nodes_of_the_impacts(hammer_test, in_si, tmp_path):
    sets = _at_nodes(_sets_without_numbers(hammer_test, tmp_path, SAME), [11, 11, 12, 12, 13, 13, 14, 14])
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in (0, 3, 4, 1, 6, 7)).encode(), in_si)
    assert sorted(_impacts(result, hammer_test)) == [0, 3]
    sets = _at_nodes(_sets_without_numbers(hammer_test, tmp_path, SAME), [11, 11, 11, 11, 13, 13, 13, 13])
    result = _read_bytes(tmp_path / "a.uff", "".join(sets[i] for i in (0, 1, 2, 7, 4, 3, 6, 5)).encode(), in_si)
    assert result.recordings == ()
    assert "channel 'force' states an impact at node 11, channel 'rail' an impact at node 13" in str(result.errors[1])


def _read_bytes(path, data, description):
    path.write_bytes(data)
    return read(path.name, path.parent, description)


def test_a_missing_set_at_the_end_is_an_error_of_the_last_record(hammer_test, in_si, tmp_path):
    path = write(hammer_test, tmp_path / "a.uff", "uff58b")
    data = path.read_bytes()
    last = data.rfind(b"    -1\n    58b")
    result = _read_bytes(path, data[:last], in_si)
    assert [r.record for r in result.recordings] == [0, 1, 2]
    (error,) = result.errors
    assert error.reason == "truncated"
    assert "record 4 of 4: channel 'rail' is missing from this record" in str(error)


# Unit code of dataset 164, factors for length and force, and one unit of force and length in newtons and metres.
UNITS_164 = [
    (1, 1.0, 1.0, 1.0, 1.0),
    (5, 1000.0, 1000.0, 1e-3, 1e-3),
    (7, 39.37007874, 0.22480894, 4.4482216, 0.0254),
    (10, 1000.0, 1.0, 1.0, 1e-3),
]


@pytest.mark.parametrize("column", ["25.17E", "17.8E"])  # that of the format, and one of other programs
@pytest.mark.parametrize(("code", "length", "force", "newton", "metre"), UNITS_164)
def test_ordinates_without_a_label_are_in_the_units_of_dataset_164(
    code, length, force, newton, metre, column, tmp_path
):
    recording = Recording(
        np.random.default_rng(164).normal(size=(2, 64)), 1000.0, (Channel("f", "force"), Channel("a", "acceleration"))
    )
    path = write([recording], tmp_path / "a.uff", "uff58")
    lines = path.read_text().splitlines()
    lines = [
        f"{line[:46]}{'NONE':<20}" if line[:10].strip() in ("12", "13") and line[46:66].strip() else line
        for line in lines
    ]
    factors = "".join(format(factor, column) for factor in (length, force, 1.0))
    head = ["    -1", "   164", f"{code:10d}{'units':20}{2:10d}", factors, format(273.15, column), "    -1"]
    path.write_text("\n".join([*(h.replace("E", "D") if "E+" in h or "E-" in h else h for h in head), *lines]) + "\n")
    channels = (RawChannel("f", "f", "force"), RawChannel("a", "a", "acceleration"))
    found = read(path.name, tmp_path, RawDescription(channels, rate=1000.0)).recordings[0].samples
    assert found == pytest.approx(recording.samples * [[newton], [metre]], rel=1e-5)
    in_si = tuple(RawChannel(c.name, c.source, c.quantity, unit=u) for c, u in zip(channels, ("N", "m/s²")))
    result = read(path.name, tmp_path, RawDescription(in_si, rate=1000.0))
    assert (not result.errors) == (code == 1)
    if code != 1:
        assert result.errors[0].reason == "unit_unknown"


@pytest.mark.parametrize(
    ("code", "length", "force", "label", "stated"),
    [
        (1, 1.0, 1.0, "m/s²", None), (1, 1.0, 1.0, "m/s^2", None), (1, 1.0, 1.0, "g", "m/s²"),
        (1, 1.0, 1.0, "mV", None),
        (5, 1000.0, 1000.0, "m/s²", "mm/s²"), (5, 1000.0, 1000.0, "mm/s²", None), (6, 100.0, 100.0, "g", "cm/s²"),
        (9, 2.5, 1.0, "m/s²", "0.4 m/s²"),
    ],
)  # fmt: skip
def test_a_label_that_contradicts_dataset_164_is_reported(code, length, force, label, stated, tmp_path):
    samples = universal_file(tmp_path, LABELS[0], (f"{'m/s²':<20}", f"{label:<20}"))
    text = (tmp_path / "a.uff").read_text(encoding="utf-8")
    head = [f"{'    -1':80}", "   164", f"{code:10d}{'units':20}{2:10d}", f"{length:25.17E}{force:25.17E}{1.0:25.17E}"]
    (tmp_path / "a.uff").write_text("\n".join([*head, f"{273.15:25.17E}", "    -1", ""]) + text, encoding="utf-8")
    volts = {"unit": "mV", "sensitivity": 1.0, "sensitivity_unit": "mV/(m/s²)"} if label == "mV" else {}
    sensors = (RawChannel("force", "force", "force", unit="N!"), RawChannel("rail", "rail", "acceleration", **volts))
    result = read("a.uff", tmp_path, RawDescription(sensors))
    if stated is None:
        assert [e.reason for e in result.errors] == [] and len(result.recordings) == 2
        return
    assert f"its label says {label!r}, data set 164 of the file {stated!r}" in str(result.errors[0])
    (without_layout,) = file_contents(tmp_path / "a.uff").problems
    assert "Find out which is right" in without_layout and "Find out which is right" in str(result.errors[0])
    overridden = (sensors[0], RawChannel("rail", "rail", "acceleration", unit="m/s²!"))
    assert read("a.uff", tmp_path, RawDescription(overridden)).recordings[0].samples[1] == pytest.approx(
        samples[1], rel=1e-5
    )


@pytest.mark.parametrize(
    ("order", "n_read"), [((0, 1, 0, 1, 4, 5), 3), ((0, 1, 0, 3, 4, 5), None), ((0, 2, 4, 1, 3, 1), None)]
)
def test_a_repeated_set_whose_partner_is_not_repeated_is_an_error(order, n_read, hammer_test, in_si, tmp_path):
    """The hammer test reports a complete repeated impact; the reader reports an incomplete one."""
    sets = _sets_without_numbers(hammer_test, tmp_path, ["NONE"] * 8)
    data = "".join(sets[i] for i in order).encode()
    if n_read:
        assert len(_read_bytes(tmp_path / "a.uff", data, in_si).recordings) == n_read
        return
    with pytest.raises(ReadError, match=r"repeats set \d, and set \d of channel '\w+' does not"):
        _read_bytes(tmp_path / "a.uff", data, in_si)


@pytest.mark.parametrize("values", [np.full(301, -0.0123), np.eye(301)[5]], ids=["dead", "one step"])
def test_equal_sets_of_a_dead_channel_are_not_reported_as_repeated(values, hammer_test, in_si, tmp_path):
    """Only the records with the dead channel are lost."""
    impacts = [replace(r, samples=np.stack([r.samples[0], values])) if k > 1 else r for k, r in enumerate(hammer_test)]
    sets = _sets_without_numbers(impacts, tmp_path, ["NONE"] * 8)
    result = _read_bytes(tmp_path / "a.uff", "".join(sets).encode(), in_si)
    assert len(result.recordings) >= 2


@pytest.mark.parametrize("n", [4, 5, 6, 7])
def test_shifted_sets_are_found_in_short_files_only_if_the_ratios_fit_much_better(n, hammer_test, in_si, tmp_path):
    """The first force and the last response are lost; intact impacts with scattered ratios are read."""
    rng = np.random.default_rng(n)
    strengths = np.array([5.0, 9.0, 6.0, 10.0, 5.5, 8.0, 7.0, 9.5])[: n + 1]
    shape = rng.normal(size=(2, 301)) * [[100.0], [30.0]]
    for scatter, is_lost in [(0.0005, True), *[(0.05, False)] * 20]:
        factors = np.exp(scatter * rng.normal(size=(n + 1, 2, 1)))
        impacts = [replace(hammer_test[0], samples=shape * a * b) for a, b in zip(strengths, factors)]
        sets = _sets_without_numbers(impacts, tmp_path, ["NONE"] * 2 * (n + 1))
        data = "".join(sets[2::2] + sets[1:-1:2] if is_lost else sets).encode()
        if is_lost:
            with pytest.raises(ReadError, match="have lost their partners"):
                _read_bytes(tmp_path / "a.uff", data, in_si)
        else:
            assert len(_read_bytes(tmp_path / "a.uff", data, in_si).recordings) == n + 1


@pytest.mark.parametrize(
    "label, is_read", [("s", True), ("ms", True), ("NONE", True), ("-", True), ("Hz", False), ("m", False)]
)
def test_a_time_response_must_have_a_unit_of_time_on_its_abscissa(label, is_read, tmp_path):
    universal_file(tmp_path)
    text = (tmp_path / "a.uff").read_text(encoding="utf-8")
    text, n = re.subn(r"(?m)^(        17    0    0    0 .{20} )s {19}", lambda m: f"{m[1]}{label:<20}", text)
    assert n == 4
    (tmp_path / "a.uff").write_text(text, encoding="utf-8")
    sensors = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
    result = read("a.uff", tmp_path, RawDescription(sensors))
    assert len(result.recordings) == 2 * is_read
    assert is_read or f"the unit of its abscissa is {label!r}" in str(result.errors[0])


def test_exponents_of_fortran_are_read_in_header_and_samples(tmp_path):
    recording = Recording(
        np.random.default_rng(58).normal(size=(2, 64)), 25600.0, (Channel("f", "force"), Channel("a", "acceleration"))
    )
    path = write([recording], tmp_path / "a.uff", "uff58")
    text = path.read_text()
    path.write_text(re.sub(r"(\d)[eE]([+-]\d\d)", r"\1D\2", text))
    assert path.read_text() != text
    channels = (RawChannel("f", "f", "force"), RawChannel("a", "a", "acceleration"))
    (found,) = read(path.name, tmp_path, RawDescription(channels, rate=25600.0)).recordings
    assert found.samples == pytest.approx(recording.samples, rel=1e-5)


def universal_file(tmp_path, *changes):
    """Two records of a force [N, type 13] and a rail [m/s², type 12], with replacements in the text."""
    channels = (Channel("force", "force"), Channel("rail", "acceleration"))
    samples = np.random.default_rng(5).normal(size=(2, 64)) * [[900.0], [30.0]]
    write([Recording(samples, 25600.0, channels)] * 2, tmp_path / "a.uff", "uff58")
    text = (tmp_path / "a.uff").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "a.uff").write_text(text, encoding="utf-8")
    return samples


LABELS = ((f"{'N':<20}", f"{'NONE':<20}"), (f"{'m/s²':<20}", f"{'NONE':<20}"))


@pytest.mark.parametrize("code, quantity", [(8, "displacement"), (11, "velocity"), (13, "force")])
def test_the_data_type_of_an_ordinate_must_be_the_quantity_of_the_layout(code, quantity, tmp_path):
    """Without dataset 164 and label no unit is stated, but the numbers are no accelerations."""
    samples = universal_file(tmp_path, *LABELS, (f"{12:10d}{0:5d}{0:5d}{0:5d}", f"{code:10d}{0:5d}{0:5d}{0:5d}"))
    force = RawChannel("force", "force", "force", unit="N")
    rail = RawChannel("rail", "rail", "acceleration", unit="m/s²")
    result = read("a.uff", tmp_path, RawDescription((force, rail)))
    assert result.recordings == ()
    assert result.errors[0].reason == "unit_unknown" and quantity in str(result.errors[0])
    (recording, _) = read("a.uff", tmp_path, RawDescription((force, replace(rail, unit="m/s²!")))).recordings
    np.testing.assert_allclose(recording.samples, samples, rtol=1e-6)


def test_the_unit_of_the_layout_is_used_if_the_data_type_states_none(tmp_path):
    samples = universal_file(tmp_path, *LABELS)
    channels = [RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration", unit="g")]
    assert "says the unit" in str(read("a.uff", tmp_path, RawDescription(tuple(channels))).errors[0])
    channels[0] = replace(channels[0], unit="kN")
    (recording, _) = read("a.uff", tmp_path, RawDescription(tuple(channels))).recordings
    np.testing.assert_allclose(recording.samples, samples * [[1000.0], [9.80665]], rtol=1e-6)
    volts = replace(channels[1], unit="V", sensitivity=10.0, sensitivity_unit="mV/g")
    (error, _) = read("a.uff", tmp_path, RawDescription((channels[0], volts))).errors
    assert error.reason == "unit_unknown" and "acceleration" in error.problem


DELIMITER = "    -1\n"
TAILS = [DELIMITER, 2 * DELIMITER, f"{DELIMITER}End\n{DELIMITER}", "End\n", "\x1a", DELIMITER + "text\n" * 99]


@pytest.mark.parametrize("tail", TAILS)
def test_text_after_the_last_set_is_accepted(tail, tmp_path):
    """The file states its number of records; without this number, a further set may be missing."""
    universal_file(tmp_path)
    description = RawDescription((RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")))
    path = tmp_path / "a.uff"
    path.write_text(path.read_text(encoding="utf-8") + tail, encoding="utf-8")
    result = read("a.uff", tmp_path, description)
    assert len(result.recordings) == 2 and result.errors == ()
    path.write_text(path.read_text(encoding="utf-8").replace(" of 2 ", " /// "), encoding="utf-8")
    result = read("a.uff", tmp_path, description)
    assert len(result.recordings) == 2 and len(result.errors) <= 1
    assert all("delete what follows the last set" in error.remedy for error in result.errors)


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (20, "1.2x456e+00", "'1.2x456e+00' is no number"),
        (20, "1.2'456e+00", "'1.2'456e+00' is no number"),
        (20, "", "it is blank"),
        (9, "4.5", "'4.5' is no number"),
        (9, "", "it is blank"),
    ],
)
def test_a_text_in_place_of_a_number_is_quoted_without_words_of_python(line, text, words, hammer_test, in_si, tmp_path):
    path = write(hammer_test[:1], tmp_path / "a.uff", "uff58")
    lines = path.read_bytes().split(b"\n")
    width = 20 if line == 20 else 10
    lines[line - 1] = text.encode().rjust(width) + lines[line - 1][width:]
    path.write_bytes(b"\n".join(lines))
    try:
        message = "; ".join(map(str, read(path.name, tmp_path, in_si).errors))
    except ReadError as error:
        message = str(error)
    assert f"cannot be read ({words})" in message
