"""One bit flips in each of many live files of a registry; after the next night every answer is as before."""

import logging
import random
from dataclasses import dataclass
from pathlib import Path

from turnout.registry.database import open_registry
from turnout.registry.generation import load
from turnout.registry.ids import content_id
from turnout.registry.job import register
from turnout.workflow.batches import UnitResult, read_results, write_batch

TABLES = ("recordings", "quarantine", "models", "modes", "results")


@dataclass(frozen=True)
class Flips:
    """Outcome: flipped files, those that a message named, rows in all and rows that differ after the night."""

    n_flipped: int
    n_named: int
    n_row: int
    n_different: int


def flip_bits(folder: Path, n_file: int, seed: int = 0) -> Flips:
    """Make a registry of at least ``n_file`` live files, flip a bit in each of ``n_file``, and run the next night."""
    registry = folder / "registry"
    years = range(2020 - n_file // len(TABLES), 2021)
    batch = write_batch(folder / "work", [unit_of_year(year) for year in years])
    register([batch], registry, read=read_results)
    before = _rows(registry)
    draw = random.Random(seed)
    live = [f.path for f in load(registry).files if f.table in TABLES]
    for path in draw.sample(live, n_file):
        content = bytearray((registry / path).read_bytes())
        bit = draw.randrange(8 * len(content))
        content[bit // 8] ^= 1 << bit % 8
        (registry / path).write_bytes(content)
    named = _Names()
    log = logging.getLogger("turnout.registry")
    log.addHandler(named)
    try:
        register([batch], registry, read=read_results)
    finally:
        log.removeHandler(named)
    after = _rows(registry)
    n_named = sum(any(path in text for text in named.texts) for path in live)
    return Flips(n_file, n_named, len(before), len(before ^ after))


class _Names(logging.Handler):
    """Keeps the messages."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        """Keep the text of a message."""
        self.texts.append(record.getMessage())


def _rows(registry):
    with open_registry(registry) as connection:
        return {
            (table, *map(str, row))
            for table in TABLES
            for row in connection.execute(f"select * exclude (run_id) from {table}").fetchall()
        }


def unit_of_year(year: int, turnout: str = "t1") -> UnitResult:
    """A unit with one row in each table, all of its own year."""
    day, base = f"{year}-05-13", {"turnout_id": turnout, "section_id": f"{turnout}/A"}
    model = {"model_id": content_id("model", turnout, day), "measured_at_utc": f"{day}T10:00:00", "method": "joint"}
    path = f"{turnout}/{day}/A_1.uff"
    tables = {
        "recordings": [
            base | {"recording_id": content_id(turnout, day), "path": path, "kind": "hammer", "file_format": "uff"}
        ],
        "models": [
            base
            | model
            | {
                "status": "accepted",
                "model_order": 4,
                "code_version": "1",
                "config_hash": "k",
                "campaign_id": f"{turnout}/{day}",
            }
        ],
        "modes": [
            base
            | model
            | {
                "band": "ballast",
                "source": "hammer",
                "n_impacts": 30,
                "frequency_hz": 150.0 + year / 1000,
                "damping_ratio": 0.1,
            }
        ],
        "quarantine": [base | {"path": path, "stage": "hammer", "kind": "hammer", "reason_code": "weak", "record": 1}],
    }
    return UnitResult(f"{turnout}/hammer/A/{day}", turnout, "hammer", "k", "1", "partly", tables)
