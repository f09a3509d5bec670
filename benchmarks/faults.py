"""Seeded faults of one night of a small fleet, and the nights after it; a failure is replayed from its seed.

``fault_shim.c`` stands between the processes and libc, so that the files of Python, DuckDB and Arrow are all reached.
A seed draws a scenario, a kind of fault and the call at which it occurs. After the faults the registry must be byte
identical to that of an undisturbed fleet. Where the faulty night left units for the next one, the same rows may be in
other files, and the night must have named the file or the fault of the machine.
"""

import ctypes
import errno
import json
import logging
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from importlib import import_module
from pathlib import Path

from turnout.config import load_configuration
from turnout.content import sha256_of
from turnout.registry import database, schema, view_texts
from turnout.registry.compaction import compact
from turnout.registry.generation import load
from turnout.registry.ids import content_id
from turnout.registry.job import register
from turnout.workflow.batches import read_results
from turnout.workflow.plan import read_problems, write_plans
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

SHIM = Path(__file__).with_name("fault_shim.c")
OPEN, READ, WRITE, RENAME, SYNC, LIST, STAT, UNLINK, MKDIR, FORK, MEMORY = (1 << k for k in range(11))
COUNT, FAIL, KILL, SHORT, REMOVE, CUT, GROW, JUMP = range(8)
FILE_CALLS = OPEN | READ | WRITE | RENAME | SYNC | LIST | STAT | UNLINK | MKDIR
WRITING_CALLS = WRITE | RENAME | SYNC | MKDIR
KINDS = (
    "errno", "errno", "full disk", "short transfers", "kill", "kill", "power cut", "power cut", "file vanishes",
    "file is cut", "file grows", "torn file", "bit flip", "clock jump", "no memory", "no process", "killed process",
)  # fmt: skip
SCENARIOS = {"first night": 1, "new files": 1, "new files, compaction": 1, "new files, two processes": 2}
INPUT_KINDS = ("file vanishes", "file is cut", "file grows", "torn file")
TABLES_IN_USE = ("recordings", "quarantine", "results", "runs", "supersedes")
COLUMNS_OF_VIEWS = (
    "result_id", "run_id", "section_id", "turnout_id", "campaign_id", "model_id", "passage_id", "finding_id", "method",
    "passed_at_utc", "measured_at_utc", "started_at_utc", "found_at_utc", "channel", "band", "left_layout", "panel",
    "label", "sections",
)  # fmt: skip
VIEWS = ("superseded", "results_current", "recordings_current", "quarantine_open")
N_TURNOUT, N_CALM = 4, 3  # turnouts; nights after the fault, of which the last must be right at the latest
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


class Control(ctypes.Structure):
    """The block that the shim shares with all processes; the fields are explained there."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("armed", "calls", "action", "code", "at", "lasting", "seconds", "n")),
        ("fired", ctypes.c_long), ("n_dirty", ctypes.c_long), ("count", ctypes.c_long * 16),
        ("folder", ctypes.c_char * 1024),
        ("victim", ctypes.c_char * 1024), ("fired_path", ctypes.c_char * 1024), ("dirty", ctypes.c_ulong * 8192),
    ]  # fmt: skip


def control():
    """The control block of the shim in this process."""
    library = ctypes.CDLL(None)
    library.fault_control.restype = ctypes.POINTER(Control)
    return library.fault_control().contents


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


class Warnings(logging.Handler):
    """Keeps the warnings of a night."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        """Keep the text of one warning."""
        self.texts.append(record.getMessage()[:300])


class Fleet:
    """Folder with configuration, raw files, work and registry."""

    def __init__(self, root):
        self.root, self.raw, self.registry = root, root / "raw", root / "registry"
        self.state, self.plan = root / "work/hammer/00of01.json", root / "work/plan/00of01.json"
        self.is_compacting, self.threads = False, 1

    def make(self):
        """Write the configuration and one campaign of each turnout."""
        (self.root / "config" / "layouts").mkdir(parents=True)
        (self.root / "config" / "layouts" / "main.yaml").write_text(LAYOUT)
        names = [f"t{k}" for k in range(N_TURNOUT)]
        (self.root / "config" / "turnouts.tsv").write_text(
            "\n".join(["turnout\tlayout", *(f"{n}\tmain" for n in names)])
        )
        for k, name in enumerate(names):
            self.put(name, "2024-05-13", f"turnout {k}")

    def put(self, turnout, day, text):
        """Write a raw file."""
        path = self.raw / turnout / day / "A_1.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def night(self, compute=length):
        """One night: plan, shard, registration, perhaps compaction; what it says, with its warnings."""
        warnings = Warnings()
        logging.getLogger("turnout").addHandler(warnings)
        configuration = load_configuration(self.root / "config")
        write_plans(configuration, self.raw, self.plan.parent, 1, accept_vanished=True)
        stage = Stage("hammer", compute, "1")
        summary = run_shard(self.plan, self.state, stage, configuration, self.raw, threads=self.threads)
        result = register(batch_paths([self.state]), self.registry, read=read_results, max_wait=5.0)
        if self.is_compacting:
            compact(self.registry)
        faults = "".join(f"; {path}: {fault}" for path, fault in result.faults.items())
        postponed = self.state.with_suffix("") / "postponed.json"
        waiting = json.loads(postponed.read_text())["units"] if summary.postponed else ""
        problems = "".join(f"; {problem['path']}: {problem['found']}" for _, problem in read_problems(self.plan))
        return f"{summary}{faults}{problems} {waiting} {' '.join(warnings.texts)}"

    def calm_night(self):
        """A night without faults, and the registry after it."""
        last_line = self.night()
        return {"said": last_line, **self.contents()}

    def contents(self):
        """Hashes of the live files on the disk without those of ``runs``, and the rows that users see."""
        generation = load(self.registry)
        files = sorted((f.table, sha256_of(self.registry / f.path)) for f in generation.files if f.table != "runs")
        damaged = [f.path for f in generation.files if sha256_of(self.registry / f.path) != f.sha256]
        rows = {}
        with database.open_registry(self.registry) as connection:
            for view in VIEWS[1:]:
                sql = f"select * exclude (run_id) from {view} order by all"
                rows[view] = [repr(row) for row in connection.execute(sql).fetchall()]
            (published,) = connection.execute("select generation from registry_info").fetchall()[0]
        behind = published != generation.number
        return {"files": files, "rows": rows, "wrong": [*damaged, *(["registry.duckdb is behind"] if behind else [])]}


def use_small_schema():
    """Few columns and few views: the time of a night is that of its files."""
    columns = schema.tables()
    for table in columns:
        if table not in TABLES_IN_USE:
            columns[table] = type(columns[table])(c for c in columns[table] if c.key or c.name in COLUMNS_OF_VIEWS)
    texts = dict(view_texts.view_files())
    needed, waiting = set(), list(VIEWS)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            lines = re.findall(r"^--\s*needs:(.*)$", texts[name], re.M)
            waiting += [n.strip() for line in lines for n in line.split(",")]
    chosen = {n: t for n, t in texts.items() if n in needed}
    view_texts.view_files = lambda: chosen


def in_child(function, arm=None):
    """(exit status, what it returned or raised) of a function in a process of its own; status None: it hangs."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(reader)
            os.setpgid(0, 0)
            try:
                if arm:
                    arm()
                answer = {"value": function()}
                code = 0
            except BaseException as error:
                frames = "".join(traceback.format_exception(error)[-3:])
                answer = {"error": f"{type(error).__name__}: {error}", "trace": frames}
            control().armed = 0
            os.write(writer, json.dumps(answer, default=str).encode()[:60_000])
        finally:
            os._exit(code)
    os.close(writer)
    deadline = time.monotonic() + LONGEST_NIGHT
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done or time.monotonic() > deadline:
            break
        time.sleep(0.002)
    control().armed = 0
    try:
        os.killpg(child, signal.SIGKILL)  # its processes, or all of it
    except ProcessLookupError:
        pass
    if not done:
        os.waitpid(child, 0)
        os.close(reader)
        return None, {}
    with os.fdopen(reader, "rb") as stream:
        content = stream.read()
    return status, json.loads(content) if content else {}


def import_what_a_night_needs(fleet):
    """Import here what a night imports, so that the process of each night has it already."""
    fleet.make()
    before = set(sys.modules)
    _, answer = in_child(lambda: [fleet.calm_night(), sorted(set(sys.modules) - before)][1])
    for name in answer["value"]:
        import_module(name)


class Seeds:
    """Scenarios in one folder, made once; each seed starts from a copy."""

    def __init__(self, folder):
        self.folder, self.fleet, self.known = folder, Fleet(folder / "fleet"), {}

    def run(self, seed):
        """(kind, scenario, problem or "", whether byte identical, what the faulty night said) of one seed."""
        draw = random.Random(seed)
        scenario, kind = draw.choice(list(SCENARIOS)), draw.choice(KINDS)
        if kind in ("no process", "killed process"):
            scenario = "new files, two processes"
        truth, n_call = self._scenario(scenario)
        self._restore(scenario)
        status, answer, needle = self._faulty_night(kind, n_call, draw)
        outcome = "hangs" if status is None else answer.get("error") or answer.get("value") or f"ended by {status}"
        if status is None:
            return kind, scenario, "the night hangs", False, outcome
        after, later = {}, ""
        for _ in range(N_CALM):
            status, answer = in_child(self.fleet.calm_night)
            after = answer.get("value") or {}
            later += after.get("said", "")
            if status is None or (after and after["rows"] == truth["rows"] and not after["wrong"]):
                break
        if status is None:
            return kind, scenario, "a night after the fault hangs", False, outcome
        if not after:
            return kind, scenario, f"broken: {answer.get('error')} {answer.get('trace')}", False, outcome
        if after["rows"] != truth["rows"] or after["wrong"]:
            right, now = (
                {f"{view}: {row}" for view in rows for row in rows[view]} for rows in (truth["rows"], after["rows"])
            )
            problem = f"{after['wrong']} missing {sorted(right - now)}, wrong {sorted(now - right)}; {after['said']}"
            return kind, scenario, problem, False, outcome
        is_identical = after["files"] == truth["files"]
        is_excused = is_identical or kind in INPUT_KINDS or any(word and word in outcome + later for word in needle)
        problem = "" if is_excused else "other files, and the night named neither a file nor the fault"
        return kind, scenario, problem, is_identical, outcome

    def _scenario(self, name):
        """What is right after the night of a scenario, and the number of its calls by kind."""
        if name not in self.known:
            shutil.rmtree(self.fleet.root, ignore_errors=True)
            fleet = self.fleet
            fleet.make()
            if name != "first night":
                for day in ("2024-05-13", "2024-05-20"):
                    fleet.put("t1", day, "earlier campaign")
                    self._must(in_child(fleet.night))
                fleet.put("t2", "2024-06-17", "new campaign")
                fleet.put("t3", "2024-05-13", "corrected")
            shutil.copytree(fleet.root, self.folder / name)
            self._set(name)
            self._must(in_child(fleet.night, lambda: self._arm(FILE_CALLS, COUNT)))
            counts = list(control().count)
            truth = self._must(in_child(fleet.contents))
            if truth["wrong"]:
                raise RuntimeError(f"the undisturbed night is wrong: {truth}")
            self.known[name] = truth, counts
        return self.known[name]

    @staticmethod
    def _must(outcome):
        if "value" not in outcome[1]:
            raise RuntimeError(f"an undisturbed night failed: {outcome}")
        return outcome[1]["value"]

    def _set(self, name):
        self.fleet.is_compacting, self.fleet.threads = "compaction" in name, SCENARIOS[name]

    def _restore(self, name):
        shutil.rmtree(self.fleet.root, ignore_errors=True)
        shutil.copytree(self.folder / name, self.fleet.root)
        self._set(name)

    def _arm(self, calls, action, at=1, code=0, lasting=False, victim="", seconds=0):
        block = control()
        block.calls, block.action, block.at, block.code, block.lasting = calls, action, at, code, lasting
        block.seconds, block.n, block.fired, block.n_dirty, block.fired_path = seconds, 0, 0, 0, b""
        block.folder, block.victim = os.fsencode(self.fleet.root), os.fsencode(victim)
        block.count = (ctypes.c_long * 16)()
        block.armed = 1

    def _faulty_night(self, kind, n_call, draw):
        """(exit status, answer, words of which the night must say one) of the night with the fault."""
        fleet, compute = self.fleet, length
        control().n_dirty, control().fired_path = 0, b""
        victim = draw.choice(sorted(fleet.raw.rglob("*.txt")))
        content, times = victim.read_bytes(), (victim.stat().st_atime_ns, victim.stat().st_mtime_ns)
        code = draw.choice(sorted(errno.errorcode))
        calls = FILE_CALLS

        def at(calls):
            return draw.randint(1, max(1, sum(n for k, n in enumerate(n_call) if calls >> k & 1)))

        options: dict = {"calls": FILE_CALLS, "action": COUNT}
        if kind == "errno":
            calls = draw.choice((OPEN, READ, WRITE, RENAME, SYNC, LIST, STAT, UNLINK, MKDIR))
            options = {"calls": calls, "action": FAIL, "code": code, "at": at(calls), "lasting": draw.random() < 0.2}
            options["lasting"] &= code != errno.EINTR  # a call is repeated after a signal, and signals end
        elif kind == "full disk":
            code = draw.choice((errno.ENOSPC, errno.EDQUOT, errno.EROFS))
            options = {"calls": WRITING_CALLS, "action": FAIL, "code": code, "at": at(WRITING_CALLS), "lasting": True}
        elif kind == "short transfers":
            options = {"calls": FILE_CALLS, "action": SHORT, "at": at(FILE_CALLS), "lasting": True}
        elif kind in ("kill", "power cut"):
            options = {"calls": FILE_CALLS, "action": KILL, "at": at(FILE_CALLS)}
        elif kind in ("file vanishes", "file is cut", "file grows"):
            action = {"file vanishes": REMOVE, "file is cut": CUT, "file grows": GROW}[kind]
            cut_to = draw.randrange(len(content))
            options = {"calls": FILE_CALLS, "action": action, "at": at(FILE_CALLS), "victim": victim, "code": cut_to}
        elif kind == "torn file":
            files = [p for p in sorted(fleet.root.rglob("*")) if p.is_file() and not p.is_relative_to(fleet.registry)]
            torn = draw.choice([p for p in files if not p.is_relative_to(fleet.root / "config")])
            if torn.is_relative_to(fleet.raw):
                victim, content = torn, torn.read_bytes()
                times = (torn.stat().st_atime_ns, torn.stat().st_mtime_ns)
            os.truncate(torn, draw.randrange(max(1, torn.stat().st_size)))
        elif kind == "clock jump":
            jump = draw.choice((-1, 1)) * draw.randrange(10**9)
            options = {"calls": FILE_CALLS, "action": JUMP, "at": at(FILE_CALLS), "lasting": True, "seconds": jump}
        elif kind == "no memory" and draw.random() < 0.5:
            code, name = errno.ENOMEM, victim.parts[-3]

            def compute(unit, *args, **more):
                if unit.turnout == name:
                    raise MemoryError
                return length(unit, *args, **more)

        elif kind == "no memory":
            code = errno.ENOMEM
            options = {"calls": MEMORY, "action": FAIL, "code": code, "at": at(MEMORY), "lasting": draw.random() < 0.3}
        elif kind == "no process":
            code = draw.choice((errno.EAGAIN, errno.ENOMEM))
            options = {"calls": FORK, "action": FAIL, "code": code, "at": draw.randint(1, 2), "lasting": True}
        elif kind == "killed process":
            name = victim.parts[-3]

            def compute(unit, *args, **more):
                if unit.turnout == name:
                    os._exit(9)
                return length(unit, *args, **more)

        status, answer = in_child(lambda: fleet.night(compute), lambda: self._arm(**options))
        if not victim.exists() or victim.read_bytes() != content:
            victim.parent.mkdir(parents=True, exist_ok=True)
            victim.write_bytes(content)
            if draw.random() < 0.5:
                os.utime(victim, ns=times)  # copied again with its time
        if kind == "power cut":
            self._lose_unsynced(draw)
        if kind == "bit flip":
            files = [fleet.registry / f.path for f in load(fleet.registry).files]
            for path in draw.sample(files, min(2, len(files))):
                damaged = bytearray(path.read_bytes())
                bit = draw.randrange(8 * len(damaged))
                damaged[bit // 8] ^= 1 << bit % 8
                path.write_bytes(damaged)
        words = [os.strerror(code), str(self.fleet.root), control().fired_path.decode(errors="replace"), "ended by",
                 "the process died", "Memory", "emory", *(f"t{k}/" for k in range(N_TURNOUT))]  # fmt: skip
        return status, answer, words

    def _lose_unsynced(self, draw):
        """What a power cut does to files that were written and not flushed: their end, or all of them, is lost."""
        lost = set(control().dirty[: control().n_dirty]) - {0}
        for path in sorted(self.fleet.root.rglob("*")):
            if path.is_file() and not path.is_relative_to(self.fleet.raw) and path.stat().st_ino in lost:
                size = path.stat().st_size
                kept = draw.choice((0, draw.randint(0, size)))
                os.truncate(path, kept)
                if draw.random() < 0.3:
                    os.truncate(path, size)  # pages of zeros


def build_shim(folder):
    """The compiled shim; None without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not compiler:
        return None
    library = Path(folder) / "fault_shim.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", library, SHIM, "-ldl"], check=True)
    return library


def run_seeds(first, n_seed, n_process=2):
    """Results of seeds as dicts, from worker processes that have the shim before libc."""
    memory_disk = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="turnout-faults-", dir=memory_disk) as folder:
        library = build_shim(folder)
        if library is None:
            raise RuntimeError("cc: there is no C compiler. Install one: the faults are injected by a small library.")
        n_process = max(1, min(n_process, n_seed))
        environment = os.environ | {"LD_PRELOAD": str(library)}
        workers = []
        for k in range(n_process):
            own = Path(folder) / str(k)
            own.mkdir()
            command = [
                sys.executable,
                "-m",
                "benchmarks.faults",
                str(own),
                str(first + k),
                str(first + n_seed),
                str(n_process),
            ]
            workers.append(subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True))
        for worker in workers:
            for line in worker.stdout:
                yield json.loads(line)
        if any([worker.wait() for worker in workers]):
            raise RuntimeError("a process that runs the seeds ended early")


def main():
    """Worker: one line of JSON per seed."""
    folder, first, end, step = Path(sys.argv[1]), *map(int, sys.argv[2:5])
    use_small_schema()
    import_what_a_night_needs(Fleet(folder / "fleet"))
    seeds = Seeds(folder)
    for seed in range(first, end, step):
        keys = ("kind", "scenario", "problem", "is_identical", "said")
        print(json.dumps({"seed": seed} | dict(zip(keys, seeds.run(seed)))), flush=True)


if __name__ == "__main__":
    main()
