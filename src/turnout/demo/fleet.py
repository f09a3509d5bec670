"""Write the raw files and the truth of the demonstration fleet, and run the workflow as a user would."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import asdict
from datetime import datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from zlib import crc32

import numpy as np
from tqdm import tqdm

import turnout.demo.scenario as faults
from turnout.child_processes import ProcessPool
from turnout.config import load_configuration
from turnout.demo.hammer import hammer_test, response_at
from turnout.demo.passages import make_passage, make_passages
from turnout.demo.progress import run_with_progress
from turnout.demo.scenario import FLEET, SECTIONS, campaign_days, gap_under, rail_temperature, stiffness_factors
from turnout.demo.track_state import unloaded_track_on
from turnout.demo.weekly_trains import N_WEEK, simulate_run, weekly_jobs, write_weekly_trains
from turnout.files import whole_file, write_text
from turnout.readers.writing import write
from turnout.workflow.project import snakefile_options

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from datetime import date

    from turnout.demo.scenario import TurnoutScenario

EXTENSION = {"uff58b": "uff", "tdms": "tdms", "hdf5": "h5", "mat": "mat", "csv": "csv"}
MISSING_TEMPERATURE = ("tommerup_s1", 7)
# (turnout, campaign, section, test) -> fault of the file, a function of ``scenario``.
FILE_FAULTS = {
    ("tommerup_s1", 3, "SP", 2): "cut_off",
    ("tommerup_s2", 6, "OT", 1): "dead_channel",
    ("aarup_n4", 4, "A9", 3): "swapped_sign",
    ("aarup_n4", 8, "ASM", 1): "not_a_number",
}


# raw folder, truth folder, scenario, seed, number of the campaign, section, day, rail temperature [°C]
Job: TypeAlias = "tuple[str, str, TurnoutScenario, int, int, str, date, float]"


def make_fleet(
    raw: Path | str,
    truth: Path | str,
    seed: int = 1,
    n_campaign: int = 24,
    n_passage: int = 12,
    turnouts: Iterable[str] | None = None,
    workers: int | None = None,
    progress: bool = True,
    n_week: int = N_WEEK,
) -> int:
    """Write raw files below ``raw`` and one truth file per turnout below ``truth``.

    Parameters
    ----------
    raw, truth : path
        Folders, made if they do not exist.
    seed : int
        The same seed gives the same samples.
    n_campaign : int
        Campaigns per turnout, six and a half weeks apart: 24 are three years.
    n_passage : int
        Train passages per turnout without weekly trains, in the weeks before the last campaign; 0: no trains at all.
    turnouts : iterable of str, optional
        Only these; all by default.
    workers : int, optional
        Processes; as many as there are processors by default.
    progress : bool
        Show progress bars.
    n_week : int
        Weeks of the turnout with weekly trains, five or six trains each.

    Returns
    -------
    int
        Number of raw files written.
    """
    chosen = [s for s in FLEET if turnouts is None or s.turnout in set(turnouts)]
    days = campaign_days(n_campaign)
    jobs, trains, weekly = [], [], {}
    for scenario in chosen:
        weather = np.random.default_rng([seed, crc32(scenario.turnout.encode())])
        temperatures = [rail_temperature(day, weather) for day in days]
        _write_campaigns(Path(raw), scenario, days, temperatures)
        _write_truth(Path(truth), scenario, days, temperatures, seed)
        jobs += [
            (str(raw), str(truth), scenario, seed, number, section, day, temperature)
            for number, (day, temperature) in enumerate(zip(days, temperatures))
            for section in SECTIONS
        ]
        if n_passage:
            layout = load_configuration("config").turnout(scenario.turnout)
            if scenario.has_weekly_trains:
                weekly[scenario] = {s.label: (s.position, s.track) for s in layout.sections}
            else:
                trains += make_passages(raw, scenario, layout, seed, n_passage, days[-1])
    runs = [job for scenario, positions in weekly.items() for job in weekly_jobs(scenario, positions, days[-1], n_week)]
    with ProcessPool(workers) as pool:
        counts = pool.map(_make_tests, jobs, chunksize=4)
        total = sum(tqdm(counts, total=len(jobs), desc="hammer tests", unit="section", disable=not progress))
        results = pool.map(make_passage, trains)
        passage_truths = list(tqdm(results, total=len(trains), desc="passages", unit="train", disable=not progress))
        responses = pool.map(simulate_run, runs)
        signals = list(tqdm(responses, total=len(runs), desc="weekly trains", unit="run", disable=not progress))
    truths = {s.turnout: [t for job, t in zip(trains, passage_truths) if job[1].turnout == s.turnout] for s in chosen}
    for k, (scenario, positions) in enumerate(weekly.items()):
        own = signals[k * len(runs) // len(weekly) : (k + 1) * len(runs) // len(weekly)]
        truths[scenario.turnout] = write_weekly_trains(raw, scenario, positions, own, seed, days[-1], n_week)
    if n_passage:
        for turnout, turnout_truths in truths.items():
            write_text(Path(truth) / f"{turnout}_passages.json", json.dumps(turnout_truths, indent=1))
    return total + sum(map(len, truths.values()))


def _make_tests(job: Job) -> int:
    """Write three test files of one section and campaign; returns their number."""
    raw, truth, scenario, seed, number, section, day, temperature = job
    rng = np.random.default_rng([seed, crc32(f"{scenario.turnout}/{section}".encode()), number])
    response = response_at(section, unloaded_track_on(scenario, day, temperature))
    noted_temperature = None if (scenario.turnout, number) == MISSING_TEMPERATURE else temperature
    odd = scenario.odd_campaign
    file_format = odd[1] if odd is not None and odd[0] == number else scenario.format
    folder = Path(raw) / scenario.turnout / "hammer" / day.isoformat()
    folder.mkdir(parents=True, exist_ok=True)
    impacts = []
    for test in (1, 2, 3):
        recordings, truths = hammer_test(response, noted_temperature, day, test, rng)
        fault = FILE_FAULTS.get((scenario.turnout, number, section, test), "")
        if fault and fault != "cut_off":
            recordings = [getattr(faults, fault)(r) for r in recordings]
        path = folder / f"{section}_{test}.{EXTENSION[file_format]}"
        write(recordings, path, file_format, single=True)
        if fault == "cut_off":
            faults.cut_off(path)
        impacts += [asdict(impact) | {"file_fault": fault} for impact in truths if impact.fault or fault]
    if impacts:
        name = f"{scenario.turnout}_{day.isoformat()}_{section}.json"
        write_text(Path(truth) / "impacts" / name, json.dumps(impacts))
    return 3


def _write_campaigns(raw: Path, scenario: TurnoutScenario, days: Sequence[date], temperatures: Sequence[float]) -> None:
    with whole_file(raw / scenario.turnout / "campaigns.csv") as path, open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator"])
        for number, (day, temperature) in enumerate(zip(days, temperatures)):
            missing = (scenario.turnout, number) == MISSING_TEMPERATURE
            start = datetime.combine(day, time(9, 0)).isoformat()
            temperature_text = "" if missing else f"{temperature:.1f}"
            writer.writerow([day.isoformat(), start, temperature_text, "086D50-1", "plastic", "survey crew"])


def _write_truth(
    truth: Path, scenario: TurnoutScenario, days: Sequence[date], temperatures: Sequence[float], seed: int
) -> None:
    sections = {
        section: [stiffness_factors(scenario, section, day, t) for day, t in zip(days, temperatures)]
        for section in SECTIONS
    }
    content = {
        "turnout": scenario.turnout,
        "seed": seed,
        "days": [d.isoformat() for d in days],
        "rail_temperature_c": temperatures,
        "stiffness_factors_ballast_railpad": sections,
        "gaps_m": {s: [gap_under(scenario, s, day) for day in days] for s in {g.section for g in scenario.gaps}},
        "weld": None
        if scenario.weld is None
        else asdict(scenario.weld)
        | {
            "since": scenario.weld.since.isoformat(),
            "depth_on_last_day": scenario.weld.depth_on(days[-1]),
        },
        "changes": [asdict(c) | {"since": c.since.isoformat(), "until": None} for c in scenario.changes],
        "file_faults": [[*k, v] for k, v in FILE_FAULTS.items() if k[0] == scenario.turnout],
    }
    write_text(truth / f"{scenario.turnout}.json", json.dumps(content, indent=1))


def run_pipeline(cores: int, *options: str) -> int:
    """Run Snakemake as a user would, with a line per stage; its output goes to ``logs/workflow.log``.

    Parameters
    ----------
    cores : int
        Number of processors.
    *options : str
        Further options of its command line.

    Returns
    -------
    int
        Its exit code.
    """
    command = [sys.executable, "-m", "snakemake", *snakefile_options(Path()), "--cores", str(cores), *options]
    return run_with_progress(command, Path("logs/workflow.log"))
