"""Write an accepted finding into the turnout's track file, readable, with source, date and interval."""

import json
import re
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

from turnout.config import load_configuration
from turnout.errors import SimulationError
from turnout.files import write_text
from turnout.simulate import load_track
from turnout.stages.accepted_effects import KINDS, OF_A_WHEELSET, SUPPORTS, accepted_of
from turnout.stages.mismatch_inputs import track_file

# Units for values below 0.1 in SI units: SI unit -> (unit, its size in the SI unit)
SMALLER = {"m": ("mm", 1e-3), "s": ("ms", 1e-3)}
PLACES = ("place", "start", "end")
PLACED = {*SUPPORTS, *PLACES}
HEAD = """# What recordings of this turnout showed to be missing from the track of its layout. Written by
# `turnout diagnose --accept`; take an entry out again when the cause is repaired.
extends: {layout}
"""
ENTRY = re.compile(r"^ *- term:", re.MULTILINE)


def accept(finding, config, turnout_id, track=None, anyway=False) -> tuple[Path, str]:
    """Write the terms of ``finding`` (row of ``mismatch_findings``) into the turnout's own track file.

    A turnout that shares its layout's file gets a file of its own that extends it. A term that is already there, at
    the same position, is replaced. Returns the file and a sentence on the change.

    Raises
    ------
    SimulationError
        The verdict is not "named" with grade A or B and ``anyway`` is not set, the finding has no term, or the term
        belongs to a wheelset. The file is then unchanged.
    """
    turnout = load_configuration(config).turnout(turnout_id)
    _refuse(finding, turnout_id, anyway)
    terms = json.loads(finding["term_json"])
    path = track_file(turnout, track)
    if path.stem != turnout_id and track is None:
        text, path = HEAD.format(layout=path.stem), path.with_name(f"{turnout_id}.yaml")
    else:
        text = path.read_text(encoding="utf-8")
    known = load_track(str(track_file(turnout, track)), folder=path.parent)
    for term in terms:
        text = with_entry(text, entry_text(term, finding, known))
    _write(path, text)
    return path, "; ".join(f"{t['term']} ({_values(t)})" for t in terms) + " accepted"


def _refuse(finding, turnout_id, anyway):
    said = f"{turnout_id}, {finding['sections']}: the verdict is {finding['verdict'].replace('_', ' ')}"
    if not finding["term_json"]:
        raise SimulationError(f"{said}; it carries no term that could be accepted.")
    families = {t["term"] for t in json.loads(finding["term_json"])}
    if found := families & set(OF_A_WHEELSET):
        raise SimulationError(f"{said}; {min(found)} belongs to a wheelset, which no track file describes.")
    if not anyway and not any(_material(t) for t in json.loads(finding["term_json"])):
        raise SimulationError(f"{said}, but no parameter differs from having no effect; --anyway accepts it.")
    if (finding["verdict"] != "named" or finding["grade"] not in ("A", "B")) and not anyway:
        raise SimulationError(f"{said}, not named with grade A or B; --anyway accepts it all the same.")
    either = next((t for t in json.loads(finding["term_json"]) if t.get("or")), None)
    if either and not anyway:
        raise SimulationError(f"{said}; {either['term']} may as well be {either['or']}; --anyway accepts it.")


def _material(term):
    """Whether a parameter differs from its neutral value by more than half its 95 % interval."""
    neutral = {p.name: p.neutral for p in KINDS[term["term"]].parameters}
    return any(abs(p["value"] - neutral[name]) > 1.96 * p["se"] for name, p in term["parameters"].items())


def _write(path, text):
    """Write the file if a trial copy can be read and all its terms are valid."""
    trial = path.with_name(f".{path.stem}.trial.yaml")
    try:
        write_text(trial, text)
        track = load_track(str(trial), folder=path.parent)
        for entry in accepted_of(track.terms):
            term = entry.term(track.track)
            if term is None:
                raise SimulationError(f"{path}: {entry.key} lies at no support of the track.")
            for p in entry.parameters:
                low, high = p.bounds
                if not low <= getattr(term, p.name) <= high:
                    raise SimulationError(f"{path}: {entry.key}: {p.name} lies outside {low} to {high} {p.unit}.")
    finally:
        trial.unlink(missing_ok=True)
    write_text(path, text)


def entry_text(term, finding, track) -> str:
    """YAML text of one entry of ``terms``, one number per line.

    The route is included if a route of ``track``, a TurnoutTrack, has its own supports at that position.
    """
    day = f"{_time(finding['found_at_utc']):%Y-%m-%d}"
    source = f"turnout diagnose, recordings up to {day}, finding {finding['finding_id'][:12]}"
    lines = [f"  - term: {term['term']}"]
    places = [value for name, value in term["fixed"].items() if name in PLACED and isinstance(value, (int, float))]
    if any(track.parts_at(place) for place in places):
        lines.append(f"    route: {finding['route']}")
    for name, value in term["fixed"].items():
        lines.append(f"    {name}: {_fixed(name, value, source)}")
    for name, p in term["parameters"].items():
        lines.append(f"    {name}: {_number(p, source, finding)}")
    lines.append(f"    accepted: {datetime.now(UTC):%Y-%m-%d}")
    lines.append(f"    finding: {finding['finding_id']}")
    return "\n".join(lines) + "\n"


def _time(value) -> datetime:
    return value if isinstance(value, datetime) else datetime.fromisoformat(str(value))


def _fixed(name, value, source):
    if name in PLACED and isinstance(value, (int, float)):
        return f'{{value: {value:g}, unit: m, source: "{source}"}}'
    return json.dumps(value, ensure_ascii=False)


def _number(p, source, finding):
    unit, size = SMALLER.get(p["unit"], ("", 1.0)) if abs(p["value"]) < 0.1 else ("", 1.0)
    unit, value, se = unit or p["unit"], p["value"] / size, p["se"] / size
    shown = f'{{value: {value:.4g}, unit: "{unit}", source: "{source}"'
    if value and se:
        shown += f", prior: {se / abs(value):.2g}"
    low, high = value - 1.96 * se, value + 1.96 * se
    grade = f", grade {finding['grade']}" if finding["grade"] else ""
    return f'{shown}, note: "95 %: {low:.3g} to {high:.3g} {unit}, {finding["verdict"].replace("_", " ")}{grade}"}}'


def with_entry(text: str, entry: str) -> str:
    """Track file ``text`` with ``entry`` at the end of its ``terms``; it replaces an entry of the same effect.

    >>> text = "name: a\\nterms:\\n  - term: hum\\n    sine: 1\\nspacing: 2\\n"
    >>> print(with_entry(text, "  - term: hum\\n    sine: 3\\n"))
    name: a
    terms:
      - term: hum
        sine: 3
    spacing: 2
    <BLANKLINE>
    """
    text = text.rstrip("\n") + "\n"
    found = re.search(r"^terms:[^\n]*\n((?:[ #][^\n]*\n|\n)*)", text, re.MULTILINE)
    if not found:
        return text + "terms:\n" + entry
    starts = [m.start() for m in ENTRY.finditer(found[1])] + [len(found[1])]
    head, old = found[1][: starts[0]], [found[1][a:b] for a, b in pairwise(starts)]
    kept = [e for e in old if not _same(_identity(e), _identity(entry))]
    block = head + "".join(e if e.endswith("\n") else e + "\n" for e in kept) + entry
    return text[: found.start(1)] + block + text[found.end(1) :]


def _same(one, other) -> bool:
    """Whether two identities are the same effect; an identity without route applies to all routes."""
    return one[1:] == other[1:] and (one[0] == other[0] or not (one[0] and other[0]))


def _identity(entry: str) -> tuple[str, ...]:
    """Identity of an entry: route, effect, and position, sensor or train."""
    names = ("route", "term", *SUPPORTS, *PLACES, "channel_name", "train")
    found = []
    for name in names:
        match = re.search(rf"^[ -]*{name}: *(?:{{ *value: *([^,}}]+)|([^\n#]+))", entry, re.MULTILINE)
        value = (match[1] or match[2]).strip().strip('"') if match else ""
        found.append(f"{float(value):.1f}" if re.fullmatch(r"-?\d+(\.\d*)?", value) else value)
    return tuple(found)


def _values(term):
    return ", ".join(
        f"{name} {p['value']:.4g} ± {1.96 * p['se']:.2g} {p['unit']}" for name, p in term["parameters"].items()
    )
