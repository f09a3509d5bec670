"""Intervals of the modes on the fleet of the demonstration: coverage and width about a law of the true stiffness.

The truth of a resonance of simulated track is not known in closed form. For each section, band and quantity a law

    ln f or zeta = one constant for each turnout + a ln(ballast factor) + b ln(railpad factor)

is fitted to all campaigns by least absolute deviations. Errors that are the same in all campaigns are in its constants.
"""

import os
from dataclasses import replace
from zlib import crc32

import numpy as np
from scipy.stats import binom

from benchmarks.bar import Bar, stopwatch
from turnout.config import load_configuration
from turnout.demo.hammer import hammer_test, simulated_response
from turnout.demo.scenario import FLEET, SECTIONS, campaign_days, gap_under, rail_temperature, stiffness_factors
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.stages.hammer import identify_accepted

SEEDS = tuple(int(s) for s in os.environ.get("TURNOUT_BENCH_FLEETS", "1,2").split(","))
BANDS, QUANTITIES = ("ballast", "railpad"), ("frequency", "damping")
N_CAMPAIGN, EVERY = 24, 2


def fleet_modes(seed):
    """A row per section and every second campaign: turnout, section, factors, modes by band. No hanging sleepers."""
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
                rows.append((number, section, factors, {band: model.mode(band) for band in BANDS}))
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


def interval_groups(rows):
    """Of each group its name, the campaigns, the coverage, and the median half width over the exact one."""
    for section in SECTIONS:
        for band in BANDS:
            chosen = [(n, factors, modes[band]) for n, s, factors, modes in rows if s == section and modes[band]]
            x = np.array([[*(n == k for k in range(len(FLEET))), *np.log(factors)] for n, factors, _ in chosen], float)
            for quantity in QUANTITIES:
                value, low, high = (
                    np.array([getattr(mode, quantity + end) for _, _, mode in chosen]) for end in ("", "_low", "_high")
                )
                if quantity == "frequency":
                    value, low, high = np.log(value), np.log(low), np.log(high)
                error = law_residual(x, value)
                inside = (error <= value - low) & (-error <= high - value)
                exact = np.quantile(np.abs(error), 0.95)
                yield (section, band, quantity), len(value), inside.mean(), np.median(0.5 * (high - low)) / exact


def demonstration_coverage():
    """Coverage and width of nominal 95 % intervals on the fleet of the demonstration, for each seed."""
    for seed in SEEDS:
        with stopwatch() as watch:
            groups = list(interval_groups(fleet_modes(seed)))
        coverage, width = (np.array([g[column] for g in groups]) for column in (2, 3))
        inside = int(np.sum((coverage >= 0.93) & (coverage <= 0.97)))
        chance = sum(_chance_inside(n) for _, n, _, _ in groups)
        worst = min(groups, key=lambda g: g[2])
        name, n = f"fleet of seed {seed}: ", f"n={len(groups)} groups of {groups[0][1]}"
        note = f"intervals of exactly 95 % would give {chance:.0f}; mean coverage {coverage.mean():.3f}"
        yield Bar(name + "groups with a coverage of 93 to 97 %", inside, 30, sense=">=", n=n, note=note)
        below = f"{int(np.sum(coverage < 0.9))} groups below 0.90"
        yield Bar(name + "lowest coverage", worst[2], 0.90, sense=">=", n=n, note=f"{' '.join(worst[0])}; {below}")
        note = f"largest {width.max():.1f}, {watch.cpu:.0f} CPU s"
        yield Bar(name + "median width over the exact one", float(np.median(width)), 1.3, n=n, note=note)


def _chance_inside(n):
    counts = np.arange(n + 1)
    return binom.pmf(counts, n, 0.95)[(counts >= 0.93 * n) & (counts <= 0.97 * n)].sum()
