"""A fleet of tiny text files, and a stage function whose rows contain their lengths."""

import errno
import os
import signal

from turnout.config import load_configuration
from turnout.errors import PartlyComputed, ReadError
from turnout.workflow.batches import read_results
from turnout.workflow.plan import write_plans
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

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
CALLS = []


def length(unit, turnout, raw_root, algo=""):
    """Rows with the length of each file; the text of a file can request a fault."""
    CALLS.append(f"{unit.turnout}/{unit.label}")
    rows = {"recordings": [], "quarantine": []}
    for path, *_ in unit.files:
        text = (raw_root / path).read_text()
        if text == "damaged":
            raise ReadError(path, "byte 0", "damage", "Copy it again", reason="unreadable")
        if text == "bug":
            raise ZeroDivisionError("in the toy")
        if text == "no package":
            raise ModuleNotFoundError("No module named 'h5py'", name="h5py")
        if text == "no package for a record":
            raise PartlyComputed(rows, [(path, 0, ModuleNotFoundError("No module named 'h5py'", name="h5py"))])
        if text == "full":
            raise OSError(errno.ENOSPC, "No space left on device")
        if text == "bad sector":
            raise OSError(errno.EIO, "Input/output error")
        if text == "too large":
            raise MemoryError
        if text == "kills its process":
            os._exit(9)
        if text == "kills the job":
            os.killpg(0, signal.SIGKILL)
        rows["recordings"].append({"path": path, "n_samples": len(text), "kind": "hammer"})
    return rows


class Fleet:
    """One shard with turnouts t0, t1, ... of one section each."""

    def __init__(self, folder, n_turnout=3, settings=""):
        self.folder, self.raw = folder, folder / "raw"
        (folder / "config/layouts").mkdir(parents=True)
        (folder / "config/layouts/main.yaml").write_text(LAYOUT)
        (folder / "config/config.yaml").write_text(settings)
        lines = ["turnout\tlayout\tline", *(f"t{i}\tmain\tline {i % 2}" for i in range(n_turnout))]
        (folder / "config/turnouts.tsv").write_text("\n".join(lines) + "\n")
        for i in range(n_turnout):
            self.put(f"t{i}/2024-05-13/A_1.txt", f"turnout {i}")
        self.state = folder / "work/hammer/00of01.json"
        self.plan = folder / "work/plan/00of01.json"

    def put(self, name, text):
        path = self.raw / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    @property
    def configuration(self):
        return load_configuration(self.folder / "config")

    def run(self, algo="1", plan=True, stage=None, **more):
        CALLS.clear()
        if plan:
            write_plans(self.configuration, self.raw, self.plan.parent, 1)
        stage = stage or Stage("hammer", length, algo)
        return run_shard(self.plan, self.state, stage, self.configuration, self.raw, **more)

    def rows(self):
        """{unit: tables} as the registry gets them: a later batch overrides an earlier one."""
        return {r.unit: r.tables for path in batch_paths([self.state]) for r in read_results(path)}

    def lengths(self):
        return {u: [r["n_samples"] for r in t.get("recordings", [])] for u, t in self.rows().items()}
