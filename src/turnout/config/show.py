"""Where every value of a turnout's configuration comes from."""

from collections.abc import Iterator
from dataclasses import asdict

from turnout.config.document import leaves
from turnout.config.load import Configuration


def sources(configuration: Configuration, turnout: str) -> Iterator[tuple[str, object, str]]:
    """``(key, value, "file, line")`` of every value, settings that no file names included."""
    row = configuration.rows[turnout]
    for column, value in row.values.items():
        yield column, value, _said(row.place(column))
    tree = configuration.variants[turnout].tree
    written = dict(leaves(tree))
    for key, leaf in written.items():
        if not key.startswith("settings."):
            yield key, leaf.value, _said(leaf.place)
    for part, settings in configuration.turnout(turnout).settings.items():
        for name, value in asdict(settings).items():
            key = f"settings.{part}.{name}"
            yield key, value, _said(written[key].place) if key in written else "default"


def _said(place) -> str:
    return f"{place.path}, line {place.line}"
