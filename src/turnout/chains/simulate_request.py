"""What `turnout simulate` is asked for, checked before anything is simulated."""

from datetime import datetime

from turnout.config.events import wrong_time
from turnout.config.keys import suggestion
from turnout.errors import ConfigError
from turnout.readers.writing import WRITERS

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
