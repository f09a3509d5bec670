"""Draft of a layout from the contents of raw files, with a comment at everything that a person must decide."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from turnout.config.layout_schema import QUANTITIES
from turnout.config.schema import LETTERS
from turnout.errors import ConfigError
from turnout.readers.directions import opposite_directions
from turnout.records import RawChannel
from turnout.stages.file_contents import ChannelContents, FileContents
from turnout.units import SI, conversion

DECIDE = "# DECIDE:"  # marks what the files do not state
TEST_NAME = re.compile(rf"([{LETTERS}][{LETTERS}0-9-]*)_([A-Za-z0-9]+)")
PANELS = {"OT": "open track", "SP": "switch", "CLP": "closure", "CP": "crossing", "AS": "after the crossing"}
QUANTITY_OF_ROLE = {"force": "force", "response": "acceleration"}
MAX_STATED = 40  # characters of a direction that the file states
MOUNTING = {"hammer": ("hammer", "rail head at sleeper"), "passages": ("rail web", "rail web")}


def layout_draft(contents: Sequence[FileContents]) -> str:
    """Text of a layout that fits the given files as far as these state it.

    Parameters
    ----------
    contents : sequence of FileContents
        Files of hammer tests, of passages, or of both.

    Returns
    -------
    str
        YAML. Lines that a person must decide contain ``DECIDE``.

    Raises
    ------
    ConfigError
        If no file holds channels, or files of one kind have different channels.
    """
    hammer = [c for c in contents if c.channels and c.with_role("force")]
    passages = [c for c in contents if c.channels and not c.with_role("force") and c.with_role("response")]
    if not hammer and not passages:
        problem = "no channel in these files may be a force or a vibration"
        raise ConfigError(
            contents[0].path, "--from", problem, "Name recordings; `turnout inspect` shows what is in them"
        )
    for group in (hammer, passages):
        _check_same_channels(group)
    labels = _labels(hammer) or ["S1"]
    lines = [
        f"# Draft from {', '.join(Path(c.path).name for c in contents[:3])}{' and more' if len(contents) > 3 else ''}.",
        f"# Lines with {DECIDE[2:]} hold what the files do not state. `turnout check` lists those that are left.",
        "description: Draft  # what this layout is, for people",
        "",
        "sections:  # in the order of the track",
        *_section_lines(labels),
    ]
    for branch, group in (("hammer", hammer), ("passages", passages)):
        if group:
            lines += ["", *_branch_lines(branch, group, labels)]
    return "\n".join(lines) + "\n"


def decisions(draft: str) -> list[str]:
    """What a person must decide in a draft.

    Parameters
    ----------
    draft : str
        Text of the layout.

    Returns
    -------
    list of str
        "line 7: ..." each.
    """
    return [
        f"line {k}: {line.split(DECIDE)[1].strip()}" for k, line in enumerate(draft.splitlines(), 1) if DECIDE in line
    ]


def _check_same_channels(group: Sequence[FileContents]) -> None:
    for other in group[1:]:
        if other.channel_names != group[0].channel_names:
            problem = (
                f"its channels are {', '.join(other.channel_names)}, those of {Path(group[0].path).name} "
                f"{', '.join(group[0].channel_names)}"
            )
            raise ConfigError(other.path, "--from", problem, "Make a layout from files of the same logger and wiring")


def _labels(hammer: Sequence[FileContents]) -> list[str]:
    """Labels of sections that the file names begin with."""
    labels = [match[1] for c in hammer if (match := TEST_NAME.fullmatch(Path(c.path).stem))]
    return list(dict.fromkeys(labels))


def _section_lines(labels: Sequence[str]) -> Iterator[str]:
    panels = ", ".join(f"{name} {meaning}" for name, meaning in PANELS.items())
    for k, label in enumerate(labels):
        panel = next((p for p in PANELS if label.startswith(p)), "CP" if re.match(r"A\d", label) else "OT")
        yield (
            f"  {label}: {{panel: {panel}, track: main, position: {float(k)}}}  {DECIDE} panel ({panels}), "
            "track, position [m] from the switch toe"
        )


def _branch_lines(branch: str, group: Sequence[FileContents], labels: Sequence[str]) -> Iterator[str]:
    first = group[0]
    is_hammer = branch == "hammer"
    named = _labels(group) if is_hammer else []
    pattern = '"hammer/{campaign}/{section}_{test}.{ext}"' if is_hammer else '"passages/{time}.{ext}"'
    if is_hammer:
        how = "below the turnout's raw folder; campaign is YYYY-MM-DD"
        how += (
            "" if named else f"  {DECIDE} file names, such as hammer/2026-05-13/{labels[0]}_1{Path(first.path).suffix}"
        )
    else:
        how = "below the turnout's raw folder; time is YYYYMMDDTHHMMSSZ"
    yield f"{branch}:"
    yield f"  files: {pattern}  # {how}"
    yield "  format: auto  # by the file itself"
    rates = {c.rate.value for c in group}
    if len(rates) == 1 and first.rate.value is not None and not any(c.rate.problem for c in group):
        yield f"  rate: {first.rate.value:.12g}  # Hz; {'; '.join(first.rate.statements)}"
    else:
        yield f"  rate: null  {DECIDE} samples per second [Hz]: the files do not state one rate"
    counts, samples = {c.n_records for c in group}, {n for c in group for n in c.n_samples}
    if any(len(c.events) > c.n_records for c in group):  # the logger runs on: a record is as long as the test
        counts, samples = set(), set()
    if is_hammer:
        yield f"  records: {counts.pop() if len(counts) == 1 else 'null'}  # in one file; null: any number"
        yield f"  samples: {samples.pop() if len(samples) == 1 else 'null'}  # per record; null: any number"
    yield f"  time_zone: UTC  {_zone_comment(first)}"
    unexplained = dict(entry for c in group for entry in c.unexplained)
    if unexplained:
        values = " ".join(", ".join(f"{name} is {text}" for name, text in unexplained.items()).split())
        listed = json.dumps("; ".join(unexplained), ensure_ascii=False)
        yield f"  # checked_entries: {listed}  {DECIDE} {values}: name those that state no rate, scale or unit"
    names = _channel_names(first.channels)
    if is_hammer:
        forces, responses = first.with_role("force"), first.with_role("response")
        if not responses:
            raise ConfigError(first.path, "--from", "it has a force and no vibration", "Name files with a response")
        for role, found in (("force", forces), ("response", responses)):
            choice = " or ".join(names[id(c)] for c in found)
            comment = found[0].role.why + (
                f"  {DECIDE} which channel is the {role}: {choice}" if len(found) > 1 else ""
            )
            yield f"  {role}: {names[id(found[0])]}  # {comment}"
        yield "  validation: null  # a second response, only compared with"
    yield "  channels:"
    for index, channel in enumerate(first.channels):
        yield from _channel_lines(branch, names[id(channel)], index, channel, first, labels)


def _zone_comment(contents: FileContents) -> str:
    if contents.starts is None:
        return "# the files state no time"
    if contents.has_zone:
        return "# the files state it"
    return f"{DECIDE} zone of the times in the files, as Europe/Copenhagen"


def _channel_names(channels: Sequence[ChannelContents]) -> dict[int, str]:
    """Name in the layout by channel: letters, digits and underscores, all different."""
    names: dict[int, str] = {}
    for k, channel in enumerate(channels):
        plain = re.sub(r"[^A-Za-z0-9]+", "_", channel.name).strip("_")
        name = plain if plain[:1].isalpha() else f"c{k}_{plain}".rstrip("_")
        while name in names.values():
            name = f"{name}_{k}"
        names[id(channel)] = name
    return names


def _channel_lines(
    branch: str, name: str, index: int, channel: ChannelContents, first: FileContents, labels: Sequence[str]
) -> Iterator[str]:
    is_unique = first.channel_names.count(channel.name) == 1
    source = json.dumps(channel.name, ensure_ascii=False) if is_unique else str(index)
    quantity, dimension = _quantity(channel)
    yield f"    {name}:"
    yield f"      source: {source}  # {channel.minimum:.5g} to {channel.maximum:.5g} {channel.unit}".rstrip()
    if quantity == "ignored":
        why = channel.role.why or "the file does not state what it measures"
        yield f"      quantity: ignored  {'#' if channel.role.name == 'time' else DECIDE} {why}"
    else:
        yield f"      quantity: {quantity}  # {channel.role.why}" + (
            "" if channel.role.rank == 0 else f"  {DECIDE} is it?"
        )
        yield from _unit_lines(channel, quantity, dimension)
        mounting = MOUNTING[branch][0 if quantity == "force" else 1]
        yield f"      mounting: {mounting}"
        yield _sign_line(index, channel, quantity, first)
        yield f"      # limit:  range beyond which it clips [{SI[quantity]}], from the data sheet"
    if branch == "passages" and quantity != "ignored":
        label = next((label for label in labels if label in re.split(r"[^A-Za-z0-9-]+", channel.name)), labels[0])
        yield f"      section: {label}  {DECIDE} section at which the sensor is mounted"


def _sign_line(index: int, channel: ChannelContents, quantity: str, first: FileContents) -> str:
    """The sign of a channel: of a force by its impacts, of a response by the direction that the file states."""
    if quantity == "force":
        is_negative = channel.name == first.event_channel and all(event.size < 0.0 for event in first.events)
        return (
            "      sign: -1  # its impacts are negative"
            if is_negative
            else "      # sign: -1  if its impacts are negative"
        )
    raw = RawChannel(channel.name, index, quantity)
    stated = next((text for _, _, text in opposite_directions(first.records[0], (raw,))), None)
    if stated is None:
        return "      # sign: -1  if the sensor is mounted upside down"
    return f"      sign: -1  {DECIDE} the file states {' '.join(stated.split())[:MAX_STATED]!r}: is it upside down?"


def _quantity(channel: ChannelContents) -> tuple[str, str]:
    """(quantity, dimension of the stated unit) of a channel."""
    try:
        dimension = conversion(channel.unit).dimension if channel.unit else ""
    except ValueError:
        dimension = ""
    if channel.role.name == "time":
        return "ignored", dimension
    if dimension in QUANTITIES:
        return dimension, dimension
    return QUANTITY_OF_ROLE.get(channel.role.name, "ignored"), dimension


def _unit_lines(channel: ChannelContents, quantity: str, dimension: str) -> Iterator[str]:
    """Unit and sensitivity; what the file does not state stays null, so that nothing is read with a guessed unit."""
    if dimension == quantity:
        yield f"      unit: {channel.unit}  # as the file states it"
        return
    state = f"the file states {channel.unit!r}" if channel.unit else "the file states no unit"
    yield (
        f"      unit: null  {DECIDE} {state}: write its unit, and the sensitivity from the calibration sheet, such as"
    )
    example = "0.23, sensitivity_unit: mV/N" if quantity == "force" else "10.2, sensitivity_unit: mV/(m/s²)"
    yield f"      # unit: V, sensitivity: {example}"
