"""Every file below the raw folder of one turnout, and the entries that nobody can use."""

import os
from operator import attrgetter
from pathlib import Path

from turnout.errors import ReadError

NOTES = ("campaigns.csv", "trains.csv")
# Names that upload programs give to files they have not finished, and notes for people.
UNFINISHED = (".tmp", ".part", ".partial", ".crdownload", ".filepart")
FOR_PEOPLE = ("README", "README.txt", "README.md", "Thumbs.db", "desktop.ini")

_name = attrgetter("name")


class RawFolder:
    """``files`` are (path below the folder, entry), depth first, sorted; ``problems`` say what was left out and why."""

    def __init__(self, raw_root: Path, raw: str):
        self.root, self.raw = os.path.realpath(raw_root), raw
        self.files: list[tuple[str, os.DirEntry]] = []
        self.problems: list[ReadError] = []
        top = os.path.join(raw_root, raw)
        self._collect(top, "", (os.path.realpath(top),))

    def stat(self, inside: str, entry: os.DirEntry) -> tuple[str, int, int] | None:
        """(path below the raw root, size, time of change [ns]); None for a file that went away meanwhile, and a
        problem for one that cannot be looked at."""
        try:
            status = entry.stat()
        except FileNotFoundError:
            if entry.is_symlink():
                self._leave_out(inside, "link", "leads to nothing", "Put the file itself there, or remove the link")
            return None
        except OSError as error:
            self._cannot(inside, "file", error)
            return None
        # neither size nor time changes when reading is allowed again: until then the file is none
        if status.st_mode & 0o444 != 0o444 and not os.access(entry.path, os.R_OK):
            self._leave_out(inside, "file", "may not be read", "Allow reading it")
            return None
        return f"{self.raw}/{inside}", status.st_size, status.st_mtime_ns

    def _collect(self, folder: str, inside: str, way: tuple[str, ...]) -> None:
        """``way`` holds the folders that lead here as they are called without links."""
        try:
            with os.scandir(folder) as listing:
                entries = sorted(listing, key=_name)
        except FileNotFoundError:
            return
        except OSError as error:
            self._cannot(inside, "folder", error)
            return
        for entry in entries:
            name = entry.name
            if name.startswith(".") or name.endswith(UNFINISHED) or (not inside and name in (*NOTES, *FOR_PEOPLE)):
                continue
            try:
                self._take(entry, inside + name, way)
            except OSError as error:
                self._cannot(inside + name, "entry", error)

    def _take(self, entry: os.DirEntry, inside: str, way: tuple[str, ...]) -> None:
        if not _is_text(entry.name):
            self._leave_out(inside, "name", "is not UTF-8", "Rename it", "name_unknown")
            return
        target = os.path.realpath(entry.path) if entry.is_symlink() else ""
        if target and not _within(target, self.root):
            said = "leads out of the raw root", "Put the file itself below the raw root", "outside_root"
            self._leave_out(inside, "link", *said)
        elif not entry.is_dir():
            self.files.append((inside, entry))
        elif target and any(_within(passed, target) for passed in way):
            self._leave_out(inside, "link", "leads back to a folder that it lies in", "Remove it")
        else:
            self._collect(entry.path, f"{inside}/", (*way, target or os.path.join(way[-1], entry.name)))

    def _cannot(self, inside: str, where: str, error: OSError) -> None:
        self._leave_out(
            inside, where, str(error.strerror or error), "Allow reading it, or put right what the name stands for"
        )

    def _leave_out(self, inside: str, where: str, found: str, remedy: str, reason: str = "unreadable") -> None:
        path = os.fsencode(f"{self.raw}/{inside}".rstrip("/")).decode(errors="backslashreplace")
        self.problems.append(ReadError(path, where, found, remedy, reason))


def _is_text(name: str) -> bool:
    """Whether a name is UTF-8; one of another encoding holds what no plan and no registry can write."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _within(path: str, root: str) -> bool:
    return path == root or path.startswith(root + os.sep)
