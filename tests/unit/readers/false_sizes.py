"""Small intact files of every format, and copies in which one number that states a size is false."""

import struct
from datetime import datetime
from itertools import islice

import numpy as np

from turnout.readers.writing import write
from turnout.records import Channel, Recording

ENDINGS = {
    "uff58": "uff", "uff58b": "uff", "tdms": "tdms", "hdf5": "h5", "rcmdx": "rcmdx", "mat": "mat", "mat73": "mat",
    "wav": "wav", "flac": "flac", "csv": "csv", "lvm": "lvm", "npz": "npz", "parquet": "parquet",
}  # fmt: skip
N_SAMPLE, RATE = 1237, 5003.0  # primes: a number that equals them, or 2, 4 or 8 times them in bytes, states a size
FALSE_SIZES = (2**27, 2**30, 2**31 - 1, 2**32 - 2, 2**40, 2**62)
ACCEPTED = {
    "read",
    "unreadable",
    "truncated",
    "claims_too_much",
    "wrong_length",
    "empty",
    "wrong_rate",
    "channel_missing",
}
INTEGERS = ("<H", ">H", "<I", ">I", "<Q", ">Q")


def intact(folder, format):
    """Write a file of two channels of noise; return its path."""
    samples = np.random.default_rng(5).normal(size=(2, N_SAMPLE))
    path = folder / f"{format}.{ENDINGS[format]}"
    if format == "flac":
        import soundfile

        soundfile.write(path, samples.T / 10.0, int(RATE), subtype="PCM_16")
        return path
    if format == "mat":  # not compressed, so that its numbers can be replaced
        import scipy.io

        scipy.io.savemat(path, {"a": samples[0], "b": samples[1], "fs": RATE})
        return path
    channels = (Channel("a", "acceleration"), Channel("b", "acceleration"))
    recording = Recording(samples, RATE, channels, started_at=datetime(2024, 5, 13, 10))
    return write([recording], path, format)


def false_sizes_of(content):
    """Yield (place, content) for each number in the file that states a size, with each false_size that fits there."""
    for number in sorted({factor * N_SAMPLE + more for factor in (1, 2, 4, 8, 16) for more in (0, 1, 128)}):
        for form in INTEGERS:
            for false_size in FALSE_SIZES:
                try:
                    old, new = struct.pack(form, number), struct.pack(form, false_size)
                except struct.error:
                    continue
                for at in islice(_places(content, old), 4):
                    yield f"{form}{number} at {at} is {false_size}", content[:at] + new + content[at + len(old) :]
        old = str(number).encode()
        for false_size in FALSE_SIZES:
            for at in islice(_places(content, old), 4):
                new = str(false_size).encode()
                yield f"text {number} at {at} is {false_size}", content[:at] + new + content[at + len(old) :]


def _places(content, old):
    at = content.find(old)
    while at >= 0:
        yield at
        at = content.find(old, at + 1)


def layout(format):
    """The layout of the intact file: channels a and b, which have numbers in WAV and FLAC."""
    from turnout.records import RawChannel, RawDescription

    sources = (0, 1) if format in ("wav", "flac") else ("a", "b")
    return RawDescription(tuple(RawChannel(n, s, "acceleration", unit="m/s²!") for n, s in zip("ab", sources)), RATE)


def lengths(folder, format):
    """Numbers of samples of the recordings of the intact file and its errors, read completely and lazily."""
    from turnout.readers import read

    name = intact(folder, format).name
    found = [read(name, folder, layout(format), **lazily) for lazily in LAZILY]
    return [[r.n_sample for r in (*f.recordings, *f.long_recordings)] + list(f.errors) for f in found]


LAZILY = ({}, {"max_duration": 1e-3, "max_whole_file_size": 0})


def outcomes(folder, format, most=60):
    """{place: outcome} of at most ``most`` false sizes of a format, evenly distributed over the file."""
    from turnout.errors import ReadError
    from turnout.readers import read

    path = intact(folder, format)
    cases = list(false_sizes_of(path.read_bytes()))
    found = {}
    for place, content in cases[:: -(-len(cases) // most) or 1]:
        path.write_bytes(content)
        for lazily in LAZILY:
            try:
                result = read(path.name, folder, layout(format), **lazily)
                longest = max((r.n_sample for r in (*result.recordings, *result.long_recordings)), default=0)
                reasons = sorted({error.reason for error in result.errors} - ACCEPTED)
                outcome = "read" if longest <= N_SAMPLE else f"{longest} samples"
                outcome = f"{outcome}, {reasons}" if reasons else outcome
            except ReadError as error:
                outcome = error.reason if path.name in str(error) else f"no name: {error}"
            except BaseException as error:
                outcome = f"{type(error).__name__}: {error}"
            found[f"{place} {lazily}"] = outcome
    return found
