"""Parameter files of the simulation: YAML files in which every number has a unit and a source."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from turnout.config.document import as_config_errors, describe_place
from turnout.errors import ConfigError, SimulationError

# Unit: (SI unit, factor)
UNITS = {
    "-": ("-", 1.0),
    "%": ("-", 0.01),
    "dB": ("dB", 1.0),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "µm": ("m", 1e-6),
    "kg": ("kg", 1.0),
    "t": ("kg", 1e3),
    "kg/m": ("kg/m", 1.0),
    "kg m²": ("kg m²", 1.0),
    "t m²": ("kg m²", 1e3),
    "kg/m³": ("kg/m³", 1.0),
    "Pa": ("Pa", 1.0),
    "GPa": ("Pa", 1e9),
    "m⁴": ("m⁴", 1.0),
    "cm⁴": ("m⁴", 1e-8),
    "m²": ("m²", 1.0),
    "cm²": ("m²", 1e-4),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "N/m": ("N/m", 1.0),
    "MN/m": ("N/m", 1e6),
    "N s/m": ("N s/m", 1.0),
    "kN s/m": ("N s/m", 1e3),
    "N s/m²": ("N s/m²", 1.0),
    "N/m^1.5": ("N/m^1.5", 1.0),
    "GN/m^1.5": ("N/m^1.5", 1e9),
    "s/m": ("s/m", 1.0),
    "N/m per N": ("N/m per N", 1.0),
    "m/s²": ("m/s²", 1.0),
    "m/s": ("m/s", 1.0),
    "km/h": ("m/s", 1.0 / 3.6),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "1/s": ("1/s", 1.0),
    "Hz": ("Hz", 1.0),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "1/K": ("1/K", 1.0),
    "°C": ("°C", 1.0),
}
KEYS = {"value", "unit", "source", "prior", "note"}


@dataclass(frozen=True)
class Number:
    """A number in its SI unit with its source. ``prior`` is its relative standard deviation, None if measured."""

    value: float
    unit: str
    source: str
    prior: float | None = None

    def __float__(self):
        return self.value


class ParameterSet(Mapping):
    """A mapping of a parameter file that knows its place in the file, so that errors can name it.

    >>> node = ParameterSet({"mass": Number(1500.0, "kg", "data sheet")}, "car.yaml", "bogie")
    >>> node.number("mass", "kg"), node.number("length", "m", default=2.5)
    (1500.0, 2.5)
    """

    def __init__(self, content, path, place):
        self.content, self.path, self.place = content, str(path), place

    def error(self, key, problem, remedy, entry=""):
        """A ``ConfigError`` at ``key`` of this mapping, or at the mapping itself if ``key`` is None.

        Its line is that of ``entry`` below that place.
        """
        suffix = f"[{key}]" if isinstance(key, int) else f".{key}"
        place = f"{self.place}{suffix if key is not None else ''}".lstrip(".")
        return ConfigError(self.path, describe_place(self.path, place, entry), problem, remedy)

    def __getitem__(self, key):
        if key not in self.content:
            raise self.error(None, f"the key {key!r} is missing", f"Give {key!r} there")
        return self.content[key]

    def __iter__(self):
        return iter(self.content)

    def __contains__(self, key):
        return key in self.content

    def __len__(self):
        return len(self.content)

    def get(self, key, default=None):
        """Value of ``key``, or ``default`` if it is absent."""
        return self.content.get(key, default)

    def number(self, key, unit, default=None):
        """Value of ``key`` in the SI unit ``unit``; ``default`` if it is absent and a default exists."""
        if key not in self.content and default is not None:
            return default
        entry = self[key]
        if not isinstance(entry, Number):
            raise self.error(key, f"{_describe_value(entry)} has no unit and source", "Write value, unit and source")
        if entry.unit != unit:
            raise self.error(key, f"the unit {entry.unit!r} is not one of {unit!r}", "Correct the unit")
        return entry.value

    def count(self, key, default, minimum=1):
        """Whole number at ``key``, at least ``minimum``; ``default`` if it is absent."""
        value = self.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < minimum:
            remedy = f"Write a whole number of at least {minimum}, without unit and source"
            raise self.error(key, f"{_describe_value(value)} is no such number", remedy)
        return value

    def mapping_at(self, key):
        """The mapping at ``key``."""
        entry = self[key]
        if not isinstance(entry, ParameterSet):
            raise self.error(
                key, f"{_describe_value(entry)} instead of names with values", "Write 'name: value' lines below it"
            )
        return entry

    def optional_mapping_at(self, key):
        """The mapping at ``key``, an empty one if it is absent."""
        return ParameterSet({}, self.path, self.place) if self.get(key) is None else self.mapping_at(key)

    def list_at(self, key):
        """The list at ``key`` as a ParameterSet with the keys 0, 1, 2 ...; an empty one if it is absent."""
        entries = [] if self.get(key) is None else self[key]
        if not isinstance(entries, list):
            raise self.error(
                key, f"{_describe_value(entries)} instead of a list", "Write each entry with a dash before it"
            )
        return ParameterSet(dict(enumerate(entries)), self.path, f"{self.place}.{key}".lstrip("."))

    def mappings_at(self, key):
        """The mappings listed at ``key``."""
        entries = self.list_at(key)
        return [entries.mapping_at(k) for k in entries]

    def build(self, factory, *values, **named):
        """``factory(*values, **named)``; its SimulationError becomes a ``ConfigError`` that names this place."""
        try:
            return factory(*values, **named)
        except SimulationError as error:
            raise self.error(None, str(error).rstrip("."), "Correct the value") from None

    def allow_only(self, *allowed):
        """Raise ConfigError for a key that is not in ``allowed``; return the mapping itself."""
        for key in self.content:
            if key not in allowed:
                raise self.error(None, f"unknown key {key!r}", f"Use one of {', '.join(sorted(allowed))}", key)
        return self

    def numbers(self):
        """(place, Number) of every number in this mapping and below."""
        for key, value in self.content.items():
            yield from _numbers(value, f"{self.place}.{key}" if self.place else str(key))


def _describe_value(value):
    """An entry as errors describe it."""
    if isinstance(value, Number):
        return f"{value.value:g} {value.unit}"
    return "a mapping" if isinstance(value, ParameterSet) else repr(value)


def _numbers(value, place):
    if isinstance(value, Number):
        yield place, value
    elif isinstance(value, ParameterSet):
        yield from value.numbers()
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from _numbers(item, f"{place}[{k}]")


def read_parameters(path):
    """The parameter set in a YAML file.

    A number is ``{value: 120, unit: MN/m, source: ...}``. ``source`` is text or a key of the file's ``sources``
    table. A source that begins with "estimate" requires a ``prior``: the relative standard deviation of the value.
    """
    path = Path(path)
    try:
        with as_config_errors(path, "the file"):
            content = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else "the file"
        raise ConfigError(path, place, str(error.problem), "Correct the YAML") from None
    if not isinstance(content, dict):
        raise ConfigError(path, "the file", "is not a mapping", "Write 'key: value' lines")
    if not isinstance(sources := content.pop("sources", None) or {}, dict):
        raise ConfigError(
            path, describe_place(path, "sources"), "is not a mapping", "Write 'key: source' lines below it"
        )
    with as_config_errors(path, "the file"):
        return _parse(content, path, "", sources)


def _parse(value, path, place, sources):
    if isinstance(value, list):
        return [_parse(item, path, f"{place}[{k}]", sources) for k, item in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if "value" in value:
        return _parse_number(value, path, place, sources)
    return ParameterSet(
        {k: _parse(v, path, f"{place}.{k}" if place else str(k), sources) for k, v in value.items()}, path, place
    )


def _parse_number(entry, path, place, sources):
    for key in ("unit", "source"):
        if isinstance(entry.get(key), (list, dict, type(None))):
            raise ConfigError(path, describe_place(path, place), f"a number without {key}", f"Give its {key}")
    if unknown := set(entry) - KEYS:
        raise ConfigError(
            path, describe_place(path, place), f"unknown key {min(unknown)!r}", f"Use {', '.join(sorted(KEYS))}"
        )
    if entry["unit"] not in UNITS:
        raise ConfigError(
            path, describe_place(path, place), f"unknown unit {entry['unit']!r}", f"Use one of {', '.join(UNITS)}"
        )
    source = sources.get(entry["source"], entry["source"])
    prior = entry.get("prior")
    spread = None if prior is None else _finite(prior, path, place)
    if (spread is None and str(source).startswith("estimate")) or (spread is not None and spread <= 0.0):
        problem = "an estimate without a prior" if spread is None else f"a prior of {prior}"
        remedy = "Give its relative standard deviation, above 0, as prior"
        raise ConfigError(path, describe_place(path, place), problem, remedy)
    unit, factor = UNITS[entry["unit"]]
    return Number(factor * _finite(entry["value"], path, place), unit, str(source), spread)


def _finite(value, path, place) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ConfigError(path, describe_place(path, place), f"{value!r} is not a number", "Write a number") from None
    if not isfinite(number):
        raise ConfigError(path, describe_place(path, place), f"{value!r} is not finite", "Write a number")
    return number
