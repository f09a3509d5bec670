"""Run a command that cannot read some folders, and test that it really cannot."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.seal import BlindError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

CANARY = "canary.txt"


def hidden_command(command: Sequence[str], folders: Iterable[str | Path]) -> list[str]:
    """Wrap a command in mount and user namespaces in which some folders are empty and read-only.

    The second pair of namespaces locks the mounts of the first, so that no process inside can unmount them.

    Parameters
    ----------
    command : sequence of str
        Command and its arguments.
    folders : iterable of str or Path
        Folders that are hidden.

    Returns
    -------
    list of str
        The command with its wrapping.
    """
    mounts = " && ".join(f"mount -t tmpfs -o ro,size=4k none {shlex.quote(str(f))}" for f in folders)
    inner = f"{mounts} && exec unshare --user --map-root-user --mount {shlex.join(command)}"
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", inner]


def isolation_method() -> str:
    """ "unshare" where namespaces are allowed, else "modes" for an ordinary user, else "" (nothing can hide)."""
    if shutil.which("unshare"):
        result = subprocess.run(hidden_command(["true"], ["/mnt"]), capture_output=True)
        if result.returncode == 0:
            return "unshare"
    return "" if os.geteuid() == 0 else "modes"


class HiddenFolders:
    """``with HiddenFolders(truth, more_folders) as hidden: hidden.run(command)``: ``command`` cannot read ``truth``.

    ``more_folders`` (the code of the generator) are hidden as well where the method allows it. On entry a canary file
    is written into ``truth``, and reading it is tried inside. BlindError if that succeeds, or if no method works.
    """

    def __init__(self, truth: str | Path, more_folders: Iterable[str | Path] = ()) -> None:
        self.truth, self.more_folders, self.method = (
            Path(truth).resolve(),
            tuple(Path(f).resolve() for f in more_folders),
            isolation_method(),
        )

    def __enter__(self) -> HiddenFolders:
        if not self.method:
            problem = "neither namespaces nor file modes can hide it from this user"
            raise BlindError(self.truth, "isolation", problem, "Run as an ordinary user, or where unshare is allowed")
        canary = self.truth / CANARY
        canary.write_text("who can read this knows the truth\n")
        self._modes = self.truth.stat().st_mode
        if self.method == "modes":
            self.truth.chmod(0)
        leaks = [self._shows_output(["cat", str(canary)])]
        leaks.append(
            self._shows_output(["sh", "-c", f"umount {shlex.quote(str(self.truth))}; cat {shlex.quote(str(canary))}"])
        )
        leaks.append(self._shows_output(["ls", str(self.truth)]))
        self.canary = {"read": leaks[0], "unmounted_and_read": leaks[1], "listed": leaks[2]}
        if any(leaks):
            self.__exit__(None, None, None)
            raise BlindError(
                canary, "isolation", f"can be read from inside ({self.method})", "Nothing is blind here: stop"
            )
        return self

    def __exit__(self, *_: Any) -> None:
        if self.method == "modes":
            self.truth.chmod(self._modes & 0o7777)
        (self.truth / CANARY).unlink(missing_ok=True)

    def _shows_output(self, command: Sequence[str]) -> bool:
        """True if the command, run inside, printed anything."""
        result = self.run(command, capture_output=True, text=True)
        return bool(result.stdout.strip())

    def isolated_command(self, command: Sequence[str]) -> list[str]:
        """A command, wrapped so that it runs inside.

        Parameters
        ----------
        command : sequence of str
            Command and its arguments.

        Returns
        -------
        list of str
            The command with its wrapping.
        """
        return hidden_command(command, [self.truth, *self.more_folders]) if self.method == "unshare" else list(command)

    def run(self, command: Sequence[str], **options: Any) -> subprocess.CompletedProcess:
        """Run a command inside.

        Parameters
        ----------
        command : sequence of str
            Command and its arguments.
        **options : object
            Options of ``subprocess.run``.

        Returns
        -------
        CompletedProcess
            Its result.
        """
        return subprocess.run(self.isolated_command(command), **options)
