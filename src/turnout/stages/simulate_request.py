"""Check the request of a simulation, and make one from the files that Snakemake asks for."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from turnout.config.events import parse_utc, time_problem
from turnout.config.schema import suggestion
from turnout.errors import ConfigError
from turnout.readers.writing import WRITERS

ENDINGS = {"uff58": "uff", "uff58b": "uff", "hdf5": "h5", "mat73": "mat", "rcmdx": "rcmdx"}
# Least and largest number of an option; one that is larger takes hours or fills the disk.
COUNT_LIMITS = {"tests": (1, 100), "impacts": (1, 1000), "units": (1, 50), "seed": (0, 2**63 - 1)}


def check_request(request: Mapping[str, Any]) -> None:
    """Check the options of a request.

    Parameters
    ----------
    request : mapping of str to any
        Options of the command by name.

    Raises
    ------
    ConfigError
        An option is invalid, or two contradict each other.

    Examples
    --------
    >>> check_request({"format": "hdf5", "at": "2024-05-13", "seed": 0, "tests": 2, "out": "a.h5"})
    Traceback (most recent call last):
    turnout.errors.ConfigError: simulate, --out: one file for 2 tests. Write --tests 1, or leave out --out.
    """
    for option, (lowest, highest) in COUNT_LIMITS.items():
        if option in request and not lowest <= request[option] <= highest:
            raise option_error(option, repr(request[option]), f"Write a whole number from {lowest} to {highest}")
    if request["format"] not in WRITERS:
        raise option_error("format", repr(request["format"]), suggestion(request["format"], WRITERS))
    if request.get("out") and request.get("tests", 1) > 1:
        raise option_error("out", f"one file for {request['tests']} tests", "Write --tests 1, or leave out --out")
    if fault := time_problem(request["at"]):
        raise option_error("at", f"{request['at']!r}{fault[0] or ' is not a time in UTC'}", fault[1])


def with_format(request: Mapping[str, Any]) -> dict[str, Any]:
    """The request with its format: as given, else by the file's extension, else HDF5.

    Parameters
    ----------
    request : mapping of str to any
        Options of the command by name.

    Returns
    -------
    dict of str to any
        The request, with an entry "format".

    Raises
    ------
    ConfigError
        The extension of the file is that of no format.

    Examples
    --------
    >>> with_format({"format": None, "out": "a.npz"})["format"], with_format({"format": None, "out": None})["format"]
    ('npz', 'hdf5')
    """
    if request["format"] or not request.get("out"):
        return {**request, "format": request["format"] or "hdf5"}
    ending = Path(request["out"]).suffix.lstrip(".").lower()
    formats = {ending_of(name): name for name in reversed(WRITERS)} | {"hdf5": "hdf5", "hdf": "hdf5"}
    if ending not in formats:
        remedy = f"Write one of .{', .'.join(sorted(formats))}, or say --format"
        raise option_error("out", f"{request['out']!r}, whose ending is no format", remedy)
    return {**request, "format": formats[ending]}


def ending_of(format_name: str) -> str:
    """File extension of a format.

    Parameters
    ----------
    format_name : str
        A key of ``turnout.readers.writing.WRITERS``.

    Returns
    -------
    str
        Without its dot.

    Examples
    --------
    >>> ending_of("hdf5")
    'h5'
    """
    return ENDINGS.get(format_name, format_name)


def time_of(request: Mapping[str, Any]) -> datetime:
    """UTC time of the first sample.

    Parameters
    ----------
    request : mapping of str to any
        Options of the command by name.

    Returns
    -------
    datetime
        Naive UTC.
    """
    return parse_utc(request["at"])


def option_error(option: str, observation: str, remedy: str) -> ConfigError:
    """The error of an option of ``turnout simulate``.

    Parameters
    ----------
    option : str
        Name of the option, without dashes.
    observation, remedy : str
        What was found, and what to do.

    Returns
    -------
    ConfigError
        To be raised.
    """
    return ConfigError("simulate", f"--{option}", observation, remedy)


REQUEST_DEFAULTS = {
    "turnout": None,
    "config": "config",
    "raw": "raw",
    "format": "hdf5",
    "truth": None,
    "temperature": None,
}


def hammer_request(track: str, out: str, wildcards: Any) -> dict[str, Any]:
    """The request of rule simulate_hammer.

    Parameters
    ----------
    track : str
        Track file.
    out : str
        File to write.
    wildcards : any
        Wildcards of the rule: ``location`` and ``seed``.

    Returns
    -------
    dict of str to any
        Options for ``write_hammer``.
    """
    request = REQUEST_DEFAULTS | {
        "track": track,
        "out": out,
        "section": wildcards.location,
        "seed": int(wildcards.seed),
    }
    return request | {"tests": 1, "impacts": 10, "at": "2024-05-13T09:00:00"}


def passage_request(files: Any, out: Any, wildcards: Any) -> dict[str, Any]:
    """The request of rule simulate_passage.

    Parameters
    ----------
    files : any
        Input of the rule: ``track`` and ``vehicle``.
    out : any
        Output of the rule: ``recording`` and ``truth``.
    wildcards : any
        Wildcards of the rule: ``speed``, ``route``, ``direction`` and ``seed``.

    Returns
    -------
    dict of str to any
        Options for ``write_passage``.
    """
    request = REQUEST_DEFAULTS | {
        "track": files.track,
        "vehicle": files.vehicle,
        "out": out.recording,
        "truth_file": out.truth,
    }
    request |= {"speed": float(wildcards.speed), "route": wildcards.route, "direction": wildcards.direction}
    return request | {"load": 0.5, "units": 1, "seed": int(wildcards.seed), "at": "2024-05-13T09:00:00"}
