"""Configuration of one turnout: sections, hammer tests, passages, campaigns and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from turnout.config.frozen_mapping import Frozen
from turnout.errors import ConfigError
from turnout.records import RawDescription


@dataclass(frozen=True)
class Section:
    """One monitored section: ``label`` as in the layout, ``position`` along the turnout [m]."""

    label: str
    panel: str
    track: str
    position: float
    pad: str = ""
    sleeper: str = ""


@dataclass(frozen=True)
class HammerConfig:
    """Hammer tests: pattern of the ``files`` and, per section label, the description of a file.

    ``force``, ``response`` and ``validation`` (None: there is none) are names of channels of the description.
    """

    files: str
    descriptions: Mapping[str, RawDescription]
    force: Mapping[str, str]
    response: Mapping[str, str]
    validation: Mapping[str, str | None]


@dataclass(frozen=True)
class PassageConfig:
    """Passage recordings: pattern of the ``files``, their ``description``, and the section of each channel."""

    files: str
    description: RawDescription
    sections: Mapping[str, str]


@dataclass(frozen=True)
class Campaign:
    """One campaign; ``rail_temperature`` [°C] may be None. ``listed`` is whether campaigns.csv has a row for it."""

    date: str
    started_at: datetime
    rail_temperature: float | None = None
    hammer_id: str = ""
    tip: str = ""
    operator: str = ""
    listed: bool = True


@dataclass(frozen=True)
class TurnoutConfig:
    """Merged configuration of one turnout: defaults < layout < row of turnouts.tsv < override.

    ``settings`` maps a section ("receptance", "identify" ...) to its settings. ``config_hash`` changes with
    everything that can change a result; ``hashes`` holds the same for what one kind of unit uses ("hammer",
    "passage"). ``campaigns`` (by date) and ``trains`` (rows of trains.csv as text) come from the raw folder:
    ``turnout.config.with_raw`` adds them. ``folder`` is the folder of the configuration, with tracks and vehicles.
    """

    id: str
    layout: str
    raw: str
    sections: tuple[Section, ...]
    hammer: HammerConfig | None
    passages: PassageConfig | None
    settings: Mapping[str, Any]
    config_hash: str
    hashes: Mapping[str, str]
    name: str = ""
    line: str = ""
    km: float | None = None
    latitude: float | None = None
    longitude: float | None = None
    external_id: str = ""
    id_scheme: str = ""
    campaigns: Mapping[str, Campaign] = field(default_factory=Frozen)
    trains: tuple[Mapping[str, str], ...] = ()
    folder: Path = Path("config")

    def __repr__(self) -> str:
        kinds = [
            name for name, part in (("hammer tests", self.hammer), ("passages", self.passages)) if part is not None
        ]
        sections = f"{len(self.sections)} sections"
        return f"TurnoutConfig({self.id}, layout {self.layout}: {', '.join([sections, *kinds])})"

    @property
    def layout_file(self) -> Path:
        """File of the layout."""
        return self.folder / "layouts" / f"{self.layout}.yaml"

    def require_passages(self) -> PassageConfig:
        """Files and channels of the passages.

        Returns
        -------
        PassageConfig
            That of the layout.

        Raises
        ------
        ConfigError
            If the layout describes no passages.
        """
        if self.passages is None:
            remedy = "Add the part 'passages:' as in the layout tommerup. A hammer test is read with its section"
            raise ConfigError(self.layout_file, "passages", "the layout describes no passages", remedy)
        return self.passages

    def section(self, label: str) -> Section:
        """The section with a label.

        Parameters
        ----------
        label : str
            Label as in the layout.

        Returns
        -------
        Section
            The section.

        Raises
        ------
        KeyError
            For an unknown label; the message lists the labels.
        """
        for section in self.sections:
            if section.label == label:
                return section
        raise KeyError(f"turnout {self.id} has no section {label!r}; it has {[s.label for s in self.sections]}")

    def section_id(self, label: str) -> str:
        """Id of a section in the registry.

        Parameters
        ----------
        label : str
            Label as in the layout.

        Returns
        -------
        str
            "<turnout>/<label>".
        """
        return f"{self.id}/{label}"
