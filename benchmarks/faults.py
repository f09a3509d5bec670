"""Seeded faults of one night of a small fleet, and the nights after it; a failure is replayed from its seed.

The shim stands at the Python interface to the operating system: open, os.replace, os.fsync, os.scandir, os.stat. DuckDB
and Arrow call the system by themselves: what they write is reached by the faults between nights (power cut, bit flip).
"""

import builtins
import errno
import io
import json
import os
import random
import re
import shutil
import signal
import tempfile
import time
import traceback
from pathlib import Path

from turnout.config import load_configuration
from turnout.registry import database
from turnout.registry.generation import load
from turnout.registry.ids import content_id
from turnout.registry.job import register
from turnout.workflow.batches import read_results
from turnout.workflow.plan import write_plans
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

ERRNOS = (
    errno.EIO, errno.ENOSPC, errno.EACCES, errno.ESTALE, errno.EUCLEAN, errno.EBADMSG, errno.EHOSTDOWN, errno.ENOTCONN,
    errno.ENXIO, errno.EBUSY, errno.EPERM, errno.EMFILE, errno.EROFS, errno.EDQUOT, errno.EINTR, errno.EINVAL,
)  # fmt: skip
CALLS = ("open", "replace", "fsync", "scandir", "stat")
KINDS = ("errno", "kill", "power_cut", "vanished", "torn", "flip", "memory", "clock", "full_disk")
VIEWS = ("superseded", "results_current", "recordings_current", "quarantine_open")
QUESTIONS = (
    "select path, n_samples from recordings_current order by all",
    "select path, reason_code from quarantine_open order by all",
)
N_TURNOUT, N_CALM = 4, 2  # turnouts; nights after the fault, the last of which must be right
LONGEST_NIGHT = 240.0  # s; a longer night hangs
LAYOUT = """\
sections: {A: {panel: CP, track: main, position: 1}}
hammer:
  files: "{campaign}/{section}_{test}.txt"
  force: force
  response: rail
  channels:
    force: {source: 0, quantity: force}
    rail: {source: 1, quantity: acceleration}
"""


def length(unit, turnout, raw_root, algo=""):
    """Rows from the number of bytes of each file."""
    rows = []
    for path, *_ in unit.files:
        with open(os.path.join(raw_root, path), "rb") as stream:
            n_byte = len(stream.read())
        recording_id = content_id("recording", path)
        rows.append({"recording_id": recording_id, "turnout_id": unit.turnout, "section_id": f"{unit.turnout}/A",
                     "path": path, "n_samples": n_byte, "kind": "hammer", "file_format": "csv"})  # fmt: skip
    return {"recordings": rows, "quarantine": []}


class Shim:
    """Counts calls below ``folder``; at the ``at``-th it raises the ``code``, or ends the process (code 0).

    ``lasting`` repeats the error at all later calls. ``unsynced`` are files that were written and not flushed.
    """

    def __init__(self, folder, calls, at, code, lasting=False):
        self.folder, self.calls, self.at, self.code, self.lasting = str(folder), calls, at, code, lasting
        self.n, self.unsynced = 0, {}

    def install(self):
        real_open, real_replace, real_fsync = io.open, os.replace, os.fsync

        def opened(path, mode="r", *args, **more):
            self.count("open", path)
            stream = real_open(path, mode, *args, **more)
            if isinstance(path, (str, os.PathLike)) and set(mode) & set("wax+"):
                self.unsynced[os.fstat(stream.fileno()).st_ino] = os.path.abspath(path)
            return stream

        def replace(source, target, **more):
            self.count("replace", source)
            inode = os.stat(source).st_ino
            real_replace(source, target, **more)
            if inode in self.unsynced:
                self.unsynced[inode] = os.path.abspath(target)

        def fsync(handle):
            self.count("fsync", self.folder)
            self.unsynced.pop(os.fstat(handle).st_ino, None)
            real_fsync(handle)

        builtins.open = io.open = opened
        os.replace, os.fsync = replace, fsync
        for name in ("scandir", "stat"):
            setattr(os, name, self.counted(name, getattr(os, name)))

    def counted(self, name, real):
        def call(path=".", *args, **more):
            self.count(name, path)
            return real(path, *args, **more)

        return call

    def count(self, name, path):
        if name not in self.calls or not str(path).startswith(self.folder):
            return
        self.n += 1
        if self.n == self.at or (self.lasting and self.n > self.at):
            if self.code:
                raise OSError(self.code, os.strerror(self.code), str(path))
            Path(self.folder, "..", "unsynced.json").resolve().write_text(json.dumps(list(self.unsynced.values())))
            os.kill(os.getpid(), signal.SIGKILL)


class Fleet:
    """Folder with configuration, raw files, work and registry."""

    def __init__(self, root):
        self.root, self.raw, self.registry = root, root / "raw", root / "registry"
        (root / "config" / "layouts").mkdir(parents=True)
        (root / "config" / "layouts" / "main.yaml").write_text(LAYOUT)
        names = [f"t{k}" for k in range(N_TURNOUT)]
        (root / "config" / "turnouts.tsv").write_text("\n".join(["turnout\tlayout", *(f"{n}\tmain" for n in names)]))
        for k, name in enumerate(names):
            self.put(name, "2024-05-13", f"turnout {k}")
        self.state, self.plan = root / "work/hammer/00of01.json", root / "work/plan/00of01.json"

    def put(self, turnout, day, text):
        path = self.raw / turnout / day / "A_1.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def night(self, compute=length, after_plan=None):
        configuration = load_configuration(self.root / "config")
        write_plans(configuration, self.raw, self.plan.parent, 1, accept_vanished=True)
        if after_plan:
            after_plan()
        summary = run_shard(self.plan, self.state, Stage("hammer", compute, "1"), configuration, self.raw)
        register(batch_paths([self.state]), self.registry, read=read_results, patience=5.0)
        return str(summary)

    def answers(self):
        with database.open_registry(self.registry) as connection:
            return [connection.execute(question).fetchall() for question in QUESTIONS]

    def expected(self):
        """The answers that follow from the raw files alone."""
        files = sorted(self.raw.rglob("*.txt"))
        return [[[p.relative_to(self.raw).as_posix(), p.stat().st_size] for p in files], []]


def only_some_views():
    """Build few views: the time of a night is that of its files."""
    texts = dict(database.view_files())
    needed, waiting = set(), list(VIEWS)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            lines = re.findall(r"^--\s*needs:(.*)$", texts[name], re.M)
            waiting += [n.strip() for line in lines for n in line.split(",")]
    chosen = {n: t for n, t in texts.items() if n in needed}
    database.view_files = lambda: chosen
    database._comment = lambda con: None


def in_child(function):
    """(exit status, what it returned) of a function in a process of its own; None after LONGEST_NIGHT: it hangs."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(reader)
            try:
                answer = {"value": function()}
                code = 0
            except Exception as error:
                frames = "".join(traceback.format_exception(error)[-3:])
                answer = {"error": f"{type(error).__name__}: {error}", "trace": frames}
            os.write(writer, json.dumps(answer, default=str).encode()[:60_000])
        finally:
            os._exit(code)
    os.close(writer)
    deadline = time.monotonic() + LONGEST_NIGHT
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            os.close(reader)
            return None, {}
        time.sleep(0.002)
    with os.fdopen(reader, "rb") as stream:
        content = stream.read()
    return status, json.loads(content) if content else {}


def run_seed(seed, root):
    """(kind of the fault, what is wrong afterwards or "", what the faulty night said)."""
    draw = random.Random(seed)
    fleet = Fleet(root)
    kind = draw.choice(KINDS)
    if draw.random() < 0.7:
        in_child(fleet.night)
        fleet.put(f"t{draw.randrange(N_TURNOUT)}", "2024-06-17", "another campaign")
    said = _faulty_night(fleet, kind, draw)
    for k in range(N_CALM):
        status, answer = in_child(fleet.night)
        if status is None:
            return kind, f"night {k + 1} after the fault hangs", said
        if "error" in answer and k == N_CALM - 1:
            return kind, f"night {k + 1} after the fault is broken: {answer['error']} {answer['trace']}", said
    _, got = in_child(fleet.answers)
    wrong = "" if got.get("value") == fleet.expected() else f"answers: {got} instead of {fleet.expected()}"
    return kind, wrong, said


def _faulty_night(fleet, kind, draw):
    victim = fleet.raw / f"t{draw.randrange(N_TURNOUT)}" / "2024-05-13" / "A_1.txt"
    content, compute, after_plan, shim = victim.read_bytes(), length, None, None
    at = draw.randrange(1, 160)
    if kind == "errno":
        shim = Shim(fleet.root, (draw.choice(CALLS),), draw.randrange(1, 40), draw.choice(ERRNOS))
    elif kind == "full_disk":
        shim = Shim(fleet.root, ("fsync", "replace"), draw.randrange(1, 40), errno.ENOSPC, lasting=True)
    elif kind in ("kill", "power_cut"):
        shim = Shim(fleet.root, CALLS, at, 0)
    elif kind == "vanished":
        after_plan = victim.unlink
    elif kind == "torn":
        victim.write_bytes(content[: draw.randrange(len(content))])
    elif kind == "clock":
        jump = draw.choice((-1, 1)) * draw.randrange(10**9)
        os.utime(victim, (10**9 + jump, 10**9 + jump))
    elif kind == "memory":
        name = victim.parts[-3]

        def compute(unit, *args, **more):
            if unit.turnout == name:
                raise MemoryError
            return length(unit, *args, **more)

    def night():
        if shim:
            shim.install()
        return fleet.night(compute, after_plan)

    status, answer = in_child(night)
    victim.parent.mkdir(parents=True, exist_ok=True)
    if not victim.exists() or victim.read_bytes() != content:
        victim.write_bytes(content)
    if kind == "power_cut":
        lost = fleet.root.parent / "unsynced.json"
        for path in json.loads(lost.read_text()) if lost.exists() else ():
            if os.path.exists(path) and str(fleet.raw) not in path:
                os.truncate(path, 0)
    if kind == "flip":
        files = [fleet.registry / f.path for f in load(fleet.registry).files]
        for path in draw.sample(files, min(2, len(files))):
            damaged = bytearray(path.read_bytes())
            bit = draw.randrange(8 * len(damaged))
            damaged[bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
    return "hangs" if status is None else answer.get("error") or answer.get("value") or f"ended by {status}"


def run_seeds(seeds):
    """(seed, kind, what is wrong, what the faulty night said) of each seed."""
    only_some_views()
    for seed in seeds:
        folder = Path(tempfile.mkdtemp(prefix="turnout-faults-"))
        try:
            yield seed, *run_seed(seed, folder / "fleet")
        finally:
            shutil.rmtree(folder, ignore_errors=True)
