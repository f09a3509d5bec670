"""Consistency checks over several keys of a layout: references to names, units, file patterns, limits."""

from collections.abc import Callable, Iterator
from typing import Any
from zoneinfo import available_timezones

from turnout.config.document import Branch, merge_branches
from turnout.config.file_names import file_key, name_problem
from turnout.config.filename_pattern import compile_pattern
from turnout.config.schema import suggestion
from turnout.config.settings_schema import settings_keys
from turnout.errors import ConfigError
from turnout.number_text import number_text
from turnout.units import IGNORED, SI, volts_per_unit

# (quantity, unit, sensitivity, sensitivity_unit) -> conversion, as turnout.units.to_si
ToSi = Callable[[str, str, float | None, str], Any]


def check_consistency(tree: Branch, to_si: ToSi | None = None) -> Iterator[ConfigError]:
    """Check what several keys of a layout state together. Its single keys must be valid.

    Parameters
    ----------
    tree : Branch
        Merged layout.
    to_si : callable or None
        Converts units, as ``turnout.units.to_si``; None: units are not checked.

    Yields
    ------
    ConfigError
        Every error, at the value to correct.
    """
    labels = tuple(tree["sections"])
    yield from _label_errors(tree["sections"])
    if "hammer" in tree:
        yield from _pattern_errors(tree["hammer"], "hammer", labels)
        min_peak_force = _min_peak_force(tree)
        yield from _hammer_errors(tree["hammer"], to_si, min_peak_force)
        for section in tree["sections"].values():
            if "hammer" in section:
                yield from _hammer_errors(merge_branches(tree["hammer"], section["hammer"]), to_si, min_peak_force)
    if "passages" in tree:
        yield from _pattern_errors(tree["passages"], "passages", labels)
        yield from _channel_errors(tree["passages"], to_si)
        for channel in tree["passages"]["channels"].values():
            leaf = channel.get("section")
            if leaf is None and channel["quantity"].value != IGNORED:
                yield channel.place.error("'section' is missing", f"Add 'section:', one of {', '.join(labels)}")
            elif leaf is not None and leaf.value not in labels:
                yield leaf.place.error(f"no section {leaf.value!r}", suggestion(leaf.value, labels))


def _label_errors(sections: Branch) -> Iterator[ConfigError]:
    """Errors of sections whose labels are no names of files, or the same name on some file systems."""
    labels: dict[str, str] = {}
    for label in sections:
        place = sections.key_places.get(label, sections.place)
        if problem := name_problem(label):
            yield place.error(f"section {label!r}: {problem[0]}", problem[1])
        elif (same := labels.setdefault(file_key(label), label)) != label:
            problem_text = f"sections {same!r} and {label!r} differ only in capitals: on some file systems one file"
            yield place.error(problem_text, "Give it another label")


# Quantity of the channel of each role: the receptance is computed from an acceleration.
ROLES = {"force": "force", "response": "acceleration", "validation": "acceleration"}


def _hammer_errors(tree: Branch, to_si: ToSi | None, min_peak_force: float) -> Iterator[ConfigError]:
    channels = tree["channels"]
    roles: dict[str, str] = {}
    for role, quantity in ROLES.items():
        leaf = tree.get(role)
        if leaf is None or leaf.value is None:
            continue
        if leaf.value not in channels:
            yield leaf.place.error(f"{role} is {leaf.value!r}, no channel", suggestion(leaf.value, channels))
        elif (measured := channels[leaf.value]["quantity"].value) != quantity:
            detail = f"{role} is {leaf.value!r}, which measures {measured}"
            yield leaf.place.error(detail, f"Name a channel of the quantity {quantity}")
        elif (other := roles.setdefault(leaf.value, role)) != role:
            yield leaf.place.error(f"{role} is {leaf.value!r}, as {other} is", "Name another channel, or null")
        elif role == "force" and (limit := _value(channels[leaf.value], "limit")) and limit <= min_peak_force:
            detail = (
                f"limit is {limit} N for the hammer's force, and receptance.minimum_peak_force is {min_peak_force} N"
            )
            remedy = "Write the limit in N, or a lower minimum_peak_force where the hammer is a small one"
            yield channels[leaf.value]["limit"].place.error(f"{detail}: no impact could count", remedy)
    yield from _channel_errors(tree, to_si)


def _channel_errors(tree: Branch, to_si: ToSi | None) -> Iterator[ConfigError]:
    if zone := tree.get("time_zone"):
        if zone.value not in available_timezones():
            yield zone.place.error(f"time_zone is {zone.value!r}", "Write an IANA name such as Europe/Copenhagen")
    sources: dict[str | int, str] = {}
    for name, channel in tree["channels"].items():
        if to_si:
            yield from _unit_errors(name, channel, to_si)
        yield from _range_errors(channel)
        limit, step = _value(channel, "limit"), _value(channel, "resolution")
        if limit and step and step >= limit:
            problem = f"resolution is {step}, and limit is {limit}"
            yield channel["resolution"].place.error(
                problem, "Write one step of the converter, in the unit of the limit"
            )
        source = channel["source"]
        if isinstance(source.value, int) and source.value < 0:
            yield source.place.error(f"source is {source.value}", "Write a name, or a number counted from 0")
        if source.value in sources:
            problem = f"channel {name} reads {source.value!r}, as {sources[source.value]} does"
            yield source.place.error(problem, "Give each channel its own source")
        sources[source.value] = name


# Ranges of sensors in the SI unit of their quantity: from one step of the most sensitive one to the largest range. They
# catch a prefix too many and a slipped decimal point, of which the other checks see nothing.
SENSOR_RANGES = {
    "force": (1e-3, 1e7),  # N, of a small hammer and of a press
    "acceleration": (1e-6, 2e6),  # m/s², of a seismometer and of a shock sensor
    "velocity": (1e-9, 1e3),  # m/s, of a geophone and of a laser
    "displacement": (1e-10, 1e2),  # m, of a capacitive sensor and of a rope
    "strain": (1e-10, 1.0),  # m/m
}
# Sensitivities in V per SI unit: of a bridge without amplifier, and of the most sensitive sensors.
SENSITIVITIES = {
    "force": (1e-9, 10.0),
    "acceleration": (1e-7, 100.0),
    "velocity": (1e-3, 1e6),
    "displacement": (1e-2, 1e8),
    "strain": (1e-2, 1e8),
}


def _range_errors(channel: Branch) -> Iterator[ConfigError]:
    """Errors of a limit, a resolution and a sensitivity that no sensor of the quantity has."""
    quantity = channel["quantity"].value
    low, high = SENSOR_RANGES.get(quantity, (0.0, float("inf")))
    for key in ("limit", "resolution"):
        value = _value(channel, key)
        if value is not None and (value > high or (key == "limit" and value < low)):
            least = "above 0 and up" if key == "resolution" else f"from {number_text(low)}"
            remedy = f"No sensor of {quantity} has it: write a number {least} to {number_text(high)} {SI[quantity]}"
            yield channel[key].place.error(f"{key} is {number_text(value)} {SI[quantity]}", remedy)
    sensitivity, unit = _value(channel, "sensitivity"), _value(channel, "sensitivity_unit") or ""
    if not sensitivity or quantity not in SENSITIVITIES:
        return
    ratio, (low, high) = volts_per_unit(quantity, sensitivity, unit), SENSITIVITIES[quantity]
    if ratio is not None and not low <= ratio <= high:
        problem = f"sensitivity is {sensitivity:g} {unit}, which is {ratio:.3g} V per {SI[quantity]}"
        remedy = f"No sensor of {quantity} has it: correct the number, or the prefix in sensitivity_unit (mV, V)"
        yield channel["sensitivity"].place.error(problem, remedy)


def _value(channel: Branch, key: str) -> Any:
    return channel[key].value if key in channel else None


def _min_peak_force(tree: Branch) -> float:
    """The setting receptance.minimum_peak_force, else its default [N]."""
    written = tree.get("settings", {}).get("receptance", {}).get("minimum_peak_force")
    return written.value if written else settings_keys()["receptance"].spec["minimum_peak_force"].default


def _unit_errors(name: str, channel: Branch, to_si: ToSi) -> Iterator[ConfigError]:
    values = {k: channel[k].value for k in ("unit", "sensitivity", "sensitivity_unit") if k in channel}
    if values.get("unit") is None:
        return
    try:
        unit = values["unit"].removesuffix("!")  # a unit that overrules the file
        to_si(channel["quantity"].value, unit, values.get("sensitivity"), values.get("sensitivity_unit", ""))
    except ValueError as error:
        problem = f"unit {values['unit']!r} for the {channel['quantity'].value} of channel {name}: {error}"
        yield channel["unit"].place.error(problem, "Correct unit, sensitivity or sensitivity_unit")


def _pattern_errors(tree: Branch, branch: str, labels: tuple[str, ...]) -> Iterator[ConfigError]:
    leaf = tree["files"]
    try:
        compile_pattern(leaf.value, branch, labels)
    except ValueError as error:
        example = "hammer/{campaign}/{section}_{test}.{ext}" if branch == "hammer" else "passages/{time}.{ext}"
        yield leaf.place.error(f"files is {leaf.value!r}: {error}", f"Write a pattern like {example}")
