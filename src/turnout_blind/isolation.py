"""Run a command that cannot read some folders, and try that it really cannot."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

from turnout_blind.seal import BlindError

CANARY = "canary.txt"


def hidden_command(command, folders):
    """``command`` (list) in mount and user namespaces in which each of ``folders`` is an empty read-only one.

    The second pair of namespaces locks the mounts of the first, so that nothing inside can take them off.
    """
    mounts = " && ".join(f"mount -t tmpfs -o ro,size=4k none {shlex.quote(str(f))}" for f in folders)
    inner = f"{mounts} && exec unshare --user --map-root-user --mount {shlex.join(command)}"
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", inner]


def method():
    """ "unshare" where namespaces can be made, "modes" for an ordinary user elsewhere, "" where neither hides."""
    if shutil.which("unshare"):
        tried = subprocess.run(hidden_command(["true"], ["/mnt"]), capture_output=True)
        if tried.returncode == 0:
            return "unshare"
    return "" if os.geteuid() == 0 else "modes"


class Hidden:
    """``with Hidden(truth, more) as hidden: hidden.run(command)``: runs commands that cannot read ``truth``.

    ``more`` are folders hidden as well (the generator's code) where the method can. On entry a canary is written into
    ``truth`` and reading it is tried inside: BlindError if that succeeds, or if nothing here can hide a folder.
    """

    def __init__(self, truth, more=()):
        self.truth, self.more, self.how = Path(truth).resolve(), tuple(Path(f).resolve() for f in more), method()

    def __enter__(self):
        if not self.how:
            found = "neither namespaces nor file modes can hide it from this user"
            raise BlindError(self.truth, "isolation", found, "Run as an ordinary user, or where unshare is allowed")
        canary = self.truth / CANARY
        canary.write_text("who can read this knows the truth\n")
        self._modes = self.truth.stat().st_mode
        if self.how == "modes":
            self.truth.chmod(0)
        tried = [self._try(["cat", str(canary)])]
        tried.append(self._try(["sh", "-c", f"umount {shlex.quote(str(self.truth))}; cat {shlex.quote(str(canary))}"]))
        tried.append(self._try(["ls", str(self.truth)]))
        self.canary = {"read": tried[0], "unmounted_and_read": tried[1], "listed": tried[2]}
        if any(tried):
            self.__exit__(None, None, None)
            raise BlindError(
                canary, "isolation", f"can be read from inside ({self.how})", "Nothing is blind here: stop"
            )
        return self

    def __exit__(self, *_):
        if self.how == "modes":
            self.truth.chmod(self._modes & 0o7777)
        (self.truth / CANARY).unlink(missing_ok=True)

    def _try(self, command):
        """True if the command, run inside, showed anything."""
        done = self.run(command, capture_output=True, text=True)
        return bool(done.stdout.strip())

    def inside(self, command):
        """``command`` (list) as it has to be run to be inside."""
        return hidden_command(command, [self.truth, *self.more]) if self.how == "unshare" else list(command)

    def run(self, command, **options):
        """subprocess.run of ``command`` (list) inside."""
        return subprocess.run(self.inside(command), **options)
