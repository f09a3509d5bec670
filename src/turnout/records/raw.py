"""What the configuration promises about a raw file, before it is read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RawChannel:
    """How one channel stands in a raw file, and what it becomes.

    ``source`` is the channel's name in the file, or its index (int). ``unit`` is the unit of the raw numbers:
    "V", "mV", "count", or already physical ("N", "kN", "m/s²", "g", "°C"); None = as the file says.
    ``sensitivity`` with ``sensitivity_unit`` ("mV/N", "mV/g", "mV/(m/s²)", "V/count" ...) turns electrical
    units into physical ones, None where the numbers are physical already. ``sign`` is +1 or -1. ``limit`` and
    ``resolution`` are in the SI unit. A unit may carry a factor ("0.305 mV" per count, "10 V" full scale); with
    "!" behind it ("V!") it overrules what the file says. The quantity "ignored" drops the channel.
    """

    name: str
    source: str | int
    quantity: str
    unit: str | None = None
    sensitivity: float | None = None
    sensitivity_unit: str = ""
    sign: int = 1
    position: float | None = None
    mounting: str = ""
    serial: str = ""
    limit: float | None = None
    resolution: float | None = None


@dataclass(frozen=True)
class RawDescription:
    """What the configuration promises about a raw file: the reader compares, converts and orders.

    ``format`` is a key of ``turnout.readers.FORMATS`` or "auto". ``rate`` [Hz], ``n_records`` and
    ``n_samples`` (per record) are None where not promised. ``channels`` become the rows of the recordings, in
    this order. ``time_zone`` is the zone of the file's time stamps (IANA name).
    """

    channels: tuple[RawChannel, ...]
    kind: str = "hammer"
    format: str = "auto"
    rate: float | None = None
    n_records: int | None = None
    n_samples: int | None = None
    time_zone: str = "UTC"
