"""Peak memory of each stage beside 200 MB and six times the bytes that it reads, each in a process of its own."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.bit_flips import unit_of_year
from turnout.readers.writing import WRITERS, write
from turnout.records import Channel, Recording
from turnout.workflow.batches import write_batch

FREE, PER_BYTE = 200e6, 6  # bytes
TEXT_FORMATS = ("uff58", "csv", "lvm")  # slow to write: smaller files
ROOT = Path(__file__).resolve().parents[1]
PEAK = """
import sys
def peak():
    lines = open('/proc/self/status').read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('VmHWM')) * 1024
"""
READ = """
from turnout.readers import read
from turnout.records import RawChannel, RawDescription
names = [f'c{k}' for k in range(4)]
channels = tuple(RawChannel(n, n, 'acceleration', unit='m/s²') for n in names)
result = read(sys.argv[2], sys.argv[1], RawDescription(channels=channels, rate=20000.0))
assert result.recordings, result.errors
"""
HAMMER = """
from pathlib import Path
from turnout.config import load_configuration, with_raw
from turnout.workflow.scan import scan
from turnout.stages.hammer import hammer_unit
root = Path(sys.argv[1])
turnout = with_raw(load_configuration(root / 'config').turnout('t0'), root / 'raw')
for unit in scan(turnout, root / 'raw').units[:1]:
    assert hammer_unit(unit, turnout, root / 'raw')['models']
"""
REGISTER = """
from turnout.arrow_memory import use_system_allocator
use_system_allocator()
from pathlib import Path
from turnout.registry.job import register
from turnout.workflow.batches import read_results
turnouts = [{'turnout_id': f't{k}', 'name': f't{k}', 'layout': 'l', 'config_hash': 'h'} for k in range(5000)]
folder = Path(sys.argv[1])
assert register([folder / sys.argv[2]], folder / 'registry', read=read_results, tables={'turnouts': turnouts}).n_units
"""

TREND = """
from turnout.arrow_memory import use_system_allocator
use_system_allocator()
from pathlib import Path
from turnout.stages.trend import trend_job
folder = Path(sys.argv[1])
(folder / 'config').mkdir()
(folder / 'config/turnouts.tsv').write_text('turnout\\tlayout\\n')
paths = [str(folder / name) for name in ('registry/_generation.json', 'trend.json', 'config')]
trend_job(*paths, '2024-06-01')
"""
WORKLIST = """
from pathlib import Path
from turnout.stages.worklist import worklist_job
folder = Path(sys.argv[1])
worklist_job(folder / 'registry/_generation.json', folder / 'worklist.csv', folder / 'work', '2024-06-01')
"""
REPORT = """
from pathlib import Path
from turnout.report.job import report_job
folder = Path(sys.argv[1])
report_job(folder / 'registry', folder / 'pages', [f't{k}' for k in range(20)], day='2024-06-01')
"""


@dataclass(frozen=True)
class StageMemory:
    """Peak of the resident memory of a stage, and the bytes that it read. [byte]"""

    stage: str
    n_input: int
    peak: int

    @property
    def limit(self) -> float:
        """The bar."""
        return FREE + PER_BYTE * self.n_input


def peak_of(code: str, *arguments: object) -> int:
    """Peak of the resident memory of a process that runs the code. [byte]"""
    command = [sys.executable, "-c", f"{PEAK}{code}\nprint(peak())", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return int(done.stdout.split()[-1])


def recording(n_byte: int) -> Recording:
    """Noise in four channels whose float64 samples are ``n_byte`` bytes."""
    samples = np.random.default_rng(0).normal(size=(4, n_byte // 32))
    return Recording(samples, 20000.0, tuple(Channel(f"c{k}", "acceleration") for k in range(4)))


def measure(n_byte: int = 24_000_000, formats: tuple[str, ...] = tuple(WRITERS)) -> Iterator[StageMemory]:
    """Reading of each format, one hammer test, and registration."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for format in formats:
            size = n_byte // 8 if format in TEXT_FORMATS else n_byte
            ending = {"uff58": "uff", "uff58b": "uff", "hdf5": "h5", "rcmdx": "rcmdx", "mat73": "mat"}.get(
                format, format
            )
            path = write([recording(size)], folder / f"{format}.{ending}", format)
            yield StageMemory(f"reading {format}", path.stat().st_size, peak_of(READ, folder, path.name))
            path.unlink()
        batch = write_batch(folder, [unit_of_year(2024, f"t{k}") for k in range(5000)])
        yield StageMemory("registration of 5,000 units", batch.stat().st_size, peak_of(REGISTER, folder, batch.name))
        n_byte = sum(path.stat().st_size for path in (folder / "registry").rglob("*.parquet"))
        yield StageMemory("trends of its registry", n_byte, peak_of(TREND, folder))
        yield StageMemory("worklist of its registry", n_byte, peak_of(WORKLIST, folder))
        yield StageMemory("pages of 20 of its turnouts", n_byte, peak_of(REPORT, folder))


def measure_hammer() -> StageMemory:
    """One campaign of one section: ten impacts of the shipped layout."""
    from benchmarks.workflow_hammer import make_fleet

    with tempfile.TemporaryDirectory() as name:
        make_fleet(Path(name))
        n_byte = next(iter(sorted(Path(name).glob("raw/t0/hammer/*/*.npz")))).stat().st_size
        return StageMemory("a hammer test", n_byte, peak_of(HAMMER, name))
