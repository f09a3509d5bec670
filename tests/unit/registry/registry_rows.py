"""Results of units, their batches, and registries made from them, for the tests of the registry."""

import hashlib
from pathlib import Path

from turnout.registry.database import open_registry
from turnout.registry.ids import content_id
from turnout.registry.job import register
from turnout.workflow.batches import UnitResult, read_results, write_batch


def hammer_result(turnout="t1", section="A1", day="2026-01-05", frequency=150.0, algo="1", key="k1", file="a", **more):
    """Result of one section and campaign with one recording, model and ballast mode; ``more`` overrides the mode."""
    base = {"turnout_id": turnout, "section_id": f"{turnout}/{section}"}
    at = f"{day}T10:00:00"
    model_id = content_id("model", base["section_id"], day, file, algo, key)
    campaign = {"campaign_id": f"{turnout}/{day}"}
    tables = {
        "recordings": [
            base | campaign | {
                "recording_id": content_id(base["section_id"], day, file), "kind": "hammer", "file_format": "uff",
                "path": f"{turnout}/hammer/{day}/{section}_1.uff", "file_bytes": 1000, "n_records": 10,
            }
        ],
        "models": [
            base | campaign | {
                "model_id": model_id, "measured_at_utc": at, "method": "joint", "status": "accepted",
                "model_order": 4, "a_matrix": [0.5, -0.25, 0.25, 0.5], "code_version": algo, "config_hash": key,
            }
        ],
        "modes": [
            base | {
                "model_id": model_id, "band": "ballast", "measured_at_utc": at, "frequency_hz": frequency,
                "damping_ratio": 0.1, "rail_temperature_c": 12.0, "n_impacts": 30, "source": "hammer",
            } | more
        ],
        "quarantine": [],
    }  # fmt: skip
    return UnitResult(f"{turnout}/hammer/{section}/{day}", turnout, "hammer", f"{key}:{file}", algo, "ok", tables)


def quarantined_result(turnout="t1", section="A1", day="2026-01-05", reason="truncated", key="bad"):
    """Result of a unit whose only file could not be read."""
    row = {
        "turnout_id": turnout, "section_id": f"{turnout}/{section}", "kind": "hammer", "stage": "read",
        "path": f"{turnout}/hammer/{day}/{section}_1.uff", "reason_code": reason, "found": "ends early",
    }  # fmt: skip
    tables = {"quarantine": [row]}
    return UnitResult(f"{turnout}/hammer/{section}/{day}", turnout, "hammer", key, "1", "quarantined", tables)


class Bench:
    """A folder for batches and a registry beside it."""

    def __init__(self, root: Path):
        self.root, self.registry = root, root / "registry"
        self.batches = []

    def batch(self, *results):
        batch = write_batch(self.root / "work", results)
        self.batches = [b for b in self.batches if b != batch] + [batch]
        return batch

    def register(self, *results, **more):
        """Register all batches so far, with ``results`` as the newest; a batch written again moves to the end."""
        if results:
            self.batch(*results)
        return register(self.batches, self.registry, read=read_results, **more)

    def ask(self, sql):
        with open_registry(self.registry) as connection:
            return connection.execute(sql).fetchall()

    def frame(self, sql):
        with open_registry(self.registry) as connection:
            return connection.execute(sql).df()


def parquet_hashes(registry: Path, without=("runs",)):
    """Path and sha256 of every Parquet file but those of the tables ``without``."""
    return {
        path.relative_to(registry).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(registry.rglob("*.parquet"))
        if path.relative_to(registry).parts[0] not in without
    }
