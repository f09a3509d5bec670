"""Exceptions of the program. Each message tells a track engineer what to do next."""

import errno
import sys
import traceback
from collections.abc import Iterable, Sequence
from os import PathLike


class TurnoutError(Exception):
    """Base class of all exceptions that the program raises on purpose."""


class ReadError(TurnoutError):
    """A recording does not agree with its format or its configuration.

    Parameters
    ----------
    path : str
        The file, relative to the raw root where there is one.
    where : str
        The record, channel, byte or line in the file.
    problem : str
        What is wrong there.
    remedy : str
        What to do: a sentence without its full stop.
    reason : str
        One of ``REASONS``: the code of the quarantine row.

    Examples
    --------
    >>> error = ReadError("A7_1.uff", "record 7 of 30", "ends after 1312 of 4096 samples",
    ...                   "Copy the file again", reason="truncated")
    >>> print(error)
    A7_1.uff, record 7 of 30: ends after 1312 of 4096 samples. Copy the file again.
    """

    def __init__(self, path: PathLike | str, where: str, problem: str, remedy: str, reason: str = "unreadable"):
        super().__init__(f"{path}, {where}: {problem}. {remedy}.")
        if reason not in REASONS:
            raise ValueError(f"reason {reason!r} is not in turnout.errors.REASONS")
        self.path, self.where, self.problem, self.remedy, self.reason = str(path), where, problem, remedy, reason


class PartlyComputed(Exception):
    """The program failed on some records of a unit; ``tables`` holds the rows of all other records.

    ``faults`` holds (path, record from 0, exception) of each record that could not be computed.

    Parameters
    ----------
    tables : dict of str to list of dict
        Rows of the other records, by table.
    faults : sequence of tuple of (str, int, Exception)
        Path, record from 0, and exception of each record that could not be computed.
    """

    def __init__(self, tables: dict[str, list[dict]], faults: Sequence[tuple[str, int, Exception]]):
        path, record, error = faults[0]
        super().__init__(f"{path}, record {record + 1}: {type(error).__name__}: {error}")
        self.tables, self.faults = tables, faults


class ConfigError(TurnoutError):
    """A configuration file contains something that cannot be used.

    ``place`` is "line 12, column 5" or the key; ``remedy`` is what to write instead.

    Parameters
    ----------
    path : path-like
        The file.
    place : str
        "line 12, column 5", or the key.
    problem : str
        What is wrong there.
    remedy : str
        What to write instead: a sentence without its full stop.
    """

    def __init__(self, path: PathLike | str, place: str, problem: str, remedy: str):
        super().__init__(f"{path}, {place}: {problem}. {remedy}.")
        self.path, self.place, self.problem, self.remedy = str(path), place, problem, remedy


class ConfigErrors(TurnoutError):
    """All configuration errors of one pass; ``errors`` is their list.

    Parameters
    ----------
    errors : iterable of Exception
        The errors, in the order of the message.
    """

    def __init__(self, errors: Iterable[Exception]):
        super().__init__("\n".join(str(e) for e in errors))
        self.errors = list(errors)


class SimulationError(TurnoutError):
    """A simulation cannot continue; the message names time, position and value."""


class RegistryError(TurnoutError):
    """The registry rejects rows or cannot be used; the message names table, row, column and value."""


class InstallationError(TurnoutError):
    """A package that the program needs is missing or broken. No file is to blame, and the whole run stops."""


# errno codes that damaged data or a name may cause (a seek to an impossible byte, a name that is no file, a link that
# leads back to itself), whatever the machine.
# Every other one is a fault of the machine. It concerns the file at which it occurred: the next run tries it again.
NAME_ERRNOS = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG}
DATA_ERRNOS = NAME_ERRNOS | {errno.EINVAL, errno.EOVERFLOW}


def is_infrastructure(error: BaseException) -> bool:
    """Whether an exception is a fault of the machine or the network, not of the data of the unit.

    Examples are a bad sector, a damaged file system, a server that does not answer, a file without read permission, and
    too little free memory. The unit is left for the next run while the other units continue.

    Parameters
    ----------
    error : BaseException
        Any exception.

    Returns
    -------
    bool
        True for MemoryError and for any OSError whose errno damaged data cannot cause.

    Examples
    --------
    >>> [is_infrastructure(OSError(code, "")) for code in (errno.EIO, errno.EUCLEAN, errno.EINVAL, errno.ELOOP)]
    [True, True, False, False]
    """
    if isinstance(error, OSError):
        return error.errno is not None and error.errno not in DATA_ERRNOS
    return isinstance(error, MemoryError)


# Packages whose name for pip differs from the name that is imported.
PIP_NAMES = {"nptdms": "npTDMS", "sklearn": "scikit-learn", "ruamel": "ruamel.yaml", "_soundfile_data": "soundfile"}


def installation_error(error: BaseException) -> InstallationError | None:
    """The fault of the installation that an exception stands for.

    Every exception from the top level of a module is one: bytes of a recording are read inside functions. Such are an
    absent package, an absent library of the system, and a package built for another version of numpy.

    Parameters
    ----------
    error : BaseException
        Any exception.

    Returns
    -------
    InstallationError or None
        It names the package and how to install it; None for any other exception, and for a fault of the machine.

    Examples
    --------
    >>> absent = ModuleNotFoundError("No module named 'h5py'", name="h5py")
    >>> print(str(installation_error(absent)).split(". ")[0])
    the installation, package h5py: it cannot be imported (No module named 'h5py')
    >>> installation_error(ValueError("bad header")) is None
    True
    """
    link: BaseException | None = error
    while link is not None:
        if isinstance(link, InstallationError):
            return link
        if is_infrastructure(link):
            return None
        module = _module_of_import(link)
        if module:
            return InstallationError(_import_message(module, link))
        link = link.__cause__
    return None


def _module_of_import(error: BaseException) -> str:
    """Name of the module that an exception kept from being imported, "" if it arose in no import."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    modules = [
        frame.f_globals.get("__name__", "?")
        for frame in frames
        if frame.f_code.co_name == "<module>" and not frame.f_code.co_filename.startswith("<")  # no text of eval
    ]
    if isinstance(error, ImportError):
        return error.name or (modules[-1] if modules else "?")
    return modules[-1] if modules else ""


def _import_message(module: str, error: BaseException) -> str:
    package = module.split(".")[0]
    name = PIP_NAMES.get(package, package)
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    remedy = f"Install it, with 'pip install --force-reinstall {name}' in the environment of Turnout"
    if package in ("turnout", "?"):
        remedy = "Install Turnout again, with 'pip install --force-reinstall .' in a copy of its repository"
    if package in sys.stdlib_module_names:
        remedy = "Install Python again, with all modules of its standard library"
    return f"the installation, package {name}: it cannot be imported ({reason}). {remedy}, then run again."


# All reasons of a quarantine row or of a rejected impact, with their meaning.
REASONS = {
    "unreadable": "the file is not of its format",
    "empty": "the file has no bytes or no records",
    "no_file": "the name is that of a folder, device, pipe or socket, not of a file with bytes",
    "claims_too_much": "the file claims more samples or channels than a file of its size can hold",
    "too_large": "the memory of the machine was too small for it in two runs",
    "read_fault": "the disk or the network failed when it was read, in two runs; every run tries it again",
    "truncated": "fewer samples or records than configured or declared",
    "wrong_length": "more samples or records than configured",
    "vanished": "the file was there when planned and is gone",
    "name_unknown": "the file's name follows no pattern of the layout",
    "nothing_found": "no file of the turnout matches a pattern of the layout",
    "not_counted": "a row of events.csv or acknowledgements.csv that cannot be right",
    "outside_root": "the path leads outside the raw root",
    "wrong_rate": "the sampling rate is not the configured one",
    "channel_missing": "a configured channel is not in the file",
    "channel_unknown": "the file has a channel that the configuration does not name",
    "unit_unknown": "a unit that cannot be converted to the configured one",
    "scale_unknown": "the file states a scale, but not whether its numbers contain it",
    "entry_unknown": "an entry of the file may state a rate, scale or unit, unexplained; its recordings are used",
    "library_warning": "the library that reads the format warns about the file; its recordings are used",
    "condition_lost": "names, or a condition such as a temperature, are damaged in the file; its recordings are used",
    "not_finite": "missing samples: NaN, infinity, or a number that stands for them",
    "dead_channel": "a channel is constant or below its noise floor",
    "sign_reversed": "the force is negative at contact: the sign is reversed",
    "clock_backwards": "the time stamps run backwards",
    "duplicate": "the same bytes as another file, or the same impact as in another record",
    "wrong_time": "the time of the recording contradicts its campaign, or a passage has none",
    "start_unknown": "the start time in the file is unreadable, implausible or of another day; the recording is used",
    "rate_ambiguous": "the file states a rate before a reduction that nothing confirms; its recordings are used",
    "double_hit": "the hammer touched the rail twice",
    "overload": "a channel left its range",
    "out_of_scale": "a value that no such measurement has: the unit or the scale is wrong",
    "weak": "the impact is much weaker than the others of its test",
    "noisy": "the level before the impact is too high",
    "late": "the impact is not at the trigger, began before the record, or leaves too little decay",
    "not_simultaneous": "the response begins before the force or long after it",
    "cut_off": "the record ends before the vibration has died away",
    "not_selected": "the test has more impacts than wanted, and the others agree better",
    "odd_one_out": "the response disagrees with all other impacts of the test",
    "no_impact": "no impact found in the record",
    "too_few_impacts": "too few accepted impacts for a coherence",
    "low_coherence": "the lower confidence limit of the coherence fails the gate over a mode's band",
    "not_identified": "no stable mode in the band",
    "fit_below_history": "the fit of the model lies far below those of the section's earlier campaigns",
    "no_accelerometer": "the layout of the passages names no accelerometer, so that no train can be found",
    "no_train": "no axle found",
    "train_cut_off": "the train is cut off at an end of the recording",
    "two_trains": "two trains at the same time",
    "axles_uncertain": "the number of axles is not certain",
    "clipped": "a channel is clipped in the passage",
    "channels_swapped": "channels arrive in the wrong order",
    "clock_drift": "the loggers' clocks drift apart",
    "sensor_lost": "a sensor stopped working during the recording",
    "interference": "electrical pulses on all channels at the same moment; they were removed",
    "simulation_failed": "the simulation could not be completed",
    "internal_error": "a fault of this program, with its traceback",
}
# Remarks: the recordings are used all the same. No run fails and no turnout is overdue because of one.
REMARK_REASONS = frozenset(("entry_unknown", "library_warning", "condition_lost", "start_unknown", "rate_ambiguous"))
# Reasons that concern a channel of a recording: ``turnout.records.Rejection.channel`` names it.
CHANNEL_REASONS = frozenset(
    (
        "not_finite",
        "dead_channel",
        "sign_reversed",
        "overload",
        "not_simultaneous",
        "noisy",
        "clipped",
        "channels_swapped",
        "clock_drift",
        "sensor_lost",
    )
)
