"""Description of a raw file by the configuration: its channels, units, rate and counts."""

from __future__ import annotations

from dataclasses import dataclass

MID_SPAN = "mid-span"  # in the mounting of a sensor between two sleepers


@dataclass(frozen=True)
class RawChannel:
    """One channel of a raw file and the channel of a recording that it becomes.

    ``source`` is the channel's name in the file, or its index (int). ``unit`` is the unit of the raw numbers:
    "V", "mV", "count", or physical ("N", "kN", "m/s²", "g", "°C"); None means the unit that the file states.
    ``sensitivity`` with ``sensitivity_unit`` ("mV/N", "mV/g", "mV/(m/s²)", "V/count" ...) converts electrical
    units into physical ones; None if the numbers are physical. ``sign`` is +1 or -1. ``limit`` and
    ``resolution`` are in the SI unit. A unit may have a factor ("0.305 mV" per count, "10 V" full scale). A unit
    that ends with "!" ("V!") overrules the file. A channel with the quantity "ignored" is not read.
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

    @property
    def overrules_file(self) -> bool:
        """Whether its unit holds whatever the file states: it ends with "!"."""
        return (self.unit or "").endswith("!")


@dataclass(frozen=True)
class RawDescription:
    """What the configuration states about a raw file: the reader checks it and converts accordingly.

    ``format`` is a key of ``turnout.readers.FORMATS`` or "auto". ``rate`` [Hz], ``n_records`` and
    ``n_samples`` (per record) are None if not stated. ``channels`` become the rows of the recordings, in
    this order. ``time_zone`` is the zone of the file's time stamps (IANA name).
    ``checked_entries`` are names of entries of the metadata that state neither rate nor scale nor unit of the samples.
    ``required`` are names of channels without which a record has no use. Any other channel may fail and costs itself
    only. A hammer test needs its force and one response in any case.
    """

    channels: tuple[RawChannel, ...]
    kind: str = "hammer"
    format: str = "auto"
    rate: float | None = None
    n_records: int | None = None
    n_samples: int | None = None
    time_zone: str = "UTC"
    checked_entries: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
