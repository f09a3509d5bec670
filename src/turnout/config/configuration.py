"""The checked configuration of a fleet, and the source of every value in it."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from turnout.config.document import Place, leaves
from turnout.config.events import Event
from turnout.config.merge import Variant
from turnout.config.schema import NO_TURNOUT, suggestion
from turnout.config.turnout import TurnoutConfig
from turnout.config.turnouts_table import Row
from turnout.errors import ConfigError

FIELD_OF_COLUMN = {"lat_deg": "latitude", "lon_deg": "longitude"}


@dataclass(frozen=True)
class Configuration:
    """Configuration of the fleet: common ``settings``, ``rows`` of turnouts by id, ``events`` in order of time.

    ``acknowledgements`` are rows of the table of that name. ``warnings`` are its invalid rows and events of unknown
    turnouts. They are no errors: one wrong row must not hide the alarms of other turnouts. ``faulty`` are the errors of
    the turnouts that were left out for them, by id; those of rows without a valid id are under "".
    """

    folder: Path
    settings: Mapping[str, Any]
    rows: Mapping[str, Row]
    events: tuple[Event, ...]
    variants: Mapping[str, Variant] = field(repr=False)
    acknowledgements: tuple[dict, ...] = ()
    warnings: tuple[ConfigError, ...] = ()
    faulty: Mapping[str, tuple[ConfigError, ...]] = field(default_factory=dict)

    def __repr__(self) -> str:
        layouts = sorted({row.values["layout"] for row in self.rows.values()})
        n_warning = f", {len(self.warnings)} warnings" if self.warnings else ""
        names = f"{len(self.rows)} turnouts, layouts: {', '.join(layouts[:4])}{' ...' if len(layouts) > 4 else ''}"
        return f"Configuration({self.folder}: {names}, {len(self.events)} events{n_warning})"

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of all turnouts, in the order of turnouts.tsv."""
        return tuple(self.rows)

    @property
    def errors(self) -> tuple[ConfigError, ...]:
        """The errors for which turnouts were left out, each once."""
        return tuple({str(error): error for errors in self.faulty.values() for error in errors}.values())

    def is_left_out(self, turnout: str) -> bool:
        """Whether nothing of a turnout may be changed, because its configuration has an error.

        Parameters
        ----------
        turnout : str
            Id of a turnout that was known before.

        Returns
        -------
        bool
            True also for one without a row if a row has no valid id, because it may be that row.
        """
        return turnout in self.faulty or ("" in self.faulty and turnout not in self.rows)

    def hash_of(self, turnout: str, unit_kind: str = "") -> str:
        """Hash of the configuration of one turnout.

        Parameters
        ----------
        turnout : str
            Id of the turnout.
        unit_kind : str
            "hammer", "passage" or "mismatch": only what such a unit uses; "": all of it.

        Returns
        -------
        str
            32 hexadecimal digits.
        """
        return self.variants[turnout].hashes[unit_kind]

    def turnout(self, turnout: str) -> TurnoutConfig:
        """The merged configuration of one turnout.

        Parameters
        ----------
        turnout : str
            Id of the turnout.

        Returns
        -------
        TurnoutConfig
            Its configuration, without the notes of the raw folder.

        Raises
        ------
        ConfigError
            For an unknown id, or one that was left out for an error.
        """
        if turnout in self.faulty:
            raise self.faulty[turnout][0]
        if turnout not in self.rows:
            place = Place(str(self.folder / "turnouts.tsv"), 1, 1)
            raise place.error(f"no turnout {turnout!r}", suggestion(turnout, self.rows, NO_TURNOUT))
        row, details = self.rows[turnout], {}
        for column in ("name", "line", "km", "lat_deg", "lon_deg", "external_id", "id_scheme"):
            if column in row.values:
                details[FIELD_OF_COLUMN.get(column, column)] = row.values[column]
        fields = self.variants[turnout].turnout_fields
        return TurnoutConfig(
            id=row.id, layout=row.values["layout"], raw=row.raw, folder=self.folder, **details, **fields
        )


def sources(configuration: Configuration, turnout: str) -> Iterator[tuple[str, Any, str]]:
    """The source of every value of a turnout, defaults included.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    turnout : str
        Id of the turnout.

    Yields
    ------
    tuple of (str, any, str)
        Key, value, and its file and line or "default".
    """
    row = configuration.rows[turnout]
    for column, value in row.values.items():
        yield column, value, _place_text(row.place(column))
    tree = configuration.variants[turnout].tree
    written = dict(leaves(tree))
    for key, leaf in written.items():
        if not key.startswith("settings."):
            yield key, leaf.value, _place_text(leaf.place)
    for section, settings in configuration.turnout(turnout).settings.items():
        for name, value in asdict(settings).items():
            key = f"settings.{section}.{name}"
            yield key, value, _place_text(written[key].place) if key in written else "default"


def _place_text(place: Place) -> str:
    return f"{place.path}, line {place.line}"
