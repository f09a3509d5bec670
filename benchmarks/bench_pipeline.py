"""CPU time of the hammer pipeline, from raw files to registry, over that of only reading the files."""

import shutil
import tempfile
from datetime import date
from pathlib import Path

import numpy as np

from benchmarks.bar import Bar, stopwatch
from benchmarks.published.response import paper_response
from turnout.config import load_configuration, with_raw
from turnout.demo.fleet import EXTENSION
from turnout.demo.hammer import hammer_test, simulated_response
from turnout.demo.scenario import SECTIONS
from turnout.readers import read
from turnout.readers.writing import write
from turnout.registry.job import register
from turnout.stages.hammer import hammer_unit
from turnout.workflow.batches import UnitResult, read_results, write_batch
from turnout.workflow.scan import scan, unit_id

DAY = date(2024, 5, 13)
FORMATS = ("uff58b", "hdf5", "tdms", "mat", "csv")
LIMITED_FORMATS = ("uff58b", "hdf5", "tdms")


def bars():
    """One turnout, one campaign: 8 sections, 3 tests, 10 impacts each, in every format."""
    for title, response, file_format in (
        ("modes of the paper, hdf5", paper_response, "hdf5"),
        ("simulated track, many modes, uff58b", simulated_response, "uff58b"),
    ):
        folder = Path(tempfile.mkdtemp())
        try:
            yield _files_to_rows(title, response, file_format, folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    for file_format in FORMATS:
        folder = Path(tempfile.mkdtemp())
        try:
            yield from _format_bars(file_format, folder)
        finally:
            shutil.rmtree(folder)


def _files_to_rows(title, response, file_format, folder):
    _write_raw_files(folder, file_format, response)
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), folder)
    units, times = scan(turnout, folder).units, []
    for _ in range(4):
        with stopwatch() as watch:
            n = [len(hammer_unit(unit, turnout, folder, algo="bench")["modes"]) for unit in units]
        times.append(watch.cpu)
    name = f"8 x 30 impacts, files to rows, {title}"
    return Bar(name, min(times[1:]), 0.5, "CPU s", "<=", "min of 3", f"first run {times[0]:.2f} s, {sum(n)} modes")


def _format_bars(file_format, folder):
    raw = folder / "raw"
    _write_raw_files(raw, file_format)
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), raw)
    units = scan(turnout, raw).units
    reading_times, processing_times = [], []
    for attempt in range(4):
        with stopwatch() as reading:
            for unit in units:
                for path, _, _ in unit.files:
                    read(path, raw, turnout.hammer.descriptions[unit.section])
        with stopwatch() as processing:
            results = [_hammer_result(unit, turnout, raw) for unit in units]
        with stopwatch() as registering:
            batch = write_batch(folder / f"work{attempt}", results)
            register([batch], folder / f"registry{attempt}", read=read_results)
        if attempt:
            reading_times.append(reading.cpu)
            processing_times.append(processing.cpu + registering.cpu)
    limit, sense = (5.0, "<=") if file_format in LIMITED_FORMATS else (None, "")
    note = f"{min(processing_times):.2f} s over {min(reading_times):.3f} s"
    yield Bar(
        f"raw {file_format} to registry over only reading",
        min(processing_times) / min(reading_times),
        limit,
        "x",
        sense,
        "n=24 files",
        note,
    )
    if file_format == "hdf5":
        yield Bar(
            "one turnout, 8 x 30 impacts, files to registry", min(processing_times), 2.0, "CPU s", "<=", "min of 3"
        )


def _write_raw_files(raw, file_format, response=paper_response):
    folder = raw / "tommerup_s1" / "hammer" / DAY.isoformat()
    folder.mkdir(parents=True)
    for section in SECTIONS:
        rng = np.random.default_rng(len(section))
        for test in (1, 2, 3):
            recordings, _ = hammer_test(response(section, 1.0, 1.0), 12.0, DAY, test, rng)
            write(recordings, folder / f"{section}_{test}.{EXTENSION[file_format]}", file_format, single=True)
    notes = (
        "campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator\n2024-05-13,2024-05-13T09:00:00,12.0,,,\n"
    )
    (raw / "tommerup_s1" / "campaigns.csv").write_text(notes)


def _hammer_result(unit, turnout, raw):
    tables = hammer_unit(unit, turnout, raw, algo="bench")
    return UnitResult(unit_id(unit), unit.turnout, unit.kind, "key", "bench", "ok", tables)
