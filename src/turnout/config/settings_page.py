"""Text of docs/settings.md: every column and key of the configuration, once, from the schema that checks it."""

from collections import defaultdict
from collections.abc import Mapping

from turnout.config.events import COLUMNS as EVENT_COLUMNS
from turnout.config.events import RESETS
from turnout.config.filename_pattern import FIELDS
from turnout.config.key_text import describe_key, yaml_text
from turnout.config.layout_schema import FLEET_WIDE, layout_keys
from turnout.config.schema import Key, NamedEntries
from turnout.config.settings_schema import settings_keys
from turnout.config.turnouts_table import ROW

HEAD = """# Settings, columns and keys

This page lists every column, key and setting of the files in `config/`.
How to use them: [configuration](configuration.md).

<!-- made by `turnout config generate`; a test compares it -->

A range includes its ends. A unit is in square brackets. `turnout check` tests every file against these keys.
"""
RESETS_NOTE = """An empty `section` is the whole turnout. `resets` overrules the kind: `ballast`, `railpad`,
`ballast railpad` or `none`. Crossing or blade renewed: `rail_change`; bearers: `sleeper_change`; deposit welding:
`grinding`; clips tightened: `other` with `railpad`; the whole turnout rebuilt: `renewal` without a section. The
calibrated model and the diagnosis of an alarm then use no visit before that day. In both, work from 12:00 UTC on lies
after the visit of its day.
"""
LAYOUT_NOTE = """A layout and an override have the same keys. An override, and `hammer` within a section, hold only
what differs: no key is needed there. `settings:` takes the settings below, except those of the whole fleet:
{fleet_wide}.
"""
TOP = "(top level)"
# Mappings of a layout that have the same keys: heading, and where they are.
LAYOUT_BLOCKS = (
    ("The layout itself", (TOP,)),
    ("A section", ("sections.<name>",)),
    ("Files of recordings", ("hammer", "passages", "sections.<name>.hammer")),
    (
        "A channel",
        ("hammer.channels.<name>", "passages.channels.<name>", "sections.<name>.hammer.channels.<name>"),
    ),
)


def settings_page() -> str:
    """The whole page.

    Returns
    -------
    str
        Markdown.
    """
    blocks = [HEAD, "## Columns of config/turnouts.tsv\n", _table(list(ROW.items()))]
    blocks += ["## Columns of config/events.csv\n", f"`{','.join(EVENT_COLUMNS)}`. `kind` and what it resets:\n"]
    blocks.append("\n".join(f"- `{key}`: {' and '.join(bands) or 'nothing'}" for key, bands in RESETS.items()) + "\n")
    blocks += [RESETS_NOTE, "## Fields of a file pattern\n"]
    blocks += [f"- `{key}`: " + ", ".join(f"`{{{name}}}`" for name in names) for key, names in FIELDS.items()]
    blocks += ["\n`{section}` in `hammer` is a label of the layout; `*` is anything but a slash.\n"]
    blocks += ["## Keys of config/layouts/*.yaml and config/overrides/*.yaml\n", _layout_note(), *_layout_tables()]
    for name, group in settings_keys().items():
        keys = [(f"{parent}.{leaf}", key) for parent, leaf, key in _flatten_keys(group.spec, name)]
        blocks += [f"## Settings: {name}\n", group.meaning + "\n", _table(keys, with_default=True)]
    return "\n".join(blocks)


def _layout_note() -> str:
    names = [f"`{part}.{key}`" for part, keys in FLEET_WIDE.items() for key in keys]
    return LAYOUT_NOTE.format(
        fleet_wide=", ".join([f"`{part}`" for part, keys in FLEET_WIDE.items() if not keys] + names)
    )


def _layout_tables() -> list[str]:
    """A table per kind of mapping; a key of all mappings of its kind, or of some, is one row."""
    layout = layout_keys()
    keys = {name: layout[name] for name in ("description", "hammer", "passages", "sections")}
    block_of = {parent: heading for heading, parents in LAYOUT_BLOCKS for parent in parents}
    rows: dict[str, dict[tuple[str, str], list[tuple[str, Key]]]] = defaultdict(lambda: defaultdict(list))
    for parent, leaf, key in _flatten_keys(keys):
        rows[block_of[parent or TOP]][leaf, describe_key(key)].append((parent or TOP, key))
    blocks = []
    for heading, parents in LAYOUT_BLOCKS:
        everywhere = ", ".join(f"`{parent}`" for parent in parents)
        blocks.append(f"### {heading}\n" + (f"\nIn {everywhere}.\n" if parents != (TOP,) else ""))
        blocks.append(
            _table([(leaf, where[0][1], _only_in(where, parents)) for (leaf, _), where in rows[heading].items()])
        )
    return blocks


def _only_in(where: list[tuple[str, Key]], parents: tuple[str, ...]) -> str:
    """Where a key is, in words, if it is not in all mappings of its kind."""
    names = [parent for parent in parents if parent in {name for name, _ in where}]
    return "" if len(names) == len(parents) else " (only in " + ", ".join(f"`{name}`" for name in names) + ")"


def _flatten_keys(keys: Mapping, parent: str = "") -> list[tuple[str, str, Key]]:
    """(path of the mapping, name, key) of every key below ``keys``."""
    entries = []
    for name, rule in keys.items():
        if isinstance(rule, Key):
            entries.append((parent, name, rule))
        else:
            inner = ".".join(part for part in (parent, name) if part)
            entries += _flatten_keys(rule.spec, inner + (".<name>" if isinstance(rule, NamedEntries) else ""))
    return entries


def _table(keys: list[tuple], with_default: bool = False) -> str:
    """Rows of (name, key) or (name, key, note)."""
    lines = [f"| key | {'default' if with_default else 'needed'} | meaning |", "|---|---|---|"]
    for name, key, *note in keys:
        second_cell = f"`{yaml_text(key.default)}`" if with_default else ("yes" if key.required else "")
        text = describe_key(key).replace("|", "\\|").replace("<", "&lt;") + "".join(note)
        lines.append(f"| `{name}` | {second_cell} | {text} |")
    return "\n".join(lines) + "\n"
