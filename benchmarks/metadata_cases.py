"""Files with made-up metadata in every format, and what the readers make of them.

A harmful file states a rate, step, length, scale, offset or unit that contradicts the layout, under a name from
``metadata_words``. It is silent if it is read without a message as if nothing were stated. A benign file states nothing
that contradicts the layout; a remark on it costs the user a look.
"""

import json
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tests.unit.readers.test_readers_rate_matrix import FORMATS, N_SAMPLE, SAMPLES, TRUE, described, plain

from benchmarks.metadata_words import BENIGN, KINDS, LANGUAGES, OPAQUE, PHRASES, RATES_UNDER_STRONG, STRONG
from turnout.errors import ReadError
from turnout.readers import read

WRONG_RATES = (20000.0, 12800.0, 51200.0, 48000.0, 10000.0, 2560.0)
SCALES = (9.81, 1000, 0.001, 4.448, 2.5, "x10", "20 dB", 0.000305, -1, "0.5", "10 mV/V", 25.4)
OFFSETS = (12.5, "3.2 N", 0.4, -7, 32768, "0,35")
UNITS = ("kN", "lbf", "g", "mV", "mm/s²", "daN", "V", "counts", "kgf")
PLACES = ("first", "second", "text", "nested")


@dataclass(frozen=True)
class Case:
    """One file: its ``entries`` (name, value), their ``kind``, and the ``outcome`` of reading with a ``note``.

    ``outcome`` is ``read`` (as if nothing were stated), ``applied`` (other samples), ``remarked`` (read, with a
    message), ``reported`` (rejected by name), ``wrong`` (another rate) or ``crash``.
    """

    kind: str
    format: str
    place: str
    entries: tuple
    outcome: str
    note: str = ""


def harmful_values(kind: str, rng: random.Random):
    """A value of the kind that contradicts a record of 64 samples at 25.6 kHz in N and m/s²."""
    r = rng.choice(WRONG_RATES)
    values = {
        "rate": (r, int(r), f"{r:g} Hz", f"{r / 1e3:g} kHz", f"{r:g} S/s", f"{r:.4E}", f"{r / 1e3:g} kS/s", f"{r:g}"),
        "step": (
            1 / r,
            f"{1e6 / r:g} us",
            f"{1e3 / r:g} ms",
            f"{1 / r:.6E}",
            f"{1e6 / r:g} µs",
            1e6 / r,
            f"{1 / r:g} s",
        ),
        "length": (f"{1e3 * N_SAMPLE / r:g} ms", N_SAMPLE / r, f"{N_SAMPLE / r:g} s"),
        "scale": SCALES,
        "offset": OFFSETS,
        "unit": UNITS,
    }
    return rng.choice(values[kind])


def styles(phrase: str, rng: random.Random) -> str:
    """The phrase as a logger may write it."""
    words = phrase.split()
    cut = [w[0] + re.sub("[aeiou]", "", w[1:]) if len(w) > 3 else w for w in words]
    typed = list(phrase)
    place = rng.randrange(1, len(typed) - 1)
    typed[place], typed[place + 1 - 2 * (place == len(typed) - 1)] = typed[place + 1], typed[place]
    return rng.choice(
        (
            phrase.title(),
            words[0] + "".join(w.title() for w in words[1:]),
            "_".join(words).upper(),
            "dev." + ".".join(words),
            "_".join(cut),
            "".join(w.title() for w in cut),
            " ".join(w[:4] for w in words) + ".",
            "".join(typed),
            f"{phrase} [1]",
        )
    )


def named_entries(which: str, rng: random.Random) -> Iterator[tuple[str, str, object, int]]:
    """(kind, name, value, number of formats) of each harmful entry of a set."""
    for names, _ in LANGUAGES[which].values():
        for kind, name in zip(KINDS, names, strict=True):
            yield kind, name, harmful_values(kind, rng), 3
    for kind, phrases in PHRASES[which].items():
        for phrase in phrases:
            for _ in range(2):
                yield kind, styles(phrase, rng), harmful_values(kind, rng), 2
    for name in OPAQUE[which]:
        for kind in KINDS:
            yield f"opaque {kind}", name, harmful_values(kind, rng), 1
    for name in STRONG[which]:
        for form in RATES_UNDER_STRONG[which]:
            r = rng.choice(WRONG_RATES)
            yield "under another name", name, form.format(r=r, k=r / 1e3, u=1e6 / r), 1


def can_hold(format: str, *texts) -> bool:
    """Whether the writer of the format can hold a name and a value."""
    texts = [str(t) for t in texts]
    if format == "uff":
        return all(t.isascii() for t in texts)
    ascii_name = plain(texts[0])
    return format != "mat" or (texts[0].isascii() and ascii_name[:1].isalpha() and len(ascii_name) < 28)


def outcome_of(folder: Path, format: str, entries: list) -> tuple[str, str]:
    """Write a file with the entries, read it at the true rate; (outcome, note)."""
    write, name, _ = FORMATS[format]
    if format == "mat":
        entries = [(plain(n), _plain_keys(v)) for n, v in entries]
    write(folder / name, entries)
    try:
        result = read(name, folder, described(TRUE))
    except ReadError as error:
        return "reported", str(error)
    except Exception as error:
        return "crash", repr(error)
    if result.errors:
        return ("remarked" if result.recordings else "reported"), str(result.errors[0])
    recording = result.recordings[0]
    if abs(recording.rate / TRUE - 1) > 1e-3:
        return "wrong", f"rate {recording.rate}"
    return ("read" if np.allclose(recording.samples, SAMPLES, rtol=1e-5) else "applied"), ""


def _plain_keys(value):
    return {plain(k): _plain_keys(x) for k, x in value.items()} if isinstance(value, dict) else value


def placed(name: str, value, format: str, place: str, rng: random.Random) -> list:
    """Entries of a file that states the value in a place: alone, after another, in a sentence, nested."""
    if place == "text":
        return [("Comment", f"{name}{rng.choice([': ', ' = '])}{value}")]
    if place == "nested" and format in ("parquet", "npz", "wav"):
        return [("operator", "mj"), ("hardware", {"slot 1": {name: value}})]
    return [(name, value)] if place == "first" else [("operator", "mj"), (name, value)]


def harmful(which: str) -> Iterator[Case]:
    """Each harmful entry of a set, in formats and places chosen by a fixed seed."""
    rng = random.Random(f"harmful {which}")
    with TemporaryDirectory() as folder:
        for kind, name, value, n_formats in named_entries(which, rng):
            able = [f for f in FORMATS if can_hold(f, name, value)]
            for format in rng.sample(able, min(n_formats, len(able))):
                place = rng.choice(PLACES)
                entries = placed(name, value, format, place, rng)
                yield Case(kind, format, place, ((name, value),), *outcome_of(Path(folder), format, entries))


def benign(which: str) -> Iterator[Case]:
    """Each benign header of a set in every format; true statements and other subjects of each language too."""
    headers = [*BENIGN[which], *(subjects for _, subjects in LANGUAGES[which].values())]
    with TemporaryDirectory() as folder:
        for header in headers:
            for format in FORMATS:
                items = [(n, _held(v, format)) for n, v in header.items() if can_hold(format, n, v)]
                items = items[:3] if format == "uff" else items
                if items:
                    yield Case("benign", format, "", tuple(items), *outcome_of(Path(folder), format, items))


def _held(value, format: str):
    """The value as the format can hold it: lists as text."""
    if isinstance(value, dict | list) and format in ("csv", "lvm", "tdms", "uff"):
        return ", ".join(map(str, value))
    return json.dumps(value) if isinstance(value, dict) and format in ("hdf5", "rcmdx") else value


def is_silent(case: Case) -> bool:
    """Whether a harmful case was read without any message, or not as stated."""
    if case.outcome == "applied":
        return not any(kind in case.kind for kind in ("scale", "offset", "unit"))
    return case.outcome in ("read", "wrong", "crash")
