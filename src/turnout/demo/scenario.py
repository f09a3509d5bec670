"""Scenario of the demonstration fleet: campaigns, weather, maintenance, true changes, and instrument faults.

Each fault is a function that puts it into a recording or a file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import DAYS_PER_YEAR

if TYPE_CHECKING:
    from pathlib import Path

    from turnout.records import Recording

MILLIMETRE = 1e-3
SECTIONS = ("OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD")
FIRST_CAMPAIGN = date(2023, 9, 12)


@dataclass(frozen=True)
class Change:
    """Stiffness of one section from a day on: a step, then a drift, as factors of the reference value.

    ``component`` is "ballast" or "railpad"; ``step`` the factor at ``since``; ``per_year`` the relative
    change of stiffness per year after it. ``event`` is the maintenance that caused it, "" if unknown.
    """

    section: str
    component: str
    since: date
    step: float = 1.0
    per_year: float = 0.0
    event: str = ""
    until: date | None = None

    def factor(self, day: date) -> float:
        """Factor of the stiffness on a day.

        Parameters
        ----------
        day : date
            The day.

        Returns
        -------
        float
            1 before ``since`` and from ``until`` on. [-]
        """
        if day < self.since or (self.until is not None and day >= self.until):
            return 1.0
        years = (day - self.since).days / DAYS_PER_YEAR
        return self.step * (1.0 + self.per_year) ** years


@dataclass(frozen=True)
class Gap:
    """A sleeper that hangs above its ballast: ``gap`` [m] from the day ``since``, growing by ``per_year`` [m]."""

    section: str
    since: date
    gap: float
    per_year: float

    def size_on(self, day: date) -> float:
        """Gap on a day.

        Parameters
        ----------
        day : date
            The day.

        Returns
        -------
        float
            0 before ``since``. [m]

        Examples
        --------
        >>> Gap("A7", date(2025, 1, 1), 0.4e-3, 1.0e-3).size_on(date(2024, 1, 1))
        0.0
        """
        if day < self.since:
            return 0.0
        return self.gap + self.per_year * (day - self.since).days / DAYS_PER_YEAR


@dataclass(frozen=True)
class WornWeld:
    """A weld that becomes a dip in the running surface, which trains record and hammer tests do not.

    ``position`` [m], ``depth`` [m] from the day ``since``, growing by ``per_year`` [m] over ``length`` [m], on the rail
    of ``track``.
    """

    section: str
    position: float
    since: date
    depth: float
    per_year: float
    length: float = 0.6
    track: str = "main"

    def depth_on(self, day: date) -> float:
        """Depth on a day.

        Parameters
        ----------
        day : date
            The day.

        Returns
        -------
        float
            0 before ``since``. [m]

        Examples
        --------
        >>> weld = WornWeld("ASM", 36.3, date(2026, 1, 1), 0.1e-3, 0.2e-3)
        >>> weld.depth_on(date(2025, 12, 31)), round(1e3 * weld.depth_on(date(2027, 1, 1)), 3)
        (0.0, 0.3)
        """
        if day < self.since:
            return 0.0
        return self.depth + self.per_year * (day - self.since).days / DAYS_PER_YEAR


@dataclass(frozen=True)
class TurnoutScenario:
    """One turnout of the fleet: its file format and its changes over time."""

    turnout: str
    format: str
    changes: tuple[Change, ...] = ()
    gaps: tuple[Gap, ...] = ()
    events: tuple[tuple[date, str, str], ...] = ()
    odd_campaign: tuple[int, str] | None = None
    stiffness: float = 1.0
    weld: WornWeld | None = None
    has_weekly_trains: bool = False


FLEET = (
    TurnoutScenario("tommerup_s1", "uff58b", odd_campaign=(5, "mat"), events=((date(2025, 4, 2), "A8", "grinding"),)),
    TurnoutScenario(
        "tommerup_s2",
        "tdms",
        changes=(Change("A8", "ballast", since=date(2025, 5, 1), per_year=-0.15),),
        stiffness=1.06,
        weld=WornWeld("ASM", 36.3, since=date(2026, 4, 1), depth=0.4 * MILLIMETRE, per_year=1.8 * MILLIMETRE),
        has_weekly_trains=True,
    ),
    TurnoutScenario(
        "aarup_n4",
        "hdf5",
        changes=(Change("CLP", "railpad", since=date(2025, 3, 18), step=1.12, event="pad_exchange"),),
        gaps=(Gap("ASM", since=date(2025, 8, 20), gap=0.3 * MILLIMETRE, per_year=1.0 * MILLIMETRE),),
        events=((date(2025, 3, 18), "CLP", "pad_exchange"), (date(2024, 11, 5), "", "sensor_change")),
        odd_campaign=(9, "csv"),
        stiffness=0.95,
    ),
)


def campaign_days(n_campaign: int, weeks_between: float = 6.5) -> list[date]:
    """Days of the campaigns: every few weeks with random shifts, the same for the same number.

    Parameters
    ----------
    n_campaign : int
        Number of campaigns.
    weeks_between : float
        Mean distance of two campaigns. [weeks]

    Returns
    -------
    list of date
        In order.

    Examples
    --------
    >>> campaign_days(3, weeks_between=6)[0].isoformat()
    '2023-09-12'
    """
    shifts = np.random.default_rng(20231).integers(-4, 5, size=n_campaign)
    shifts[0] = 0
    return [FIRST_CAMPAIGN + timedelta(weeks=weeks_between * k) + timedelta(days=int(s)) for k, s in enumerate(shifts)]


def rail_temperature(day: date, rng: np.random.Generator) -> float:
    """Rail temperature at the time of the test: season in Denmark and random weather.

    Parameters
    ----------
    day : date
        Day of the test.
    rng : numpy.random.Generator
        Source of the weather.

    Returns
    -------
    float
        Temperature. [°C]
    """
    season = np.sin(2 * np.pi * (day.timetuple().tm_yday - 110) / DAYS_PER_YEAR)
    return float(11.0 + 11.0 * season + rng.normal(0.0, 4.0))


def gap_under(scenario: TurnoutScenario, section: str, day: date) -> float:
    """Gap under the sleeper of a section's sensor.

    Parameters
    ----------
    scenario : TurnoutScenario
        The turnout.
    section : str
        Label of the section.
    day : date
        The day.

    Returns
    -------
    float
        0 if the sleeper lies on its ballast. [m]
    """
    return max((g.size_on(day) for g in scenario.gaps if g.section == section), default=0.0)


def stiffness_factors(scenario: TurnoutScenario, section: str, day: date, temperature: float) -> tuple[float, float]:
    """Stiffness of ballast and railpad relative to the reference section at 15 °C.

    The pad softens by 0.3 % per kelvin (static stiffness of EPDM pads falls by up to half between -20 and
    60 °C, Othman et al. 2022); frozen ballast stiffens by up to 6 % below 0 °C.

    Parameters
    ----------
    scenario : TurnoutScenario
        The turnout.
    section : str
        Label of the section.
    day : date
        The day.
    temperature : float
        Rail temperature. [°C]

    Returns
    -------
    (float, float)
        Factors of ballast and railpad. [-]
    """
    ballast, railpad = 1.0 - 0.004 * min(0.0, max(temperature, -15.0)), 1.0 - 0.003 * (temperature - 15.0)
    for change in scenario.changes:
        if change.section == section:
            if change.component == "ballast":
                ballast *= change.factor(day)
            else:
                railpad *= change.factor(day)
    return ballast, railpad


def dead_channel(recording: Recording) -> Recording:
    """The accelerometer's cable is off.

    Parameters
    ----------
    recording : Recording
        Channel 0 is the force, channel 1 the acceleration.

    Returns
    -------
    Recording
        The same with zeros in channel 1.
    """
    samples = recording.samples.copy()
    samples[1] = 0.0
    return replace(recording, samples=samples)


def swapped_sign(recording: Recording) -> Recording:
    """The hammer's charge amplifier is connected the wrong way round.

    Parameters
    ----------
    recording : Recording
        Channel 0 is the force, channel 1 the acceleration.

    Returns
    -------
    Recording
        The same with the force reversed.
    """
    samples = recording.samples.copy()
    samples[0] = -samples[0]
    return replace(recording, samples=samples)


def overload(recording: Recording, share: float = 0.6) -> Recording:
    """The range was set too low: the acceleration is clipped.

    Parameters
    ----------
    recording : Recording
        Channel 0 is the force, channel 1 the acceleration.
    share : float
        Limit over the peak. [-]

    Returns
    -------
    Recording
        The same with channel 1 clipped.
    """
    samples = recording.samples.copy()
    limit = share * np.max(np.abs(samples[1]))
    samples[1] = np.clip(samples[1], -limit, limit)
    return replace(recording, samples=samples)


def not_a_number(recording: Recording) -> Recording:
    """A logger that lost its converter for a moment.

    Parameters
    ----------
    recording : Recording
        Channel 0 is the force, channel 1 the acceleration.

    Returns
    -------
    Recording
        The same with five samples of channel 1 that are no numbers.
    """
    samples = recording.samples.copy()
    samples[1, samples.shape[1] // 3 : samples.shape[1] // 3 + 5] = np.nan
    return replace(recording, samples=samples)


def cut_off(path: Path, share: float = 0.55) -> None:
    """An interrupted copy: only the first part of the file is left.

    Parameters
    ----------
    path : Path
        The file, which is changed.
    share : float
        Share of its bytes that stays. [-]
    """
    size = path.stat().st_size
    with open(path, "r+b") as file:
        file.truncate(int(share * size))
