"""One measured quantity of a recording."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """One measured quantity of a recording.

    ``quantity`` is "force" [N], "acceleration" [m/s²], "velocity" [m/s], "displacement" [m], "strain" [-]
    or "temperature" [°C]; the samples are in that SI unit with the configured sign already applied.
    ``position`` is the place along the track [m] in the turnout's coordinate, ``mounting`` where the sensor
    sits ("rail head at sleeper", "rail head mid-span", "rail web", "sleeper", "hammer"). ``limit`` is the
    range beyond which the instrument clips and ``resolution`` one step of its converter, both in the SI
    unit, None where unknown.
    """

    name: str
    quantity: str
    position: float | None = None
    mounting: str = ""
    serial: str = ""
    limit: float | None = None
    resolution: float | None = None
