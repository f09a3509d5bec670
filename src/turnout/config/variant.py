"""A merged configuration, layout changed by the technical columns of a row, which several turnouts may share."""

from dataclasses import dataclass
from functools import cached_property

from turnout.config import build
from turnout.config.document import Branch, Leaf, Place, merge_branches, plain
from turnout.config.frozen import Frozen
from turnout.config.table import Row

FROM_ROW = {
    "hammer_rate_hz": ("hammer", "rate"),
    "hammer_format": ("hammer", "format"),
    "passage_rate_hz": ("passages", "rate"),
    "passage_format": ("passages", "format"),
}
OF_SECTIONS = {"pad_type": "pad", "sleeper_type": "sleeper"}


@dataclass(frozen=True)
class Variant:
    """A merged configuration that several turnouts may share."""

    tree: Branch

    @cached_property
    def values(self) -> dict:
        """The merged tree as plain values, without places."""
        return plain(self.tree)

    @cached_property
    def hashes(self) -> dict[str, str]:
        """Configuration hash of the whole (key "") and of what each kind of unit uses."""
        return build.hashes(self.values)

    @cached_property
    def parts(self) -> dict:
        """What ``TurnoutConfig`` takes from it."""
        return {
            "sections": build.sections(self.values["sections"]),
            "hammer": build.hammer(self.tree),
            "passages": build.passages(self.tree),
            "settings": build.settings(self.values["settings"]),
            "config_hash": self.hashes[""],
            "hashes": Frozen({k: v for k, v in self.hashes.items() if k}),
        }


def with_row(layout: Branch, row: Row) -> Branch:
    """Layout changed by the technical columns of a row."""
    changes = Branch(layout.place)
    for column, (group, key) in FROM_ROW.items():
        if column in row.values and group in layout:
            _at(changes, group, row.place(column)).put(
                key, Leaf(row.values[column], row.place(column)), row.place(column)
            )
    for column, key in OF_SECTIONS.items():
        if column in row.values:
            for label in layout["sections"]:
                section = _at(_at(changes, "sections", row.place(column)), label, row.place(column))
                section.put(key, Leaf(row.values[column], row.place(column)), row.place(column))
    return merge_branches(layout, changes) if changes else layout


def _at(tree: Branch, name: str, place: Place) -> Branch:
    if name not in tree:
        tree.put(name, Branch(place), place)
    return tree[name]
