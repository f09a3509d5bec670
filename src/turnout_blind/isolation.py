"""Run a command that cannot read some folders, and test that it really cannot."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

from turnout_blind.seal import BlindError

CANARY = "canary.txt"


def hidden_command(command, folders):
    """``command`` (list) in mount and user namespaces in which each of ``folders`` is empty and read-only.

    The second pair of namespaces locks the mounts of the first, so that no process inside can unmount them.
    """
    mounts = " && ".join(f"mount -t tmpfs -o ro,size=4k none {shlex.quote(str(f))}" for f in folders)
    inner = f"{mounts} && exec unshare --user --map-root-user --mount {shlex.join(command)}"
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", inner]


def isolation_method():
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

    def __init__(self, truth, more_folders=()):
        self.truth, self.more_folders, self.method = (
            Path(truth).resolve(),
            tuple(Path(f).resolve() for f in more_folders),
            isolation_method(),
        )

    def __enter__(self):
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

    def __exit__(self, *_):
        if self.method == "modes":
            self.truth.chmod(self._modes & 0o7777)
        (self.truth / CANARY).unlink(missing_ok=True)

    def _shows_output(self, command):
        """True if the command, run inside, printed anything."""
        result = self.run(command, capture_output=True, text=True)
        return bool(result.stdout.strip())

    def isolated_command(self, command):
        """``command`` (list), wrapped so that it runs inside."""
        return hidden_command(command, [self.truth, *self.more_folders]) if self.method == "unshare" else list(command)

    def run(self, command, **options):
        """subprocess.run of ``command`` (list) inside."""
        return subprocess.run(self.isolated_command(command), **options)
