"""Intervals of the modes on the fleet of the demonstration: coverage and width about a law of the true stiffness.

The truth of a resonance of simulated track is not known in closed form. For each section, band and quantity a law

    ln f or zeta = one constant for each turnout + a ln(ballast factor) + b ln(railpad factor)

is fitted to all campaigns by least absolute deviations. Errors that are the same in all campaigns are in its constants.
"""

import os
from dataclasses import dataclass, replace
from datetime import date
from importlib.resources import files
from zlib import crc32

import duckdb
import numpy as np
import pandas as pd
from scipy.stats import binom

from benchmarks.bar import Bar, stopwatch
from turnout.config import load_configuration
from turnout.demo.hammer import hammer_test, simulated_response
from turnout.demo.scenario import FLEET, SECTIONS, campaign_days, gap_under, rail_temperature, stiffness_factors
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.stages.hammer import identify_accepted

SEEDS = tuple(int(s) for s in os.environ.get("TURNOUT_BENCH_FLEETS", "1,2").split(","))
BANDS, QUANTITIES = ("ballast", "railpad"), ("frequency", "damping")
N_CAMPAIGN = 24
EVERY = int(os.environ.get("TURNOUT_BENCH_EVERY", "2"))  # 1 uses all campaigns and takes twice as long


@dataclass(frozen=True)
class Campaign:
    """One section in one campaign: number of the turnout, factors of ballast and railpad, modes by band."""

    turnout: int
    section: str
    factors: tuple[float, float]
    modes: dict
    day: date
    temperature: float


def fleet_modes(seed):
    """The sections of every second campaign, without hanging sleepers."""
    settings = load_configuration("config").turnout(FLEET[0].turnout).settings
    days, rows = campaign_days(N_CAMPAIGN), []
    for number, scenario in enumerate(FLEET):
        weather = np.random.default_rng([seed, crc32(scenario.turnout.encode())])
        temperatures = [rail_temperature(day, weather) for day in days]
        for campaign in range(0, N_CAMPAIGN, EVERY):
            day, temperature = days[campaign], temperatures[campaign]
            for section in SECTIONS:
                if gap_under(scenario, section, day) > 0.0:
                    continue
                factors = stiffness_factors(scenario, section, day, temperature)
                response = simulated_response(section, *(f * scenario.stiffness for f in factors))
                rng = np.random.default_rng([seed, crc32(f"{scenario.turnout}/{section}".encode()), campaign])
                recordings = []
                for test in (1, 2, 3):
                    records, _ = hammer_test(response, temperature, day, test, rng)
                    recordings += [replace(r, source=f"{section}_{test}") for r in records]
                impacts = find_track_impacts(recordings, "force", "rail", settings["receptance"])
                model = identify_accepted(impacts, settings["receptance"], settings["identify"])[2]
                modes = {band: model.mode(band) for band in BANDS}
                rows.append(Campaign(number, section, factors, modes, day, round(temperature, 1)))
    return rows


def law_residual(x, y):
    """``y`` minus its law of least absolute deviations in the columns of ``x``, by reweighted least squares."""
    weight = np.ones(len(y))
    for _ in range(60):
        root = np.sqrt(weight)
        residual = y - x @ np.linalg.lstsq(x * root[:, None], y * root, rcond=None)[0]
        scale = max(np.median(np.abs(residual)), 1e-12)
        weight = 1.0 / np.maximum(np.abs(residual), 0.1 * scale)
    return residual


def own_intervals(rows):
    """{(row, band, quantity): (low, high)} of the campaigns themselves."""
    return {
        (k, band, quantity): (getattr(mode, quantity + "_low"), getattr(mode, quantity + "_high"))
        for k, row in enumerate(rows)
        for band, mode in row.modes.items()
        if mode is not None
        for quantity in QUANTITIES
    }


def history_intervals(rows):
    """The same from the view ``mode_intervals``, which has the history of each section."""
    modes = pd.DataFrame([
        {
            "model_id": k, "band": band, "turnout_id": row.turnout, "section_id": f"{row.turnout}/{row.section}",
            "measured_at_utc": pd.Timestamp(row.day), "epoch": 0, "rail_temperature_c": row.temperature,
            "source": "hammer", "frequency_hz": mode.frequency, "damping_ratio": mode.damping,
            "frequency_repeatability_hz": mode.frequency_repeatability,
            "damping_repeatability": mode.damping_repeatability,
        }
        for k, row in enumerate(rows) for band, mode in row.modes.items() if mode is not None
    ])  # fmt: skip
    with duckdb.connect() as connection:
        connection.register("epochs", modes)
        for view in ("students_t", "mode_scatter", "mode_intervals"):
            connection.execute(files("turnout.registry").joinpath(f"views/{view}.sql").read_text(encoding="utf-8"))
        found = connection.execute("select model_id, band, quantity, value_low, value_high from mode_intervals")
        return {(k, band, quantity): (low, high) for k, band, quantity, low, high in found.fetchall()}


def interval_groups(rows, intervals):
    """Of each group its name, the campaigns, the coverage, and the median half width over the exact one."""
    for section in SECTIONS:
        for band in BANDS:
            for quantity in QUANTITIES:
                index = [k for k, row in enumerate(rows) if row.section == section and (k, band, quantity) in intervals]
                x = [[*(rows[k].turnout == n for n in range(len(FLEET))), *np.log(rows[k].factors)] for k in index]
                value = np.array([getattr(rows[k].modes[band], quantity) for k in index])
                low, high = np.array([intervals[k, band, quantity] for k in index]).T
                if quantity == "frequency":
                    value, low, high = np.log(value), np.log(low), np.log(high)
                error = law_residual(np.array(x, float), value)
                inside = (error <= value - low) & (-error <= high - value)
                exact = np.quantile(np.abs(error), 0.95)
                yield (section, band, quantity), len(value), inside.mean(), np.median(0.5 * (high - low)) / exact


def demonstration_coverage():
    """Coverage and width of nominal 95 % intervals on the fleet of the demonstration, for each seed."""
    for seed in SEEDS:
        with stopwatch() as watch:
            rows = fleet_modes(seed)
        for name, intervals in (("own intervals", own_intervals), ("with history", history_intervals)):
            yield from _bars(f"fleet of seed {seed}, {name}: ", list(interval_groups(rows, intervals(rows))), watch.cpu)


def _bars(name, groups, seconds):
    coverage, width = (np.array([g[column] for g in groups]) for column in (2, 3))
    inside = int(np.sum((coverage >= 0.93) & (coverage <= 0.97)))
    chance = sum(_chance_inside(n) for _, n, _, _ in groups)
    worst = min(groups, key=lambda g: g[2])
    n = f"n={len(groups)} groups of {groups[0][1]}"
    note = f"intervals of exactly 95 % would give {chance:.0f}; mean coverage {coverage.mean():.3f}"
    yield Bar(name + "groups with a coverage of 93 to 97 %", inside, 30, sense=">=", n=n, note=note)
    below = f"{int(np.sum(coverage < 0.9))} groups below 0.90"
    yield Bar(name + "lowest coverage", worst[2], 0.90, sense=">=", n=n, note=f"{' '.join(worst[0])}; {below}")
    note = f"largest {width.max():.1f}, {seconds:.0f} CPU s"
    yield Bar(name + "median width over the exact one", float(np.median(width)), 1.3, n=n, note=note)


def _chance_inside(n):
    counts = np.arange(n + 1)
    return binom.pmf(counts, n, 0.95)[(counts >= 0.93 * n) & (counts <= 0.97 * n)].sum()
