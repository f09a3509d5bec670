"""Merged configuration of one turnout, as a tree and as records, with its hashes.

A ``Variant`` is a layout changed by the technical columns of a row; several turnouts may share it.
"""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

from turnout.config.document import Branch, Leaf, Place, merge_branches, plain_values
from turnout.config.frozen_mapping import Frozen
from turnout.config.settings import parts
from turnout.config.settings_schema import fill_settings
from turnout.config.turnout import HammerConfig, PassageConfig, Section
from turnout.config.turnouts_table import Row
from turnout.records import MID_SPAN, RawChannel, RawDescription

# What each kind of unit uses of a turnout's configuration: sections of the settings, branches of the layout.
USED_BY_UNIT = {
    "hammer": (("receptance", "identify"), ("sections", "hammer")),
    "passage": (("passage",), ("sections", "passages")),
    "mismatch": (("mismatch", "passage", "receptance"), ("sections", "hammer", "passages")),
    "change": (("mismatch", "passage", "receptance"), ("sections", "hammer", "passages")),
}


def digest(value: Any) -> str:
    """32 hex characters that change when ``value`` (dicts, tuples, numbers, text) does.

    Parameters
    ----------
    value : any
        Dictionaries, lists, tuples, numbers and text.

    Returns
    -------
    str
        The first half of a sha256; the order of keys does not change it.
    """
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:32]


def hashes(values: dict) -> dict[str, str]:
    """Hashes of a merged configuration. Defaults count like written values.

    Parameters
    ----------
    values : dict
        The merged tree as plain values.

    Returns
    -------
    dict of str to str
        The hash of all of it under "", and of what each kind of unit uses.
    """
    branches = {k: v for k, v in values.items() if k not in ("description", "settings")}
    # neither the division of a run into shards nor who gets a message changes a result
    filled_settings = {n: asdict(s) for n, s in settings(values["settings"]).items() if n not in ("alerts", "fleet")}
    result = {"": digest([filled_settings, branches])}
    for unit_kind, (groups, names) in USED_BY_UNIT.items():
        result[unit_kind] = digest([{p: filled_settings.get(p) for p in groups}, {b: branches.get(b) for b in names}])
    return result


def settings(values: dict) -> Frozen:
    """Settings of every section.

    Parameters
    ----------
    values : dict
        Section -> setting -> value, where it is not the default.

    Returns
    -------
    Frozen
        Section -> instance of its settings class.
    """
    return Frozen({name: fill_settings(cls, values.get(name, {})) for name, cls in parts().items()})


def sections(values: dict) -> tuple[Section, ...]:
    """Sections in the order of the layout.

    Parameters
    ----------
    values : dict
        Label -> keys of the section.

    Returns
    -------
    tuple of Section
        One section per label.
    """
    keys = ("panel", "track", "position", "pad", "sleeper")
    return tuple(
        Section(label, **{k: section[k] for k in keys if section.get(k) is not None})
        for label, section in values.items()
    )


def hammer(tree: Branch) -> HammerConfig | None:
    """Configuration of the hammer tests: the branch ``hammer``, changed per section by the section's ``hammer``.

    Parameters
    ----------
    tree : Branch
        Merged layout.

    Returns
    -------
    HammerConfig or None
        The configuration; None if the layout has no hammer tests.
    """
    if "hammer" not in tree:
        return None
    descriptions: dict[str, RawDescription] = {}
    roles: dict[str, dict] = {"force": {}, "response": {}, "validation": {}}
    for label, section in tree["sections"].items():
        values = plain_values(
            merge_branches(tree["hammer"], section["hammer"]) if "hammer" in section else tree["hammer"]
        )
        position = float(section["position"].value)
        for role, names in roles.items():
            names[label] = values.get(role)
        required = (values["force"], values["response"])
        at_section = [name for name, channel in values["channels"].items() if not _is_at_mid_span(channel)]
        of_files = description(values, "hammer", dict.fromkeys(at_section, position))
        descriptions[label] = replace(of_files, required=required)
    roles_by_section = {role: Frozen(names) for role, names in roles.items()}
    return HammerConfig(plain_values(tree["hammer"])["files"], Frozen(descriptions), **roles_by_section)


def _is_at_mid_span(channel: dict) -> bool:
    """Whether the distance of a sensor from its section is half a bay of the track, which the layout does not know."""
    return "offset" not in channel and MID_SPAN in channel.get("mounting", "")


def passages(tree: Branch) -> PassageConfig | None:
    """Configuration of the passage recordings, with the section of every channel.

    Parameters
    ----------
    tree : Branch
        Merged layout.

    Returns
    -------
    PassageConfig or None
        The configuration; None if the layout has no passages.
    """
    if "passages" not in tree:
        return None
    values = plain_values(tree["passages"])
    sections = {name: channel["section"] for name, channel in values["channels"].items() if "section" in channel}
    positions = {name: float(tree["sections"][label]["position"].value) for name, label in sections.items()}
    return PassageConfig(values["files"], description(values, "passage", positions), Frozen(sections))


def description(values: dict, kind: str, positions: dict[str, float]) -> RawDescription:
    """Description of the raw files of one kind.

    Parameters
    ----------
    values : dict
        Branch ``hammer`` or ``passages`` as plain values.
    kind : str
        "hammer" or "passage".
    positions : dict of str to float
        Channel -> position of its section; the offset of the sensor is added. [m]

    Returns
    -------
    RawDescription
        What the readers check and convert by.
    """
    channels = []
    for name, channel in values["channels"].items():
        fields = {k: _as_float(k, v) for k, v in channel.items() if k not in ("offset", "section") and v is not None}
        has_position = channel["quantity"] != "force" and name in positions
        position = positions[name] + channel.get("offset", 0.0) if has_position else None
        channels.append(RawChannel(name=name, position=position, **fields))
    return RawDescription(
        channels=tuple(channels),
        kind=kind,
        format=values.get("format", "auto"),
        rate=_as_float("rate", values.get("rate")),
        n_records=values.get("records"),
        n_samples=values.get("samples"),
        time_zone=values.get("time_zone", "UTC"),
        checked_entries=tuple(filter(None, map(str.strip, values.get("checked_entries", "").split(";")))),
    )


def _as_float(name: str, value: Any) -> Any:
    """Physical values as float, even if written as integers."""
    return float(value) if name in ("rate", "sensitivity", "limit", "resolution") and value is not None else value


ROW_KEYS = {
    "hammer_rate_hz": ("hammer", "rate"),
    "hammer_format": ("hammer", "format"),
    "passage_rate_hz": ("passages", "rate"),
    "passage_format": ("passages", "format"),
}
SECTION_ROW_KEYS = {"pad_type": "pad", "sleeper_type": "sleeper"}


@dataclass(frozen=True)
class Variant:
    """A merged configuration that several turnouts may share."""

    tree: Branch

    @cached_property
    def values(self) -> dict:
        """The merged tree as plain values, without their places in files."""
        return plain_values(self.tree)

    @cached_property
    def hashes(self) -> dict[str, str]:
        """Hash of the whole configuration (key "") and of what each kind of unit uses."""
        return hashes(self.values)

    @cached_property
    def turnout_fields(self) -> dict:
        """Fields of ``TurnoutConfig`` that come from this configuration."""
        return {
            "sections": sections(self.values["sections"]),
            "hammer": hammer(self.tree),
            "passages": passages(self.tree),
            "settings": settings(self.values["settings"]),
            "config_hash": self.hashes[""],
            "hashes": Frozen({k: v for k, v in self.hashes.items() if k}),
        }


def with_row(layout: Branch, row: Row) -> Branch:
    """The layout, changed by the technical columns of a row.

    Parameters
    ----------
    layout : Branch
        Merged layout.
    row : Row
        Row of turnouts.tsv.

    Returns
    -------
    Branch
        A new tree; the layout itself if the row has no technical column.
    """
    changes = Branch(layout.place)
    for column, (group, key) in ROW_KEYS.items():
        if column in row.values and group in layout:
            _child(changes, group, row.place(column)).put(
                key, Leaf(row.values[column], row.place(column)), row.place(column)
            )
    for column, key in SECTION_ROW_KEYS.items():
        if column in row.values:
            for label in layout["sections"]:
                section = _child(_child(changes, "sections", row.place(column)), label, row.place(column))
                section.put(key, Leaf(row.values[column], row.place(column)), row.place(column))
    return merge_branches(layout, changes) if changes else layout


def _child(tree: Branch, name: str, place: Place) -> Branch:
    if name not in tree:
        tree.put(name, Branch(place), place)
    return tree[name]
