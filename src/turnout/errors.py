"""Exceptions of the program. Each message tells a track engineer what to do next."""

import errno
import sys
import traceback
from collections.abc import Iterable, Sequence
from os import PathLike

from turnout.reasons import REASONS


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
        One of ``turnout.reasons.REASONS``: the code of the quarantine row.
    record : int or None
        Number of the record that is concerned, from 0; None for the whole file.

    Examples
    --------
    >>> error = ReadError("A7_1.uff", "record 7 of 30", "ends after 1312 of 4096 samples",
    ...                   "Copy the file again", reason="truncated")
    >>> print(error)
    A7_1.uff, record 7 of 30: ends after 1312 of 4096 samples. Copy the file again.
    """

    def __init__(
        self,
        path: PathLike | str,
        where: str,
        problem: str,
        remedy: str,
        reason: str = "unreadable",
        record: int | None = None,
    ):
        super().__init__(f"{path}, {where}: {problem}. {remedy}.")
        if reason not in REASONS:
            raise ValueError(f"reason {reason!r} is not in turnout.reasons.REASONS")
        self.path, self.where, self.problem, self.remedy, self.reason = str(path), where, problem, remedy, reason
        self.record = record

    def in_record(self, record: int) -> "ReadError":
        """The same error of one record.

        Parameters
        ----------
        record : int
            Number of the record, from 0.

        Returns
        -------
        ReadError
        """
        return ReadError(self.path, self.where, self.problem, self.remedy, self.reason, record)


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

    ``place`` is "line 12, column 5" or the key; ``remedy`` is what to write instead. ``turnouts`` are the ids in the
    rows of a table that have the error, "" for a row without a valid one; none for an error that is in no row.

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

    turnouts: tuple[str, ...] = ()

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


class CaseError(TurnoutError, ValueError):
    """A case of the diagnosis contradicts itself, or a part of it cannot be fitted; the message names the part."""


class RegistryError(TurnoutError):
    """The registry rejects rows or cannot be used; the message names table, row, column and value."""


class InstallationError(TurnoutError):
    """A package that the program needs is missing or broken. No file is the cause, and the whole run stops."""


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


DISK_REMEDIES = {
    errno.ENOSPC: "Free space on its disk",
    errno.EDQUOT: "Free space on its disk, or ask for a larger quota",
    errno.EROFS: "Mount its disk for writing",
}


def remedy_of_access(error: OSError, otherwise: str) -> str:
    """What to do about a file or folder that cannot be opened or written; ``otherwise`` if the name is the cause.

    A sound file is never to be removed: without permission, or on a disk that fails, it only cannot be opened.

    Parameters
    ----------
    error : OSError
        The exception of the attempt.
    otherwise : str
        Remedy where the name stands for no file: a sentence without its full stop.

    Returns
    -------
    str
        A sentence without its full stop.

    Examples
    --------
    >>> remedy_of_access(PermissionError(errno.EACCES, ""), "Remove it")
    'Correct its permissions'
    >>> remedy_of_access(OSError(errno.ENOSPC, ""), "Remove it")
    'Free space on its disk'
    >>> remedy_of_access(OSError(errno.EIO, ""), "Remove it")
    'Check the disk or the network that holds it'
    >>> remedy_of_access(IsADirectoryError(errno.EISDIR, ""), "Remove it")
    'Remove it'
    """
    if isinstance(error, PermissionError):
        return "Correct its permissions"
    if error.errno in DISK_REMEDIES:
        return DISK_REMEDIES[error.errno]
    return "Check the disk or the network that holds it" if is_infrastructure(error) else otherwise


def reason_of_access(error: OSError) -> str:
    """Code of the reason for a file or folder that cannot be opened.

    Parameters
    ----------
    error : OSError
        The exception of the attempt.

    Returns
    -------
    str
        "no_access" if the machine or a permission is the cause, "unreadable" if the name itself is.

    Examples
    --------
    >>> reason_of_access(PermissionError(errno.EACCES, "")), reason_of_access(IsADirectoryError(errno.EISDIR, ""))
    ('no_access', 'unreadable')
    """
    return "no_access" if is_infrastructure(error) else "unreadable"


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


# Remarks: the recordings are used all the same. No run fails and no turnout is overdue because of one.
REMARK_REASONS = frozenset(
    (
        "entry_unknown",
        "library_warning",
        "condition_lost",
        "start_unknown",
        "rate_ambiguous",
        "other_turnout",
        "spikes",
        "mains_hum",
    )
)
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
        "spikes",
        "sensor_lost",
        "drop_out",
    )
)
