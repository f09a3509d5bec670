"""Simulate a fleet of resonance histories with known truth: season, weather, AR(1) noise, campaign effect, changes.

It is independent of the charts. These values are assumptions, since no such record is published. A railpad resonance
scatters by 0.6 % per campaign. Its temperature coefficient is -0.15 +- 0.05 %/degC (pad stiffness falls by up to half
over the range of service temperatures, Othman et al. 2022; Oregui et al. 2016). Rail temperature follows the year with
+-15 degC and the weather with 6 degC; it is noted to +-1 degC. A campaign shifts all sections of a turnout by a common
0.6 %. The remaining noise is AR(1) from week to week.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

START = np.datetime64("2016-01-04T09:00:00")


@dataclass(frozen=True)
class Fleet:
    """Assumptions of one simulated fleet; percentages of the frequency."""

    turnouts: int = 500
    sections: int = 8
    weeks: int = 156
    sigma: float = 0.6
    phi: float = 0.2
    campaign: float = 0.6
    coefficient: float = -0.15
    coefficient_spread: float = 0.05
    season: float = 15.0
    weather: float = 6.0
    thermometer: float = 1.0
    frequency: float = 450.0
    band: str = "railpad"
    every: float = 1
    missing: float = 0.0
    tails: float = np.inf
    curvature: float = 0.0
    prefix: str = "T"

    @property
    def charts(self) -> int:
        return self.turnouts * self.sections


def histories(fleet, seed, change=None):
    """Frequencies (turnouts, sections, campaigns) [Hz], noted temperatures and weeks of the campaigns.

    ``change`` is an array [%] that broadcasts to the shape of the frequencies: the truth.
    """
    rng = np.random.default_rng(seed)
    week = np.arange(0, fleet.weeks, fleet.every)
    shape = (fleet.turnouts, fleet.sections, week.size)
    phase = rng.uniform(-2.0, 2.0, (fleet.turnouts, 1))
    rail = 12.0 + fleet.season * np.sin(2 * np.pi * (week + phase - 17) / 52.18)
    rail = rail + fleet.weather * rng.standard_normal((fleet.turnouts, week.size))
    temperature = rail + fleet.thermometer * rng.standard_normal(rail.shape)
    phi = fleet.phi**fleet.every
    noise = rng.standard_normal(shape)
    if np.isfinite(fleet.tails):
        noise *= np.sqrt((fleet.tails - 2.0) / rng.chisquare(fleet.tails, shape))  # Student's t of unit variance
    for i in range(1, week.size):
        noise[..., i] = phi * noise[..., i - 1] + np.sqrt(1 - phi**2) * noise[..., i]
    slope = fleet.coefficient + fleet.coefficient_spread * rng.standard_normal(shape[:2])[..., None]
    percent = fleet.sigma * noise + slope * (rail[:, None] - 12.0)
    percent += fleet.curvature * (rail[:, None] - 12.0) ** 2
    percent += fleet.campaign * rng.standard_normal(rail.shape)[:, None]
    if change is not None:
        percent = percent + change
    base_frequency = fleet.frequency * (1.0 + 0.1 * rng.uniform(-1, 1, shape[:2]))[..., None]
    frequency = base_frequency * (1.0 + percent / 100.0)
    frequency[rng.random(shape) < fleet.missing] = np.nan
    return frequency, temperature, week


def modes(fleet, seed, change=None) -> pd.DataFrame:
    """Histories as rows of the table ``modes``."""
    frequency, temperature, week = histories(fleet, seed, change)
    t, s, c = (i.ravel() for i in np.indices(frequency.shape, dtype=np.int32))
    turnout = np.array([f"{fleet.prefix}{i:05d}" for i in range(fleet.turnouts)])
    section = np.array([f"{name}/S{j}" for name in turnout for j in range(fleet.sections)])
    rows = pd.DataFrame(
        {
            "turnout_id": pd.Categorical.from_codes(t, turnout),
            "section_id": pd.Categorical.from_codes(t * fleet.sections + s, section),
            "band": pd.Categorical.from_codes(np.zeros(t.size, np.int8), [fleet.band]),
            "source": pd.Categorical.from_codes(np.zeros(t.size, np.int8), ["hammer"]),
            "measured_at_utc": (START + np.round(week * 7).astype("timedelta64[D]")).astype("datetime64[us]")[c],
            "frequency_hz": frequency.ravel(),
            "frequency_se_hz": np.full(t.size, 0.1),
            "rail_temperature_c": temperature[t, c],
        }
    )
    return rows[rows["frequency_hz"].notna()] if fleet.missing else rows


def drift(fleet, which, percent_per_year, start):
    """A change that grows from week ``start`` in the sections of the mask ``which`` (turnouts, sections)."""
    week = np.arange(0, fleet.weeks, fleet.every)
    return which[..., None] * percent_per_year * np.maximum(week - start, 0) / 52.18


def step(fleet, which, percent, start):
    """A change that comes at week ``start``."""
    week = np.arange(0, fleet.weeks, fleet.every)
    return which[..., None] * percent * (week >= start)
