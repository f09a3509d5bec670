"""With the real hammer stage: a small fleet of full recordings gives the same rows for any shards and cores."""

import shutil
from datetime import date
from pathlib import Path

import numpy as np

from benchmarks.bar import Bar, stopwatch
from benchmarks.published.response import paper_response
from turnout.demo.hammer import hammer_test
from turnout.readers.writing import write

REPOSITORY = Path(__file__).resolve().parents[1]
DAYS = (date(2024, 5, 13), date(2024, 6, 17))
TURNOUTS, SECTIONS = 5, ("SP", "A7", "A8")
COMBINATIONS = ((1, 1), (1, 2), (7, 1), (7, 2), (64, 1), (64, 2))


def hammer_same_rows(folder, toy):
    """Compare registries of one fleet by (shards, cores); ``toy`` is the module that runs the workflow."""
    n_file = make_fleet(folder)
    registries, cpu_texts = {}, []
    for shards, cores in COMBINATIONS:
        toy.remove_outputs(folder)
        with stopwatch() as watch:
            toy.run(folder, shards=shards, cores=cores, function="")
        registries[shards, cores] = tuple(toy.data_files(folder))
        cpu_texts.append(f"{shards}x{cores} {watch.cpu:.0f} s")
    rows = toy.rows(folder)
    n = f"{n_file} files, {len(rows['impacts'])} impacts, {len(rows['modes'])} modes; shards x cores, CPU: "
    off = abs(len(rows["models"]) - (n_file - 1))
    yield Bar("hammer stage: models too many or too few", off, 0, "", "<=", f"{n_file} files, one of them cut off")
    yield Bar(
        "hammer stage: different registries", len(set(registries.values())), 1, "", "<=", n + ", ".join(cpu_texts)
    )


def make_fleet(folder):
    """Write configuration and raw files: ten impacts per file, one file cut off. Returns the number of files."""
    shutil.copytree(REPOSITORY / "config", folder / "config", ignore=shutil.ignore_patterns("events.csv", "overrides"))
    ids = [f"t{k}" for k in range(TURNOUTS)]
    lines = ["turnout\tlayout\tline", *(f"{t}\ttommerup\tline {k % 2}" for k, t in enumerate(ids))]
    (folder / "config/turnouts.tsv").write_text("\n".join(lines) + "\n")
    paths = []
    for k, turnout in enumerate(ids):
        rng = np.random.default_rng(k)
        notes = ["campaign,started_at_utc,rail_temperature_c"]
        for day in DAYS:
            notes.append(f"{day},{day}T09:00:00,12.0")
            campaign_folder = folder / "raw" / turnout / "hammer" / day.isoformat()
            campaign_folder.mkdir(parents=True)
            for section in SECTIONS:
                recordings, _ = hammer_test(paper_response(section, 1.0, 1.0), 12.0, day, 1, rng)
                paths.append(campaign_folder / f"{section}_1.npz")
                write(recordings, paths[-1], "npz")
        (folder / "raw" / turnout / "campaigns.csv").write_text("\n".join(notes) + "\n")
    paths[-1].write_bytes(paths[-1].read_bytes()[:5000])
    return len(paths)
