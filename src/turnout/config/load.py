"""Reading and checking of the whole configuration of a fleet."""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from turnout.config import merge
from turnout.config.acknowledgements import read_acknowledgements
from turnout.config.configuration import Configuration
from turnout.config.consistency import ToSi, check_consistency
from turnout.config.document import Branch, Place, load, merge_branches, plain_values
from turnout.config.events import read_events
from turnout.config.file_names import YAML_FILES, file_key
from turnout.config.frozen_mapping import Frozen
from turnout.config.layout_schema import layout_keys
from turnout.config.merge import ROW_KEYS, SECTION_ROW_KEYS, Variant, with_row
from turnout.config.schema import NO_TURNOUT, check, fit_to_schema, suggestion
from turnout.config.settings_schema import check_ranges, settings_keys
from turnout.config.turnout import TurnoutConfig
from turnout.config.turnouts_table import NO_PROJECT, Row, read_table
from turnout.errors import ConfigError, ConfigErrors

TABLES = ("turnouts.tsv", "events.csv", "acknowledgements.csv")

# Folder -> columns of turnouts.tsv with the names of the files there that a turnout uses
USERS_OF_FILES = {"layouts": ("layout",), "overrides": ("turnout",), "tracks": ("turnout", "layout")}


def load_configuration(
    folder: Path | str = "config",
    formats: Collection[str] | None = None,
    to_si: ToSi | None = None,
    tables: Mapping[str, Path] | None = None,
    leave_out: bool = False,
) -> Configuration:
    """Read and check config.yaml, turnouts.tsv, layouts/, overrides/, events.csv and acknowledgements.csv.

    Parameters
    ----------
    folder : Path or str
        Folder of the configuration.
    formats : collection of str or None
        Names of the readers; None: formats are not checked.
    to_si : callable or None
        Converts units, as ``turnout.units.to_si``; None: units of channels are not checked.
    tables : mapping of str to Path or None
        Name of a table -> file that is read in its place; errors name the table. None: those of the folder.
    leave_out : bool
        Leave out the turnouts with an error in their row, layout, override or events, as the nightly run does for the
        others' sake. ``faulty`` has their errors.

    Returns
    -------
    Configuration
        The configuration of the fleet, with warnings.

    Raises
    ------
    ConfigErrors
        With all errors: file, line, column, problem, remedy. With ``leave_out`` only if one concerns the whole fleet,
        or if no turnout is left.
    """
    if Path(folder).is_file():
        remedy = "Name the folder of the configuration, 'config' in a project"
        raise ConfigErrors([ConfigError(folder, "the folder", "it is a file", remedy)])
    if not Path(folder).is_dir():
        raise ConfigErrors([ConfigError(folder, "the folder", "there is no such folder", NO_PROJECT)])
    reading = _ConfigurationReader(Path(folder), formats, to_si)
    paths = {name: reading.folder / name for name in TABLES} | dict(tables or {})
    reading.check_extensions()
    settings = reading.document(reading.folder / "config.yaml", settings_keys())
    reading.errors += check_ranges(settings)
    rows, errors = read_table(paths["turnouts.tsv"], reading.name("turnouts.tsv"))
    reading.errors += errors
    reading.note_rows(errors)
    turnout_ids = None if errors else {row.id for row in rows}
    variants = reading.variants(rows, settings, are_all_rows_valid=not errors)
    events, errors, event_warnings = read_events(paths["events.csv"], reading.name("events.csv"), turnout_ids, variants)
    reading.errors += errors
    reading.note_rows(errors)
    if reading.errors and not (leave_out and reading.can_leave_out(rows)):
        raise ConfigErrors(list({str(e): e for e in reading.errors}.values()))
    faulty = reading.faulty
    name = "acknowledgements.csv"
    acknowledgements, warnings = read_acknowledgements(paths[name], reading.name(name), turnout_ids, variants)
    by_id = {row.id: row for row in rows if row.id not in faulty}
    base = merge.settings(plain_values(settings))
    return Configuration(
        reading.folder,
        base,
        Frozen(by_id),
        tuple(events),
        Frozen({turnout: variant for turnout, variant in variants.items() if turnout not in faulty}),
        tuple(acknowledgements),
        (*event_warnings, *warnings, *reading.unused),
        Frozen({turnout: tuple(errors) for turnout, errors in faulty.items()}),
    )


def load_layout(path: Path | str, formats: Collection[str] | None = None, to_si: ToSi | None = None) -> TurnoutConfig:
    """Configuration of one layout by itself, as of a turnout without further values; config.yaml is beside its folder.

    Parameters
    ----------
    path : path-like
        File of the layout, such as config/layouts/tommerup.yaml.
    formats : collection of str or None
        Names of the readers; None: formats are not checked.
    to_si : callable or None
        Converts units, as ``turnout.units.to_si``; None: units of channels are not checked.

    Returns
    -------
    TurnoutConfig
        Its id is the name of the layout, and it has no raw folder.

    Raises
    ------
    ConfigErrors
        With all errors of the layout and of config.yaml.
    ConfigError
        If there is no such file.
    """
    path = Path(path)
    if not path.is_file():
        raise ConfigError(path, "the path", "there is no such file", "Correct it")
    full_path = path.resolve()
    reading = _ConfigurationReader(full_path.parent.parent, formats, to_si)
    settings = reading.document(reading.folder / "config.yaml", settings_keys())
    reading.errors += check_ranges(settings)
    tree = reading.layout_of(full_path, settings)
    if reading.errors or tree is None:
        raise ConfigErrors(reading.errors)
    name = path.stem
    return TurnoutConfig(id=name, layout=name, raw="", folder=reading.folder, **Variant(tree).turnout_fields)


def errors_of_unused_layouts(
    configuration: Configuration, formats: Collection[str] | None = None, to_si: ToSi | None = None
) -> list[ConfigError]:
    """Errors of the layouts that no turnout uses.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    formats : collection of str or None
        Names of the readers; None: formats are not checked.
    to_si : callable or None
        Converts units, as ``turnout.units.to_si``; None: units of channels are not checked.

    Returns
    -------
    list of ConfigError
        Errors in the order of the file names.
    """
    reading = _ConfigurationReader(configuration.folder, formats, to_si)
    settings = reading.document(reading.folder / "config.yaml", settings_keys())
    used = {row.values["layout"] for row in configuration.rows.values()}
    for path in sorted((reading.folder / "layouts").glob(YAML_FILES)):
        if path.stem not in used:
            reading.layout_of(path, settings)
    return reading.errors


class _ConfigurationReader:
    """Reads the files of the configuration and collects all errors."""

    def __init__(self, folder: Path, formats: Collection[str] | None, to_si: ToSi | None) -> None:
        self.folder, self.formats, self.to_si = folder, formats, to_si
        self.errors: list[ConfigError] = []
        self.faulty: dict[str, list[ConfigError]] = {}  # by turnout; of rows without a valid id under ""
        self.unused: list[ConfigError] = []  # of files that no turnout uses
        self.layouts: dict[str, Branch | None] = {}
        self.layout_errors: dict[str, list[ConfigError]] = {}
        self.shared: dict[tuple, Variant] = {}
        self.shared_errors: dict[tuple, list[ConfigError]] = {}

    def name(self, *parts: str) -> str:
        """Name of a file in errors: its path below the configuration folder, with the name of that folder in front."""
        return "/".join((self.folder.name, *parts))

    def note_rows(self, errors: Iterable[ConfigError]) -> None:
        """Note which turnouts the errors in rows of a table concern."""
        for error in errors:
            for turnout in error.turnouts:
                self.faulty.setdefault(turnout, []).append(error)

    def can_leave_out(self, rows: Iterable[Row]) -> bool:
        """Whether every error concerns single turnouts or unused files, and any turnout is left."""
        ids_of_errors = {id(error) for errors in (self.unused, *self.faulty.values()) for error in errors}
        has_rest = any(row.id not in self.faulty for row in rows)
        return has_rest and all(id(error) in ids_of_errors for error in self.errors)

    def note_misnamed(self, rows: Iterable[Row]) -> None:
        """Note which turnouts the errors in the names of layouts, overrides and tracks concern.

        A layout or override of no turnout is unused. A track of no turnout may be what the files of others extend, so
        that its error concerns the whole fleet.
        """
        for error in self.errors:
            path = Path(error.path)
            folder, key = path.parent.name, file_key(path.stem)
            if folder not in USERS_OF_FILES or path.parent.parent.name != self.folder.name:
                continue
            concerned = [row.id for row in rows if key in (file_key(row.values[of]) for of in USERS_OF_FILES[folder])]
            for turnout in concerned:
                self.faulty.setdefault(turnout, []).append(error)
            if not concerned and folder != "tracks":
                self.unused.append(error)

    def check_extensions(self) -> None:
        """Add an error for every YAML file that is not read for its name, or that is another one elsewhere."""
        for parts in ((), ("layouts",), ("overrides",), ("tracks",), ("vehicles",)):
            names: dict[str, str] = {}
            for path in sorted(self.folder.joinpath(*parts).glob("[!.]*")):
                if path.suffix.lower() in (".yml", ".yaml") and path.suffix != ".yaml":
                    place = Place(self.name(*parts, path.name), 1, 1)
                    remedy = f"Rename it to {path.stem}.yaml, or remove it"
                    self.errors.append(place.error(f"it ends in {path.suffix} and would not be read", remedy))
                elif path.suffix == ".yaml" and (same := names.setdefault(file_key(path.name), path.name)) != path.name:
                    problem = f"{path.name!r} and {same!r} are one file on some file systems"
                    self.errors.append(Place(self.name(*parts, path.name), 1, 1).error(problem, "Rename one of them"))

    def document(self, path: Path, spec: dict, whole: bool = False) -> Branch:
        """Tree of a checked YAML file; empty if the file is absent or, after adding its errors, invalid."""
        name = self.name(path.relative_to(self.folder).as_posix())
        empty = Branch(Place(name, 1, 1))
        if not os.path.lexists(path):
            return empty
        try:
            tree = load(path, name)
        except ConfigError as error:
            self.errors.append(error)
            return empty
        fit_to_schema(spec, tree)
        if problems := list(check(spec, tree, whole)):
            self.errors += problems
            return empty
        return tree

    def layout(self, row: Row, settings: Branch) -> Branch | None:
        """Layout of a row, merged onto the settings of config.yaml; None if it cannot be used."""
        name = row.values["layout"]
        path = self.folder / "layouts" / f"{name}.yaml"
        if name not in self.layouts:
            before = len(self.errors)
            self.layouts[name] = self.layout_of(path, settings) if os.path.lexists(path) else None
            self.layout_errors[name] = self.errors[before:]
        if self.layouts[name] is None and not os.path.lexists(path):
            self._add_unknown_layout(name, row)
        return self.layouts[name]

    def layout_of(self, path: Path, settings: Branch) -> Branch | None:
        """Layout of a file, merged onto the settings of config.yaml; None if it cannot be used."""
        tree = self.document(path, layout_keys(), whole=True)
        if not tree:
            return None
        base = Branch(settings.place)
        base.put("settings", settings, settings.place)
        tree = merge_branches(base, tree)
        return None if self._has_errors(tree) else tree

    def _add_unknown_layout(self, name: str, row: Row) -> None:
        nothing_to_choose = f"There are no layouts yet: write layouts/{name}.yaml"
        names = [p.stem for p in (self.folder / "layouts").glob(YAML_FILES)]
        self.errors.append(row.place("layout").error(f"no layout {name!r}", suggestion(name, names, nothing_to_choose)))

    def _has_errors(self, tree: Branch) -> bool:
        errors = [*check_consistency(tree, self.to_si), *self._format_errors(tree), *check_ranges(tree["settings"])]
        self.errors += errors
        return bool(errors)

    def _format_errors(self, tree: Branch) -> Iterator[ConfigError]:
        for branch in ("hammer", "passages"):
            leaf = tree.get(branch, {}).get("format")
            if leaf and self.formats is not None and leaf.value not in (allowed := ("auto", *self.formats)):
                yield leaf.place.error(f"format is {leaf.value!r}", suggestion(leaf.value, allowed))

    def variants(self, rows: list[Row], settings: Branch, are_all_rows_valid: bool) -> dict[str, Variant]:
        """Merged configuration of every row; rows with the same technical columns share one.

        An override of a turnout that is not in ``rows`` is an error, unless it may be that of a row with an error.
        """
        overrides = {p.stem: p for p in sorted((self.folder / "overrides").glob(YAML_FILES))}
        merged = {}
        self.note_misnamed(rows)
        for row in rows:
            before = len(self.errors)
            layout = self.layout(row, settings)
            override = overrides.pop(row.id, None)
            if layout is not None:
                merged[row.id] = self._variant(row, layout, override)
            shared = [*self.layout_errors[row.values["layout"]], *self.shared_errors.get(_variant_key(row), ())]
            if errors := [*self.errors[before:], *shared]:
                self.faulty.setdefault(row.id, []).extend(errors)
        for stem, path in overrides.items() if are_all_rows_valid else ():
            place = Place(self.name("overrides", path.name), 1, 1)
            remedy = suggestion(stem, [row.id for row in rows], NO_TURNOUT)
            self.unused.append(place.error(f"an override without a turnout {stem!r}", remedy))
            self.errors.append(self.unused[-1])
        return merged

    def _variant(self, row: Row, layout: Branch, override: Path | None) -> Variant:
        key = _variant_key(row)
        if key not in self.shared:
            tree, start = with_row(layout, row), len(self.errors)
            if tree is not layout:
                self._has_errors(tree)
            self.shared[key], self.shared_errors[key] = Variant(tree), self.errors[start:]
        if override is None:
            return self.shared[key]
        tree = merge_branches(self.shared[key].tree, self.document(override, layout_keys()))
        before = len(self.errors)
        self.errors += check(layout_keys(merged=True), tree)
        if len(self.errors) == before:
            self._has_errors(tree)
        return Variant(tree)


def _variant_key(row: Row) -> tuple:
    """The layout and the technical columns of a row: rows with the same share one merged configuration."""
    return (row.values["layout"], *(row.values.get(c) for c in (*ROW_KEYS, *SECTION_ROW_KEYS)))
