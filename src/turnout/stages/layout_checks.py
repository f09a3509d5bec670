"""Check the files of tracks and vehicles, and the positions of a layout against the track that simulates it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from turnout.config import Configuration
from turnout.config.document import Branch
from turnout.config.settings.passage import PassageSettings
from turnout.errors import ConfigError, TurnoutError
from turnout.records import MID_SPAN
from turnout.simulate import load_track, load_vehicle
from turnout.simulate.parameters import off_track_errors
from turnout.simulate.run import Drive
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.stages.parameter_ranges import improbable_in_files
from turnout.stages.track_plan import PANEL_ORDER

MAX_OFFSET = 10.0  # m from a section to its sensor: a larger one is in millimetres or counts from elsewhere
MAX_TURNOUT_LENGTH = 500.0  # m between two sections: no turnout is so long
MAX_POSITION_DIFFERENCE = 0.5  # m: a larger difference between layout and track file is an error
END_MARGIN = Drive.entry + Drive.margin  # m: closer to an end of the track a train is not completely on it
MOUNTING_BEGINNINGS = ("rail", "sleeper")  # what the simulation reads of a mounting, beside MID_SPAN
QUANTITIES_WITHOUT_POSITION = ("force", "temperature", "ignored")  # channels that need no position


def position_fault(label: str, x: float, track: TurnoutTrack) -> str:
    """Why a position in the layout contradicts the track.

    Parameters
    ----------
    label : str
        Label of the section.
    x : float
        Position of the section in the layout. [m]
    track : TurnoutTrack
        Track of the turnout.

    Returns
    -------
    str
        "" if it does not.
    """
    base = track.track
    if not base.start < x < base.end:
        return f"section {label}: {x:.1f} m in the layout, the track goes from {base.start:.0f} to {base.end:.0f} m"
    location = track.locations.get(label)
    if location is not None and abs(location[0] - x) > MAX_POSITION_DIFFERENCE:
        return f"section {label}: {x:.1f} m in the layout, {location[0]:.1f} m in the track's file; correct one of them"
    return ""


def faults_of_tracks(configuration: Configuration) -> Iterator[str]:
    """Faults of track files and of positions, each once.

    Files that cannot be read, entries without effect, positions off the track or its layout; panels that are not in
    their order from the switch toe on, and sensors far from their section, also without a track file.

    Parameters
    ----------
    configuration : Configuration
        Configuration with its folder of tracks.

    Yields
    ------
    str
        One fault, as a sentence.
    """
    tracks = {}
    for path in sorted((configuration.folder / "tracks").glob("[!.]*.yaml")):
        try:
            tracks[path] = load_track(str(path), folder=path.parent)
            yield from improbable_in_files([path])
            yield from (f"not on the track: {error}" for error in off_track_errors(path))
            _check_entries(tracks[path])
        except ConfigError as error:
            yield f"no simulation: {error}"
        except TurnoutError as error:
            yield f"no simulation: {path}: {error}"
    # keys of one layout are in the trees of all turnouts that use it
    faults: dict[str, None] = {}
    for row in configuration.rows.values():
        tree = configuration.variants[row.id].tree
        stems = (row.id, row.values["layout"])
        files = (configuration.folder / "tracks" / f"{stem}.yaml" for stem in stems)
        file = next((file for file in files if file in tracks), None)
        off_track = [] if file is None else [*_position_errors(tree, tracks[file], file)]
        faults |= {f"not on the track: {error}": None for error in off_track}
        if not off_track:  # one wrong position is one fault
            faults |= {f"panels out of order: {error}": None for error in _panel_errors(tree["sections"])}
            faults |= {f"far from its section: {error}": None for error in _offset_errors(tree)}
    yield from faults


def faults_of_vehicles(configuration: Configuration) -> Iterator[str]:
    """Faults of vehicle files and of the axle patterns: unreadable, or values that no vehicle has.

    Parameters
    ----------
    configuration : Configuration
        Configuration with its folder of vehicles.

    Yields
    ------
    str
        One fault, as a sentence.
    """
    from turnout.stages.passage_context import known_patterns  # it loads parts of scipy

    for path in sorted((configuration.folder / "vehicles").glob("[!.]*.yaml")):
        try:
            if path.name == Path(PassageSettings().axle_patterns).name:
                known_patterns(str(path))
                continue
            load_vehicle(str(path), folder=path.parent)
            yield from improbable_in_files([path])
        except ConfigError as error:
            yield f"no train: {error}"
        except TurnoutError as error:
            yield f"no train: {path}: {error}"


def faults_of_sections(configuration: Configuration) -> Iterator[str]:
    """Pairs of sections at one position of one track, or farther apart than a turnout is long, each pair once.

    The first is often the copy of a line that was not changed, the second a slipped decimal point.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.

    Yields
    ------
    str
        One fault, as a sentence.
    """
    faults: dict[str, None] = {}  # keys of one layout are in the trees of all turnouts that use it
    for variant in configuration.variants.values():
        labels: dict[tuple[str, float], str] = {}
        for label, section in variant.tree["sections"].items():
            track, x = section["track"].value, float(section["position"].value)
            first = labels.setdefault((track, x), label)
            if first != label:
                problem = f"sections {first} and {label} are both at {x:g} m, track {track}"
                remedy = "Correct the position or the track of one of them, or make them one section"
                faults[f"two sections at one position: {section['position'].place.error(problem, remedy)}"] = None
        positions = {label: section["position"] for label, section in variant.tree["sections"].items()}
        first, last = (f(positions, key=lambda label: positions[label].value) for f in (min, max))
        length = positions[last].value - positions[first].value
        if length > MAX_TURNOUT_LENGTH:
            problem = f"sections {first} and {last} are {length:g} m apart"
            remedy = f"No turnout is longer than {MAX_TURNOUT_LENGTH:g} m: correct a position"
            faults[f"sections too far apart: {positions[last].place.error(problem, remedy)}"] = None
    yield from faults


def _panel_errors(sections: Branch) -> Iterator[ConfigError]:
    """An error for each panel that has a section before one of the panel which it follows."""
    positions = {
        panel: {label: s["position"].value for label, s in sections.items() if s["panel"].value == panel}
        for panel in PANEL_ORDER
    }
    present = [panel for panel in PANEL_ORDER if positions[panel]]
    for before, after in pairwise(present):
        last = max(positions[before], key=positions[before].__getitem__)
        first = min(positions[after], key=positions[after].__getitem__)
        x, x_last = positions[after][first], positions[before][last]
        if x < x_last:
            problem = f"section {first} of panel {after} at {x:g} m is before {last} of panel {before} at {x_last:g} m"
            remedy = "Positions count from the switch toe towards the crossing: correct one, or its panel"
            yield sections[first]["position"].place.error(problem, remedy)


def _offset_errors(tree: Branch) -> Iterator[ConfigError]:
    """An error for each sensor that is far from its section."""
    for name, channel in _channels(tree):
        offset = channel.get("offset")
        if offset is not None and abs(offset.value) > MAX_OFFSET:
            problem = f"offset of channel {name} is {offset.value:g} m"
            remedy = f"Write the distance from its section in m, of at most {MAX_OFFSET:g} m"
            yield offset.place.error(problem, remedy)


def _channels(tree: Branch) -> Iterator[tuple[str, Branch]]:
    """(name, channel) of the passages, of the hammer tests and of what differs in single sections."""
    sections = [section.get("hammer", {}) for section in tree["sections"].values()]
    for branch in (tree.get("passages", {}), tree.get("hammer", {}), *sections):
        yield from branch.get("channels", {}).items()


def mounting_remarks(configuration: Configuration) -> Iterator[str]:
    """A remark on each mounting from which the simulation cannot tell where the sensor sits, each once.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.

    Yields
    ------
    str
        One sentence with what to write.
    """
    remarks: dict[str, None] = {}  # keys of one layout are in the trees of all turnouts that use it
    for variant in configuration.variants.values():
        for _, channel in _channels(variant.tree):
            leaf = channel.get("mounting")
            if leaf is None or not leaf.value or channel["quantity"].value in QUANTITIES_WITHOUT_POSITION:
                continue
            is_known = leaf.value.startswith(MOUNTING_BEGINNINGS)
            if not is_known or ("mid" in leaf.value.casefold() and MID_SPAN not in leaf.value):
                taken = "a sensor on the rail at a sleeper"
                beginnings = " or ".join(MOUNTING_BEGINNINGS)
                remedy = f"Begin it with {beginnings}; between two sleepers it is 'rail head {MID_SPAN}'"
                remarks[str(leaf.place.error(f"mounting {leaf.value!r} is simulated as {taken}", remedy))] = None
    yield from remarks


def _check_entries(track: TurnoutTrack) -> None:
    """SimulationError if an accepted effect or change of a track file is not possible there."""
    if track.terms:
        from turnout.stages.accepted_changes import changes_of  # imports all effects
        from turnout.stages.accepted_effects import effects_of

        effects_of(track)
        changes_of(track.terms)


def _position_errors(tree: Branch, track: TurnoutTrack, path: Path) -> Iterator[ConfigError]:
    """An error for each section that contradicts the track, and for each sensor too close to its ends."""
    faults = {
        label: position_fault(label, section["position"].value, track) for label, section in tree["sections"].items()
    }
    for label, fault in faults.items():
        if fault:
            yield tree["sections"][label]["position"].place.error(fault, f"Its track is {path}")
    first, last = track.track.start + END_MARGIN, track.track.end - END_MARGIN
    for name, channel in tree.get("passages", {}).get("channels", {}).items():
        if channel["quantity"].value in QUANTITIES_WITHOUT_POSITION:
            continue
        label = channel["section"].value
        leaf = channel.get("offset", tree["sections"][label]["position"])
        x = tree["sections"][label]["position"].value + (leaf.value if "offset" in channel else 0.0)
        if not faults[label] and not first <= x <= last:
            fault = f"sensor {name} at {x:.1f} m: wheels are wholly on the track of {path} only from {first:.1f} m to"
            yield leaf.place.error(f"{fault} {last:.1f} m", "Correct its position, or lengthen the track")
