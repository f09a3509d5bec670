"""One turnout: its hammer tests and passages against the simulation, from raw files to findings."""

from dataclasses import replace
from pathlib import Path

from turnout.config import load_configuration, with_raw
from turnout.errors import ReadError, SimulationError
from turnout.fleet.scan import scan, unit_id
from turnout.mismatch.diagnose import diagnose
from turnout.mismatch.finding import finding_row
from turnout.mismatch.track import Campaign, HammerTest, Passage, TrackCase
from turnout.readers import read
from turnout.registry.ids import content_id
from turnout.simulate import Sensor, load_track, load_vehicle
from turnout.simulate.hammer import located

MOST_PASSAGES = 20
RESERVED_EVERY = 5  # every fifth passage is read by the verification alone


def diagnose_turnout(turnout_id, config="config", raw_root="raw", track_name=None, sections=(), progress=None,
                     store=None, algo=""):  # fmt: skip
    """(Diagnosis, row of mismatch_findings, notes) of one turnout, or of some of its ``sections``.

    A recording that cannot be read or belongs to no known train is left out and said in the notes. Errors:
    SimulationError where nothing is left, or the track has no file in config/tracks.
    """
    configuration = load_configuration(config)
    turnout = with_raw(configuration.turnout(turnout_id), Path(raw_root))
    track = load_track(track_name or turnout.layout)
    units = [u for u in scan(turnout, Path(raw_root)).units if not sections or u.section in (*sections, "")]
    notes: list[str] = []
    tests = [t for u in units if u.kind == "hammer" for t in _tests(u, turnout, track, raw_root, notes)]
    passages = [p for u in units if u.kind == "passage" for p in _passages(u, turnout, raw_root, notes)]
    passages = passages[-MOST_PASSAGES:]
    reserved = tuple(p.name for k, p in enumerate(passages) if k % RESERVED_EVERY == RESERVED_EVERY - 1)
    campaign = Campaign(track, _sensors(turnout, sections) if passages else (), tuple(tests), tuple(passages), reserved)
    case = TrackCase(campaign, turnout.settings.get("mismatch"))
    found = diagnose(case, case.settings, progress, store)
    newest = max((r.started_at for r in _recordings(campaign) if r.started_at), default=None)
    newest = newest or max(c.started_at for c in turnout.campaigns.values())
    result_id = f"{turnout_id}/mismatch"
    identity = {
        "finding_id": content_id("finding", turnout_id, *sections, *(unit_id(u) for u in units), algo),
        "turnout_id": turnout_id,
        "section_id": turnout.section_id(sections[0]) if len(sections) == 1 else None,
        "found_at_utc": newest,
        "result_id": result_id,
    }
    return found, finding_row(found, identity), [*notes, *case.notes]


def _recordings(campaign):
    yield from (r for test in campaign.hammer for r in test.recordings)
    yield from (p.recording for p in campaign.passages)


def _read(unit, description, raw_root, notes):
    """Recordings of a unit; what cannot be read goes to the notes."""
    for path, *_ in unit.files:
        try:
            result = read(path, raw_root, description)
        except ReadError as error:
            notes.append(str(error))
            continue
        notes += [str(e) for e in result.errors]
        yield from result.recordings


def _tests(unit, turnout, track, raw_root, notes):
    recordings = tuple(_read(unit, turnout.hammer.descriptions[unit.section], raw_root, notes))
    if not recordings:
        return
    if unit.section not in track.locations:
        notes.append(f"{unit_id(unit)}: the track file has no location {unit.section!r}")
        return
    place, _ = located(track, unit.section)
    campaign = turnout.campaigns[unit.campaign]
    noted = {} if campaign.rail_temperature is None else {"rail_temperature": campaign.rail_temperature}
    seated = tuple(_seated(r, place) for r in recordings)
    force = turnout.hammer.force[unit.section]
    yield HammerTest(f"{unit.section} {unit.campaign}", place, seated, force, unit.campaign, noted)


def _seated(recording, place):
    """The recording with places for accelerometers that have none: at the blow, or half a bay on if mid-span."""
    channels = tuple(
        c if c.quantity != "acceleration" else replace(c, position=place + (0.3 if "mid-span" in c.mounting else 0.0))
        for c in recording.channels
    )
    return replace(recording, channels=channels)


def _sensors(turnout, sections):
    found = []
    for channel in turnout.passages.description.channels:
        label = turnout.passages.sections.get(channel.name)
        if label is None or (sections and label not in sections):
            continue
        position = channel.position if channel.position is not None else turnout.section(label).position
        found.append(Sensor(channel.name, float(position), channel.mounting or "rail head"))
    return tuple(found)


def _passages(unit, turnout, raw_root, notes):
    for recording in _read(unit, turnout.passages.description, raw_root, notes):
        said = recording.conditions
        try:
            train, speed = str(said["train_type"]).lower(), float(said["speed"])
            vehicle = load_vehicle(train, float(said.get("load_share", 0.5)), units=int(said.get("units", 1)))
        except (KeyError, SimulationError) as error:
            notes.append(f"{unit_id(unit)}: train or speed not known ({error})")
            continue
        direction, route = str(said.get("direction", "facing")), str(said.get("track", "main"))
        noted = {k: said[k] for k in ("rail_temperature",) if k in said}
        yield Passage(unit_id(unit), recording, vehicle, speed, train, direction, route, noted)
