"""Scan the raw folder of one turnout: group files into units, and report files that match no pattern."""

import os
import re
import unicodedata
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from datetime import date, datetime
from difflib import get_close_matches
from functools import lru_cache
from operator import attrgetter
from pathlib import Path
from re import Match, Pattern
from stat import S_ISREG

from turnout.config import TurnoutConfig
from turnout.config.campaign_notes import NOTE_FILES
from turnout.config.events import MAX_LEAD_TIME, now
from turnout.config.file_names import file_key
from turnout.config.filename_pattern import compile_pattern, wrong_field
from turnout.errors import ReadError, reason_of_access, remedy_of_access
from turnout.files import MIN_SPARSE_SIZE, sparse_size, special_kind
from turnout.records import Unit

# Suffixes that upload programs give to unfinished files, the prefix of the locks of office programs, and names of files
# for people or file managers; all are ignored.
UNFINISHED_SUFFIXES = (".tmp", ".part", ".partial", ".crdownload", ".filepart")
IGNORED_PREFIXES = (".", "~$")
IGNORED_NAMES = ("README", "README.txt", "README.md", "Thumbs.db", "desktop.ini")
FIRST_YEAR = 1990  # of a digital recording; the readers take an earlier start for an unset clock, too
MIN_LIKENESS = 0.8  # of the name of a file to that of a table, from which it is taken for a misspelt one
READABLE = 0o444  # mode of a file that everybody may read

LINE_BREAKER = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")  # characters that end a line or move the cursor

_name = attrgetter("name")


class RawFolder:
    """All files below a raw folder: ``files`` are (path below it, entry), sorted; ``problems`` are excluded entries.

    ``folders`` are the paths of the folders below it, ``tables`` the names of its tables of notes. ``exists`` says
    whether there is such a folder.

    Parameters
    ----------
    raw_root : Path
        The raw root.
    raw : str
        Folder of the turnout below it.
    """

    def __init__(self, raw_root: Path, raw: str) -> None:
        self.root, self.raw, self._below = os.path.realpath(raw_root), raw, f"{raw}/"
        self.files: list[tuple[str, os.DirEntry]] = []
        self.folders: list[str] = []
        self.tables: list[str] = []
        self.exists = True
        self.problems: list[ReadError] = []
        top = os.path.join(raw_root, raw)
        self._collect(top, "", (os.path.realpath(top),))

    def stat(self, inside: str, entry: os.DirEntry) -> tuple[str, int, int] | None:
        """Size and time of a file; one that cannot be read is added to ``problems``.

        Parameters
        ----------
        inside : str
            Path below the raw folder.
        entry : os.DirEntry
            Entry of its folder.

        Returns
        -------
        tuple of (str, int, int) or None
            Path below the raw root, size, time of change [ns]; None for a file that is gone or cannot be read.
        """
        try:
            status = entry.stat()
        except FileNotFoundError:
            if entry.is_symlink():
                self._leave_out(inside, "link", "leads to nothing", "Put the file itself there, or remove the link")
            return None
        except OSError as error:
            self._note_unreadable(inside, "file", error)
            return None
        mode, size = status.st_mode, status.st_size
        if S_ISREG(mode) and mode & READABLE == READABLE and size <= MIN_SPARSE_SIZE:  # nearly every file
            return self._below + inside, size, status.st_mtime_ns
        if kind := special_kind(mode):
            self._leave_out(inside, "file", f"is a {kind}", "Put a file there, or remove it", "no_file")
            return None
        if (on_disk := sparse_size(entry.path, status)) >= 0:
            finding = f"has a size of {size} bytes, of which {on_disk} are on the disk"
            self._leave_out(inside, "file", finding, "Copy it again from the logger", "claims_too_much")
            return None
        # allowing to read it changes neither size nor time, so until then the file is not part of a unit
        if mode & READABLE != READABLE and not os.access(entry.path, os.R_OK):
            self._leave_out(inside, "file", "may not be read", "Correct its permissions", "no_access")
            return None
        return self._below + inside, size, status.st_mtime_ns

    def _collect(self, folder: str, inside: str, ancestors: tuple[str, ...]) -> None:
        """Collect the files of a folder and below; ``ancestors`` are the real paths of the folders that lead here."""
        try:
            with os.scandir(folder) as listing:
                entries = sorted(listing, key=_name)
        except FileNotFoundError:
            self.exists = self.exists and bool(inside)
            return
        except OSError as error:
            self._note_unreadable(inside, "folder", error)
            return
        for entry in entries:
            name = entry.name
            if is_ignored(name):
                continue
            if not inside and name in NOTE_FILES:
                self.tables.append(name)
                continue
            try:
                if name.isascii() and entry.is_file(follow_symlinks=False):
                    self.files.append((inside + name, entry))
                else:
                    self._take(entry, inside + name, ancestors)
            except OSError as error:
                self._note_unreadable(inside + name, "entry", error)

    def _take(self, entry: os.DirEntry, inside: str, ancestors: tuple[str, ...]) -> None:
        if not _is_text(entry.name):
            self._leave_out(inside, "name", "is not UTF-8", "Rename it", "name_unknown")
            return
        target = os.path.realpath(entry.path) if entry.is_symlink() else ""
        if target and not _within(target, self.root):
            problem = "leads out of the raw root", "Put the file itself below the raw root", "outside_root"
            self._leave_out(inside, "link", *problem)
        elif not entry.is_dir():
            self.files.append((inside, entry))
        elif target and any(_within(ancestor, target) for ancestor in ancestors):
            self._leave_out(inside, "link", "leads back to a folder that it lies in", "Remove it")
        else:
            self.folders.append(inside)
            self._collect(entry.path, f"{inside}/", (*ancestors, target or os.path.join(ancestors[-1], entry.name)))

    def _note_unreadable(self, inside: str, where: str, error: OSError) -> None:
        remedy = remedy_of_access(error, "Remove it, or put the file itself there")
        self._leave_out(inside, where, str(error.strerror or error), remedy, reason_of_access(error))

    def _leave_out(self, inside: str, where: str, finding: str, remedy: str, reason: str = "unreadable") -> None:
        self.problems.append(ReadError(_path_text(self.raw, inside), where, finding, remedy, reason))


def is_ignored(name: str) -> bool:
    """Whether a name is that of an unfinished file, of a lock, or of a file for people.

    Parameters
    ----------
    name : str
        Name of a file or folder.

    Returns
    -------
    bool
        Such an entry of a raw folder is no recording and no problem.

    Examples
    --------
    >>> is_ignored("20240513T120000Z.h5.part"), is_ignored("20240513T120000Z.h5")
    (True, False)
    """
    return name.startswith(IGNORED_PREFIXES) or name.endswith(UNFINISHED_SUFFIXES) or name in IGNORED_NAMES


def _path_text(raw: str, inside: str) -> str:
    r"""A path below the raw root in one line of text: bytes that are not UTF-8, and control characters, as escapes.

    >>> _path_text("t1", "A7_1\n.csv")
    't1/A7_1\\n.csv'
    """
    text = os.fsencode(f"{raw}/{inside}".rstrip("/")).decode(errors="backslashreplace")
    return LINE_BREAKER.sub(lambda match: repr(match[0])[1:-1], text)


def _is_text(name: str) -> bool:
    """Whether a name is UTF-8; another encoding cannot be written into a plan or the registry."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _within(path: str, root: str) -> bool:
    return path == root or path.startswith(root + os.sep)


@dataclass
class Scan:
    """Result of a scan: ``units`` sorted by kind and label; ``problems`` are excluded files with reasons."""

    units: list[Unit] = field(default_factory=list)
    problems: list[ReadError] = field(default_factory=list)


def scan(turnout: TurnoutConfig, raw_root: Path) -> Scan:
    """Units of one turnout from the file names in its raw folder; no file is opened.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : Path
        The raw root.

    Returns
    -------
    Scan
        Its units and the excluded files.
    """
    result, names = Scan(), _names(turnout)
    by_unit: dict[tuple, list] = {}
    matched, unmatched = set(), []
    folder = RawFolder(raw_root, turnout.raw)
    for inside, entry in folder.files:
        for kind, expression in names:
            composed = inside if inside.isascii() else unicodedata.normalize("NFC", inside)  # a Mac decomposes umlauts
            if match := expression.fullmatch(composed):
                matched.add(kind)
                if wrong := _time_problem(match):
                    result.problems.append(
                        ReadError(_path_text(turnout.raw, inside), "file name", *wrong, "name_unknown")
                    )
                    break
                by_unit.setdefault(_label(kind, match, inside, turnout), []).append((inside, entry))
                break
        else:
            unmatched.append(inside)
    for (kind, label, section, campaign), files in sorted(by_unit.items(), key=lambda item: item[0][:2]):
        entries = tuple(sorted(e for e in [folder.stat(*file) for file in files] if e))
        if entries:
            result.units.append(Unit(turnout.id, kind, label, entries, turnout.hashes[kind], section, campaign))
    for inside in folder.folders:
        if any(expression.fullmatch(inside) for _, expression in names):
            finding = "is a folder with the name of a recording", "Put the file itself there, or rename the folder"
            result.problems.append(ReadError(_path_text(turnout.raw, inside), "folder", *finding, "no_file"))
    result.problems += [
        *folder.problems,
        *_unmatched_files(turnout, raw_root, unmatched, matched, folder.tables, folder.exists),
    ]
    return result


def unit_id(unit: Unit) -> str:
    """Name of a unit in batches and state files.

    Parameters
    ----------
    unit : Unit
        The unit.

    Returns
    -------
    str
        "<turnout>/<kind>/<label>".

    Examples
    --------
    >>> unit_id(Unit("t1", "hammer", "A7/2024-05-13", (), ""))
    't1/hammer/A7/2024-05-13'
    """
    return f"{unit.turnout}/{unit.kind}/{unit.label}"


def _names(turnout: TurnoutConfig) -> list[tuple[str, Pattern]]:
    names = []
    if turnout.hammer:
        names.append(
            ("hammer", compile_pattern(turnout.hammer.files, "hammer", tuple(s.label for s in turnout.sections)))
        )
    if turnout.passages:
        names.append(("passage", compile_pattern(turnout.passages.files, "passages")))
    return names


def _label(kind: str, match: Match, inside: str, turnout: TurnoutConfig) -> tuple:
    """Kind, label, section and campaign of the unit that a file belongs to."""
    if kind == "hammer":
        section, campaign = match["section"], match["campaign"]
        return kind, f"{section}/{campaign}", section, campaign
    fixed = turnout.passages.files.partition("{")[0] if turnout.passages else ""
    return kind, inside.removeprefix(fixed), None, None


def _time_problem(match: Match) -> tuple[str, str] | None:
    """Problem of the day or time in a file name, and its remedy; None if it is a valid date.

    >>> import re
    >>> _time_problem(re.fullmatch("(?P<campaign>.*)", "2024-13-45"))[0]
    "'2024-13-45' is no day of the calendar"
    """
    for group, form, quantity in _times_in(match.re):
        text = match[group]
        if text is not None and (problem := _calendar_problem(text, form, quantity, now().date())):
            return f"{text!r} {problem}", "Rename it after the day on which it was measured, in UTC"
    return None


@lru_cache
def _times_in(expression: Pattern) -> tuple[tuple[str, str, str], ...]:
    """Group, form and quantity of each day or time in the names that an expression matches."""
    times = (("campaign", "%Y-%m-%d", "day"), ("time", "%Y%m%dT%H%M%SZ", "time"))
    return tuple(time for time in times if time[0] in expression.groupindex)


@lru_cache(maxsize=10_000)
def _calendar_problem(text: str, form: str, quantity: str, today: date) -> str:
    """What is wrong with a time, "" for a valid one. Cached: a network has 140,000 files, but a few hundred days."""
    try:
        day = datetime.strptime(text, form).date()
    except ValueError:
        return f"is no {quantity} of the calendar"
    if day > today + MAX_LEAD_TIME:  # a day or two may be the zone, or a clock that is wrong
        return "is more than a year ahead"
    return "" if day.year >= FIRST_YEAR else f"is before {FIRST_YEAR}, when no digital logger was in use"


def _unmatched_files(
    turnout: TurnoutConfig,
    raw_root: Path,
    unmatched: list[str],
    matched: set[str],
    tables: Container[str],
    exists: bool,
) -> Iterator[ReadError]:
    """Files whose names match no pattern; ``tables`` are the tables of notes in the folder of the turnout.

    ``exists`` says whether there is such a folder.
    """
    pattern_words = " or ".join(repr(kind.files) for kind in (turnout.hammer, turnout.passages) if kind)
    for inside in unmatched:
        field, problem = _wrong_field(inside, turnout)
        remedies = [f"Rename it after {pattern_words}"]
        if field == "section":
            remedies.append(f"add its section to the layout {turnout.layout!r}")
        remedies += [
            f"add the part {branch!r} to the layout {turnout.layout!r}" for branch in _missing_branches(turnout)
        ]
        remedy = f"{', or '.join(remedies)}. Remove it if it is no recording"
        finding = "its name follows no pattern of the layout" + (f": {problem}" if problem else "")
        if not field and (likest := get_close_matches(inside.lower(), NOTE_FILES, 1, MIN_LIKENESS)):
            finding, remedy = "no file of this name is read", f"If it is the table {likest[0]}, rename it to that"
            if likest[0] in tables:
                remedy = f"Remove it, or copy what it adds into {likest[0]}, which is read"
        yield ReadError(_path_text(turnout.raw, inside), "file name", finding, remedy, "name_unknown")
    if not exists:
        yield ReadError(turnout.raw, "folder", *_missing_folder(raw_root, turnout.raw), "nothing_found")
    elif not matched:
        remedy = (
            f"Put files named like {pattern_words} there, or correct 'raw' in turnouts.tsv or 'files' in the layout"
        )
        yield ReadError(turnout.raw, "folder", "no file matches a pattern of the layout", remedy, "nothing_found")


def _missing_folder(raw_root: Path, raw: str) -> tuple[str, str]:
    """Problem and remedy of a raw folder that does not exist; one of nearly the same name is named."""
    path = Path(raw_root) / raw
    try:
        similar = [entry.name for entry in path.parent.iterdir() if file_key(entry.name) == file_key(path.name)]
    except OSError:
        similar = []
    if not similar:
        return "there is no such folder", "Put the recordings there, or correct 'raw' in turnouts.tsv"
    difference = (
        "capitals"
        if similar[0].casefold() == path.name.casefold()
        else "the form of an accented letter, dots or blanks"
    )
    problem = f"there is no such folder, but {_path_text('', similar[0])[1:]!r} differs from it only in {difference}"
    return problem, "Rename that folder, or write its name as 'raw' in turnouts.tsv"


def _missing_branches(turnout: TurnoutConfig) -> list[str]:
    """Recordings that the layout does not describe, by the name of their part of it."""
    return [branch for branch in ("hammer", "passages") if getattr(turnout, branch) is None]


def _wrong_field(inside: str, turnout: TurnoutConfig) -> tuple[str, str]:
    """The field by which alone a name misses a pattern of the layout, in words, too; "" if it misses all by more."""
    labels = tuple(section.label for section in turnout.sections)
    patterns = (("hammer", turnout.hammer, labels), ("passages", turnout.passages, ()))
    details = (wrong_field(inside, layout.files, branch, sections) for branch, layout, sections in patterns if layout)
    return next((detail for detail in details if detail[0]), ("", ""))
