"""Write an accepted finding into the turnout's track file, readable, with source, date and interval."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from turnout.config import TurnoutConfig, load_configuration
from turnout.constants import Z95
from turnout.errors import SimulationError
from turnout.files import remove_unfinished, write_text
from turnout.locks import folder_lock
from turnout.physics import TERMS, effects_by_name
from turnout.simulate import load_track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.stages.accepted_changes import change_text, changes_of, check_change
from turnout.stages.accepted_effects import SINCE, SUPPORT_KEYS, accepted_of
from turnout.stages.track_files import track_file

# Units for values below 0.1 in SI units: SI unit -> (unit, its size in the SI unit)
DISPLAY_UNITS = {"m": ("mm", 1e-3), "s": ("ms", 1e-3)}
POSITION_FIELDS = ("place", "start", "end")
# What tells two entries of one effect apart, unless it is a parameter of that effect.
IDENTIFYING_FIELDS = (
    "route", "term", *SUPPORT_KEYS, *POSITION_FIELDS, "channel_name", "train", "wheel", "order", "frequency", SINCE
)  # fmt: skip
FIELDS_IN_METRES = {*SUPPORT_KEYS, *POSITION_FIELDS}
FILE_HEADER = """# What recordings of this turnout showed to be missing from the track of its layout. Written by
# `turnout diagnose --accept`; take an entry out again when the cause is repaired.
extends: {layout}
"""
ENTRY_START = re.compile(r"^ *- term:", re.MULTILINE)


def accept(
    finding: Mapping[str, Any], config: str | Path, turnout_id: str, track: str | None = None, anyway: bool = False
) -> tuple[Path, str]:
    """Write the terms of a finding into the turnout's own track file.

    A turnout that shares its layout's file gets a file of its own that extends it. A term that is already there, at the
    same position, is replaced.

    Parameters
    ----------
    finding : mapping of str to any
        Row of ``mismatch_findings`` or ``change_findings``.
    config : str or Path
        Folder of the configuration.
    turnout_id : str
        Turnout of the finding.
    track : str or None
        Name or file of the track; None: the turnout's own, else its layout's.
    anyway : bool
        Accept a finding of any verdict and grade, as long as it has a term of the track.

    Returns
    -------
    tuple of (Path, str)
        The file and a sentence on the change.

    Raises
    ------
    SimulationError
        The verdict is not "named" with grade A or B and ``anyway`` is not set, the finding has no term, or the term
        belongs to a wheelset. Of a change: it is not named, or has no position. The file is then unchanged.
    """
    turnout = load_configuration(config).turnout(turnout_id)
    with folder_lock(Path(config), "the configuration"):  # the text of the file is read, extended and written
        return _extend_track(finding, turnout, turnout_id, track, anyway)


def _extend_track(
    finding: Mapping[str, Any], turnout: TurnoutConfig, turnout_id: str, track: str | None, anyway: bool
) -> tuple[Path, str]:
    """File and sentence of ``accept``."""
    is_change = "onset_by_utc" in finding
    if is_change:
        check_change(finding, anyway)
    else:
        _check_acceptable(finding, turnout_id, anyway)
    path = track_file(turnout, track)
    if path.stem != turnout_id and track is None:
        text, path = FILE_HEADER.format(layout=path.stem), path.with_name(f"{turnout_id}.yaml")
    else:
        text = path.read_text(encoding="utf-8")
    current_track = load_track(str(track_file(turnout, track)), folder=path.parent)
    if is_change:
        _write(path, with_entry(text, change_text(finding)))
        return path, f"{finding['sentence']}: accepted"
    terms = json.loads(finding["term_json"])
    for term in terms:
        text = with_entry(text, entry_text(term, finding, current_track))
    _write(path, text)
    return path, "; ".join(f"{t['term']} ({_values_text(t)})" for t in terms) + " accepted"


def _check_acceptable(finding: Mapping[str, Any], turnout_id: str, anyway: bool) -> None:
    prefix = f"{turnout_id}, {finding['sections']}: the verdict is {finding['verdict'].replace('_', ' ')}"
    if not finding["term_json"]:
        raise SimulationError(f"{prefix}; it has no effect that could be accepted.")
    names = {t["term"] for t in json.loads(finding["term_json"])}
    # An effect of a wheelset does not belong in a track's file: the wheelset leaves with its train.
    if on_wheelset := names & {effect.name for effect in TERMS if effect.frame == "wheel"}:
        raise SimulationError(f"{prefix}; {min(on_wheelset)} belongs to a wheelset, which no track file describes.")
    if not anyway and not any(_is_significant(t) for t in json.loads(finding["term_json"])):
        raise SimulationError(f"{prefix}, but no parameter differs from having no effect; --anyway accepts it.")
    if (finding["verdict"] != "named" or finding["grade"] not in ("A", "B")) and not anyway:
        raise SimulationError(f"{prefix}, not named with grade A or B; --anyway accepts it all the same.")
    ambiguous = next((t for t in json.loads(finding["term_json"]) if t.get("or")), None)
    if ambiguous and not anyway:
        raise SimulationError(
            f"{prefix}; {ambiguous['term']} is as probable as {ambiguous['or']}; --anyway accepts it."
        )


def _is_significant(term: Mapping[str, Any]) -> bool:
    """Whether a parameter differs from its neutral value by more than half its 95 % interval."""
    neutral = {p.name: p.neutral for p in effects_by_name()[term["term"]].parameters}
    return any(abs(p["value"] - neutral[name]) > Z95 * p["se"] for name, p in term["parameters"].items())


def _write(path: Path, text: str) -> None:
    """Write the file if a trial copy can be read and all its terms are valid."""
    trial = path.with_name(f".{path.stem}.trial.yaml")
    try:
        write_text(trial, text)
        track = load_track(str(trial), folder=path.parent)
        changes_of(track.terms)
        for entry in accepted_of(track.terms):
            term = entry.term(track.track)
            if term is None:
                raise SimulationError(f"{path}: {entry.key} lies at no support of the track.")
            for p in entry.parameters:
                low, high = p.bounds
                if not low <= getattr(term, p.name) <= high:
                    raise SimulationError(f"{path}: {entry.key}: {p.name} lies outside {low} to {high} {p.unit}.")
    finally:
        remove_unfinished(trial)
    write_text(path, text)


def entry_text(term: Mapping[str, Any], finding: Mapping[str, Any], track: TurnoutTrack) -> str:
    """YAML text of one entry of ``terms``, one number per line.

    Parameters
    ----------
    term : mapping of str to any
        One of the terms in ``term_json`` of the finding.
    finding : mapping of str to any
        Row of ``mismatch_findings``.
    track : TurnoutTrack
        Track of the turnout. The route is included if one of its routes has its own supports at that position.

    Returns
    -------
    str
        The entry, with a line break at its end.
    """
    day = f"{_time(finding['found_at_utc']):%Y-%m-%d}"
    source = f"turnout diagnose, recordings up to {day}, finding {finding['finding_id'][:12]}"
    lines = [f"  - term: {term['term']}"]
    positions = [
        value for name, value in term["fixed"].items() if name in FIELDS_IN_METRES and isinstance(value, (int, float))
    ]
    if any(track.is_divided_at(position) for position in positions):
        lines.append(f"    route: {finding['route']}")
    for name, value in term["fixed"].items():
        lines.append(f"    {name}: {_fixed_text(name, value, source)}")
    for name, p in term["parameters"].items():
        lines.append(f"    {name}: {_parameter_text(p, source, finding)}")
    lines.append(f"    accepted: {datetime.now(UTC):%Y-%m-%d}")
    lines.append(f"    finding: {finding['finding_id']}")
    return "\n".join(lines) + "\n"


def _time(value: Any) -> datetime:
    return value if isinstance(value, datetime) else datetime.fromisoformat(str(value))


def _fixed_text(name: str, value: Any, source: str) -> str:
    if name in FIELDS_IN_METRES and isinstance(value, (int, float)):
        return f'{{value: {value:g}, unit: m, source: "{source}"}}'
    return json.dumps(value, ensure_ascii=False)


def _parameter_text(p: Mapping[str, Any], source: str, finding: Mapping[str, Any]) -> str:
    unit, size = DISPLAY_UNITS.get(p["unit"], ("", 1.0)) if abs(p["value"]) < 0.1 else ("", 1.0)
    unit, value, se = unit or p["unit"], p["value"] / size, p["se"] / size
    text = f'{{value: {value:.4g}, unit: "{unit}", source: "{source}"'
    if value and se:
        text += f", prior: {se / abs(value):.2g}"
    low, high = value - Z95 * se, value + Z95 * se
    grade = f", grade {finding['grade']}" if finding["grade"] else ""
    return f'{text}, note: "95 %: {low:.3g} to {high:.3g} {unit}, {finding["verdict"].replace("_", " ")}{grade}"}}'


def with_entry(text: str, entry: str) -> str:
    r"""Track file with one more entry in its ``terms``; it replaces an entry of the same effect.

    Parameters
    ----------
    text : str
        Text of the track file.
    entry : str
        Text of the entry, as ``entry_text`` writes it.

    Returns
    -------
    str
        Text of the track file with ``entry`` at the end of its ``terms``.

    Examples
    --------
    >>> text = "name: a\nterms:\n  - term: hum\n    sine: 1\nspacing: 2\n"
    >>> print(with_entry(text, "  - term: hum\n    sine: 3\n"))
    name: a
    terms:
      - term: hum
        sine: 3
    spacing: 2
    <BLANKLINE>
    """
    text = text.rstrip("\n") + "\n"
    section = re.search(r"^terms:[^\n]*\n((?:[ #][^\n]*\n|\n)*)", text, re.MULTILINE)
    if not section:
        return text + "terms:\n" + entry
    starts = [m.start() for m in ENTRY_START.finditer(section[1])] + [len(section[1])]
    head, entries = section[1][: starts[0]], [section[1][a:b] for a, b in pairwise(starts)]
    remaining = [old_entry for old_entry in entries if not _is_same_effect(_identity(old_entry), _identity(entry))]
    block = (
        head + "".join(old_entry if old_entry.endswith("\n") else old_entry + "\n" for old_entry in remaining) + entry
    )
    return text[: section.start(1)] + block + text[section.end(1) :]


def _is_same_effect(first: tuple[str, ...], second: tuple[str, ...]) -> bool:
    """Whether two identities are the same effect; an identity without route applies to all routes."""
    return first[1:] == second[1:] and (first[0] == second[0] or not (first[0] and second[0]))


def _identity(entry: str) -> tuple[str, ...]:
    """Identity of an entry: route, effect, and position, sensor, train, wheel, order or frequency of a line."""
    effect = effects_by_name().get(_value_of(entry, "term"))
    fitted = {p.name for p in effect.parameters} if effect else set()
    return tuple("" if name in fitted else _value_of(entry, name) for name in IDENTIFYING_FIELDS)


def _value_of(entry: str, name: str) -> str:
    """Value of a field of an entry, a number to one decimal; "" without the field."""
    match = re.search(rf"^[ -]*{name}: *(?:{{ *value: *([^,}}]+)|([^\n#]+))", entry, re.MULTILINE)
    value = (match[1] or match[2]).strip().strip('"') if match else ""
    return f"{float(value):.1f}" if re.fullmatch(r"-?\d+(\.\d*)?", value) else value


def _values_text(term: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {p['value']:.4g} ± {Z95 * p['se']:.2g} {p['unit']}" for name, p in term["parameters"].items()
    )
