"""Read raw files and configurations."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from turnout import config, readers
from turnout.config import Configuration, TurnoutConfig
from turnout.config.load import load_layout
from turnout.errors import ConfigError, ReadError
from turnout.readers.channel_descriptions import quantity_of_sensor
from turnout.readers.channel_maps import index_of
from turnout.records import RawChannel, RawDescription, ReadResult
from turnout.units import SI, conversion, to_si

ChannelMap = Mapping[str, str | Mapping[str, Any] | RawChannel]
EXAMPLE = "{'quantity': 'force', 'unit': 'V', 'sensitivity': 0.23, 'sensitivity_unit': 'mV/N'}"


def read(
    path: str | os.PathLike,
    layout: str | os.PathLike | TurnoutConfig | None = None,
    section: str | None = None,
    *,
    channels: ChannelMap | None = None,
    rate: float | None = None,
    kind: str | None = None,
    format: str = "auto",
    time_zone: str = "UTC",
) -> ReadResult:
    """Read one raw file of a hammer test or of passages, in any supported format, in SI units.

    A file that names its channels with physical units needs nothing else. Otherwise a layout or ``channels`` says what
    its channels are.

    Parameters
    ----------
    path : path-like
        UFF, TDMS, HDF5, MATLAB, CSV, LVM, WAV, npz, Parquet or RCM-DX.
    layout : path-like or TurnoutConfig, optional
        A layout, such as "config/layouts/tommerup.yaml", or ``load_configuration("config").turnout("tommerup_s1")``.
    section : str, optional
        Label of the section of a hammer test. A layout without a section describes a file of passages.
    channels : mapping of str to str, mapping or RawChannel, optional
        Without layout: what a channel of the file is, by its name there. A text is a quantity: "force",
        "acceleration", "velocity", "displacement", "strain", "pressure", "temperature", or "ignored". Its numbers are
        in the unit that the file states, or in SI. A mapping has keys of ``RawChannel``: ``quantity``, ``unit``,
        ``sensitivity``, ``sensitivity_unit``, ``sign`` (1 or -1), ``position`` [m], ``mounting``, ``limit`` ...
    rate : float, optional
        Sampling rate, where the file does not state it; else the two must agree. [Hz]
    kind : str, optional
        "hammer" or "passage"; by default "hammer" where a force is measured.
    format : str
        A key of ``turnout.readers.FORMATS``, where the file itself does not tell.
    time_zone : str
        IANA name of the zone of the times in the file.

    Returns
    -------
    ReadResult
        A sequence of its intact recordings, (n_channel, n_sample) each, in SI. ``errors`` holds a ReadError for each
        damaged record, and a warning is given for it.

    Raises
    ------
    ReadError
        If no record of the file can be used. It states file, place, problem and remedy.
    ConfigError, ConfigErrors
        If the layout cannot be used, or has no such section.

    Examples
    --------
    A hammer of 0.23 mV/N that reads 1 V has seen 4347.8 N.

    >>> import tempfile, numpy as np, turnout
    >>> volts = {"hammer": np.array([0.0, 1.0, 0.0, 0.1]), "fs": 51200.0}
    >>> hammer = {"quantity": "force", "unit": "V", "sensitivity": 0.23, "sensitivity_unit": "mV/N"}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(folder + "/test.npz", **volts)
    ...     result = turnout.read(folder + "/test.npz", channels={"hammer": hammer}, rate=51200.0)
    >>> result[0]
    Recording(hammer: hammer (force); 4 samples at 51200 Hz, 7.813e-05 s, test.npz record 1)
    >>> result[0].signal("hammer").round(1)
    array([   0. , 4347.8,    0. ,  434.8])
    """
    given = Path(path)
    try:
        file = given.resolve()
        if layout is not None:
            description = _description_of_layout(layout, section, channels)
        else:
            described = _described_channels(file, channels or {}, format)
            is_hammer = kind == "hammer" or (kind is None and any(c.quantity == "force" for c in described))
            kind = "hammer" if is_hammer else "passage"
            description = RawDescription(described, kind, format, rate, time_zone=time_zone)
        result = readers.read(file.name, file.parent, description)
    except ReadError as error:
        raise ReadError(given, error.where, error.problem, error.remedy, error.reason) from None
    if not result.recordings and result.errors:
        raise result.errors[0]
    for problem in result.errors:
        warnings.warn(str(problem), stacklevel=2)
    return result


def _description_of_layout(
    layout: str | os.PathLike | TurnoutConfig, section: str | None, channels: ChannelMap | None
) -> RawDescription:
    """What a layout states about the files of a section, or about those of passages."""
    if channels is not None:
        raise ValueError("give either a layout or channels: both say what the channels are")
    turnout = layout if isinstance(layout, TurnoutConfig) else load_layout(Path(layout))
    if section is None:
        return turnout.require_passages().description
    if turnout.hammer is None:
        raise ConfigError(turnout.layout_file, "hammer", "the layout describes no hammer tests", "Add the part hammer")
    if section not in turnout.hammer.descriptions:
        remedy = f"Write one of {', '.join(turnout.hammer.descriptions)}"
        raise ConfigError(turnout.layout_file, "section", f"there is no section {section!r}", remedy)
    return turnout.hammer.descriptions[section]


def _described_channels(file: Path, channels: ChannelMap, format: str) -> tuple[RawChannel, ...]:
    """Every channel of a file, as ``channels`` or the file itself describes it."""
    stated = readers.names_and_units(file.name, file.parent, format)
    names = [name for name, _ in stated]
    for name in channels:
        if name not in names:
            _check_numbers(file, name, format)
            remedy = "Correct the name in 'channels'"
            available = ", ".join(repr(n) for n in names)
            problem = f"there is no channel {name!r}; there are {available}"
            raise ReadError(file, "the channels", problem, remedy, "channel_missing")
    return tuple(
        _channel_as_described(name, index, unit, channels[name])
        if name in channels
        else _channel_by_unit(name, index, unit, file)
        for index, (name, unit) in enumerate(stated)
    )


def _check_numbers(file: Path, name: str, format: str) -> None:
    """ReadError if a variable of the file has this name and holds no real numbers."""
    source, _, raw = readers.read_unconverted(file.name, file.parent, format)
    for record in raw.records:
        if not isinstance(record, ReadError) and name in record.not_numbers:
            index_of(record, name, "the channels", source)


def _channel_as_described(name: str, index: int, unit: str, entry: str | Mapping[str, Any] | RawChannel) -> RawChannel:
    """The channel of row ``index`` as the caller describes it."""
    if isinstance(entry, RawChannel):
        return entry
    if isinstance(entry, str):
        return RawChannel(name, index, entry, None if unit else SI.get(entry))
    return RawChannel(**{"name": name, "source": index, **entry})


def _channel_by_unit(name: str, index: int, unit: str, file: Path) -> RawChannel:
    """The channel of row ``index`` by its unit; ReadError for a unit that is not that of one quantity."""
    try:
        quantity = conversion(unit).dimension if unit else ""
    except ValueError:
        quantity = ""
    named = quantity_of_sensor(name)
    if quantity in SI and named in ("", quantity):
        return RawChannel(name, index, quantity)
    statement = f"its unit {unit!r} does not state its quantity" if unit else "the file states no unit"
    if quantity in SI:
        statement = f"its unit {unit!r} is one of {quantity}, and its name says {named}"
    remedy = f"Describe it: channels={{{name!r}: {EXAMPLE}}}, or {{{name!r}: 'ignored'}} if it is not wanted"
    raise ReadError(file, f"channel {name!r}", statement, remedy, "unit_unknown")


def load_configuration(folder: str | os.PathLike = "config") -> Configuration:
    """Read and check the configuration of a fleet: settings, turnouts, layouts, overrides, events.

    Parameters
    ----------
    folder : path-like
        Holds config.yaml, turnouts.tsv and layouts/.

    Returns
    -------
    Configuration
        ``turnout(id)`` gives a ``TurnoutConfig``, for ``read`` and ``analyse_passage``; ``ids`` lists the turnouts.

    Raises
    ------
    ConfigErrors
        With every error: file, line, column, problem and remedy.

    Examples
    --------
    >>> import turnout
    >>> configuration = turnout.load_configuration("config")
    >>> turnout_s1 = configuration.turnout(configuration.ids[0])
    >>> [section.label for section in turnout_s1.sections][:3]
    ['OT', 'SP', 'CLP']
    """
    return config.load_configuration(Path(folder), readers.FORMATS, to_si)
