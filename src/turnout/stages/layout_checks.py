"""Check the positions of a layout against the track that simulates it."""

from collections.abc import Iterator
from pathlib import Path

from turnout.config import Configuration
from turnout.config.document import Branch
from turnout.errors import ConfigError, TurnoutError
from turnout.simulate import load_track
from turnout.simulate.parameters import off_track
from turnout.simulate.run import Drive

OFF = 0.5  # m: a larger difference between layout and track file is an error
ENTRY = Drive.entry + Drive.margin  # m: closer to an end of the track a train is not completely on it
NO_PLACE = ("force", "temperature", "ignored")  # channels that need no position


def misplaced(label, place, track) -> str:
    """Why a position in the layout contradicts the track, "" if it does not."""
    base = track.track
    if not base.start < place < base.end:
        return f"section {label}: {place:.1f} m in the layout, the track goes from {base.start:.0f} to {base.end:.0f} m"
    known = track.locations.get(label)
    if known is not None and abs(known[0] - place) > OFF:
        return (
            f"section {label}: {place:.1f} m in the layout, {known[0]:.1f} m in the track's file; correct one of them"
        )
    return ""


def faults_of_tracks(configuration: Configuration) -> Iterator[str]:
    """Faults of each track file: unreadable, positions off the track, and contradictions with its layout."""
    tracks = {}
    for path in sorted((configuration.folder / "tracks").glob("*.yaml")):
        try:
            tracks[path] = load_track(str(path), folder=path.parent)
            yield from (f"not on the track: {error}" for error in off_track(path))
        except ConfigError as error:
            yield f"no simulation: {error}"
        except TurnoutError as error:
            yield f"no simulation: {path}: {error}"
    said = set()
    for row in configuration.rows.values():
        tree = configuration.variants[row.id].tree
        stems = (row.id, row.values["layout"])
        files = (configuration.folder / "tracks" / f"{stem}.yaml" for stem in stems)
        file = next((file for file in files if file in tracks), None)
        if file is not None and (id(tree), file) not in said:
            said.add((id(tree), file))
            yield from (f"not on the track: {error}" for error in _misplaced(tree, tracks[file], file))


def _misplaced(tree: Branch, track, path: Path) -> Iterator[ConfigError]:
    """An error for each section that contradicts the track, and for each sensor too close to its ends."""
    wrong = {label: misplaced(label, section["position"].value, track) for label, section in tree["sections"].items()}
    for label, found in wrong.items():
        if found:
            yield tree["sections"][label]["position"].place.error(found, f"Its track is {path}")
    first, last = track.track.start + ENTRY, track.track.end - ENTRY
    for name, channel in tree.get("passages", {}).get("channels", {}).items():
        label = channel["section"].value
        leaf = channel.get("offset", tree["sections"][label]["position"])
        place = tree["sections"][label]["position"].value + (leaf.value if "offset" in channel else 0.0)
        if channel["quantity"].value not in NO_PLACE and not wrong[label] and not first <= place <= last:
            found = (
                f"sensor {name} at {place:.1f} m: wheels are wholly on the track of {path} only from {first:.1f} m to"
            )
            yield leaf.place.error(f"{found} {last:.1f} m", "Correct its place, or lengthen the track")
