"""What `turnout simulate` is asked for, checked before anything is simulated."""

from datetime import datetime
from pathlib import Path

from turnout.config.events import wrong_time
from turnout.config.schema import suggestion
from turnout.errors import ConfigError
from turnout.readers.writing import WRITERS

ENDINGS = {"uff58": "uff", "uff58b": "uff", "hdf5": "h5", "mat73": "mat", "rcmdx": "rcmdx"}
WHOLE = {"tests": 1, "blows": 1, "units": 1, "seed": 0}


def check_request(request) -> None:
    """ConfigError for options that cannot be followed to the letter.

    >>> check_request({"format": "hdf5", "at": "2024-05-13", "seed": 0, "tests": 2, "out": "a.h5"})
    Traceback (most recent call last):
    turnout.errors.ConfigError: simulate, --out: one file for 2 tests. Write --tests 1, or leave out --out.
    """
    for option, least in WHOLE.items():
        if option in request and request[option] < least:
            raise _wrong(option, repr(request[option]), f"Write a whole number of at least {least}")
    if request["format"] not in WRITERS:
        raise _wrong("format", repr(request["format"]), suggestion(request["format"], WRITERS))
    if request.get("out") and request.get("tests", 1) > 1:
        raise _wrong("out", f"one file for {request['tests']} tests", "Write --tests 1, or leave out --out")
    if wrong := wrong_time(request["at"]):
        raise _wrong("at", f"{request['at']!r} is not a time in UTC{wrong[0]}", wrong[1])


def with_format(request) -> dict:
    """The request with the format that the ending of its file says, where none is named; HDF5 where nothing does.

    >>> with_format({"format": None, "out": "a.npz"})["format"], with_format({"format": None, "out": None})["format"]
    ('npz', 'hdf5')
    """
    if request["format"] or not request.get("out"):
        return {**request, "format": request["format"] or "hdf5"}
    ending = Path(request["out"]).suffix.lstrip(".").lower()
    known = {ending_of(name): name for name in reversed(WRITERS)} | {"hdf5": "hdf5", "hdf": "hdf5"}
    if ending not in known:
        remedy = f"Write one of .{', .'.join(sorted(known))}, or say --format"
        raise _wrong("out", f"{request['out']!r}, whose ending is no format", remedy)
    return {**request, "format": known[ending]}


def ending_of(format_name: str) -> str:
    """Ending of files of a format.

    >>> ending_of("hdf5")
    'h5'
    """
    return ENDINGS.get(format_name, format_name)


def time_of(request) -> datetime:
    """UTC time of the first sample."""
    return datetime.fromisoformat(request["at"].removesuffix("Z"))


def section_channels(turnout, section: float | str):
    """What the files of a section's hammer tests hold; ConfigError where the turnout has no tests of ``section``."""
    if turnout.hammer is None:
        raise _wrong("turnout", f"{turnout.id} has no hammer tests in its layout", "Name another one, or none")
    known = turnout.hammer.descriptions
    if section not in known:
        found = f"{section!r} is no section of {turnout.id}, whose raw files are sought by section"
        remedy = f"Write one of {', '.join(known)}; places in metres go without --turnout"
        raise _wrong("section", found, remedy)
    return known[section]


def _wrong(option: str, found: str, remedy: str) -> ConfigError:
    return ConfigError("simulate", f"--{option}", found, remedy)
