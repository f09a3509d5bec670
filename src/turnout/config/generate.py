"""Files generated from the keys of settings and layouts: config.yaml, JSON schemas, docs/configuration.md."""

import json
import textwrap
from dataclasses import fields
from pathlib import Path
from typing import Any

from turnout.config.document import load, plain_values
from turnout.config.events import COLUMNS as EVENT_COLUMNS
from turnout.config.events import RESETS
from turnout.config.filename_pattern import FIELDS
from turnout.config.schema import FleetWideKey, Group, Key, NamedEntries, default_of, layout_keys, settings_keys
from turnout.config.settings import parts
from turnout.config.turnouts_table import ROW

WIDTH = 112
HEAD = """\
# Method settings. Every key is optional: a default holds for what is left out.
# Values may be changed here, for one layout ('settings:' in its file) or one turnout (in its override); what is used
# once for all turnouts (alerts, fleet, trend, passage.cluster_maximum and passage.cluster_seed) is changed here alone.
# The comments are made by `turnout config generate`, which keeps changed values; `turnout check` checks them.
"""
JSON_TYPE = {"text": "string", "number": "number", "integer": "integer", "flag": "boolean"}


def generate_files(folder: Path, docs: Path, defaults: bool = False) -> dict[Path, str]:
    """Text of every generated file.

    Parameters
    ----------
    folder : Path
        Folder of the configuration.
    docs : Path
        Folder of the documentation.
    defaults : bool
        Write the default of every setting, instead of the values that config.yaml has now.

    Returns
    -------
    dict of Path to str
        Path -> text; nothing is written.
    """
    path = Path(folder) / "config.yaml"
    present = plain_values(load(path)) if path.exists() and not defaults else {}
    layout, override = layout_keys(), layout_keys()
    return {
        path: config_yaml(present),
        Path(folder) / "schema" / "config.json": schema(settings_keys(), "config/config.yaml", whole=False),
        Path(folder) / "schema" / "layout.json": schema(layout, "config/layouts/<name>.yaml", whole=True),
        Path(folder) / "schema" / "override.json": schema(override, "config/overrides/<id>.yaml", whole=False),
        Path(docs) / "configuration.md": _docs(Path(docs) / "configuration.md"),
    }


def config_yaml(present: dict) -> str:
    r"""Text of config.yaml, with unit, limits and reason in a comment above each key.

    Parameters
    ----------
    present : dict
        Section -> setting -> value, where it is not the default.

    Returns
    -------
    str
        The whole text.

    Examples
    --------
    >>> "\n  # 1 to 4096: one job" in config_yaml({}), "\n  shards: 64\n" in config_yaml({"fleet": {"shards": 64}})
    (True, True)
    """
    lines = [HEAD]
    for name, cls in parts().items():
        lines.append(f"\n{name}:  # {(cls.__doc__ or name).strip().splitlines()[0]}")
        keys = settings_keys()[name].spec
        for field in fields(cls):
            key, default = keys[field.name], default_of(field)
            value = present.get(name, {}).get(field.name, default)
            changed = "" if value == default else f"default {_yaml(default)}; "
            lines += textwrap.wrap(changed + describe_key(key), WIDTH, initial_indent="  # ", subsequent_indent="  # ")
            lines.append(f"  {field.name}: {_yaml(value)}")
    return "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"


def describe_key(key: Key) -> str:
    """Unit, limits and reason of a key as text.

    Parameters
    ----------
    key : Key
        Key of the schema.

    Returns
    -------
    str
        One line, without a full stop.

    Examples
    --------
    >>> describe_key(Key("number", "the paper's gate", minimum=0.0, maximum=1.0))
    "0 to 1: the paper's gate"
    """
    unit = "" if key.unit in ("", "-", "1") else f"[{key.unit}]"
    limits = ""
    if key.choices:
        limits = " or ".join(map(str, key.choices))
    elif key.above is not None:
        limits = f"above {key.above:g}"
    elif key.minimum is not None and key.maximum is not None:
        limits = f"{key.minimum:g} to {key.maximum:g}"
    elif key.minimum is not None:
        limits = f"at least {key.minimum:g}"
    elif key.maximum is not None:
        limits = f"at most {key.maximum:g}"
    head = " ".join(text for text in (limits, unit) if text)
    return f"{head}: {key.meaning}" if head else key.meaning


def schema(keys: dict, title: str, whole: bool) -> str:
    """JSON schema for editors. The program itself checks with the same keys and gives more detailed errors.

    Parameters
    ----------
    keys : dict
        Name -> Key, Group or NamedEntries.
    title : str
        Title of the schema.
    whole : bool
        Whether required keys must be there.

    Returns
    -------
    str
        JSON text.
    """
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return json.dumps(head | _object_schema(keys, whole), indent=1, ensure_ascii=False) + "\n"


def _object_schema(keys: dict, whole: bool) -> dict:
    result = {"type": "object", "additionalProperties": False}
    result["properties"] = {
        name: _property_schema(rule, whole) for name, rule in keys.items() if not isinstance(rule, FleetWideKey)
    }
    if whole and (required := [name for name, rule in keys.items() if rule.required]):
        result["required"] = required
    return result


def _property_schema(rule: Key | Group | NamedEntries, whole: bool) -> dict:
    if isinstance(rule, Group):
        return {"description": rule.meaning} | _object_schema(rule.spec, whole and not rule.fragment)
    if isinstance(rule, NamedEntries):
        names = {f"^{rule.pattern}$": _object_schema(rule.spec, whole)}
        return {
            "description": rule.meaning,
            "type": "object",
            "additionalProperties": False,
            "patternProperties": names,
        }
    types: list[str] = ["string", "integer"] if rule.value_type == "name_or_index" else [JSON_TYPE[rule.value_type]]
    if rule.many:
        return {"description": describe_key(rule), "type": "array", "items": {"type": types[0]}}
    types += ["null"] if rule.nullable else []
    result: dict = {"description": describe_key(rule), "type": types if len(types) > 1 else types[0]}
    if rule.choices:
        result["enum"] = [*rule.choices, None] if rule.nullable else [*rule.choices]
    if rule.pattern:
        result["pattern"] = f"^{rule.pattern}$"
    limits = {"minimum": rule.minimum, "maximum": rule.maximum, "exclusiveMinimum": rule.above}
    return result | {k: v for k, v in limits.items() if v is not None}


GENERATED_MARK = "<!-- below: made by `turnout config generate` -->"


def _docs(path: Path) -> str:
    """docs/configuration.md: the text above the mark stays, the tables below it are generated."""
    above = path.read_text(encoding="utf-8").partition(GENERATED_MARK)[0] if path.exists() else "# Configuration\n\n"
    return f"{above}{GENERATED_MARK}\n\n{tables()}"


RESETS_NOTE = """An empty `section` is the whole turnout. `resets` overrules the kind: `ballast`, `railpad`,
`ballast railpad` or `none`. Crossing or blade renewed: `rail_change`; bearers: `sleeper_change`; deposit welding:
`grinding`; clips tightened: `other` with `railpad`.
"""


def tables() -> str:
    """Tables of all columns and keys in Markdown."""
    blocks = ["## Columns of config/turnouts.tsv\n", _table(_flatten_keys(ROW))]
    blocks += ["## Columns of config/events.csv\n", f"`{','.join(EVENT_COLUMNS)}`. `kind` and what it resets:\n"]
    blocks.append("\n".join(f"- `{key}`: {' and '.join(bands) or 'nothing'}" for key, bands in RESETS.items()) + "\n")
    blocks += [RESETS_NOTE, "## Fields of a file pattern\n"]
    blocks += [f"- `{key}`: " + ", ".join(f"`{{{name}}}`" for name in names) for key, names in FIELDS.items()]
    blocks += ["\n`{section}` in `hammer` is a label of the layout; `*` is anything but a slash.\n"]
    layout = {name: rule for name, rule in layout_keys().items() if name != "settings"}
    blocks += ["## Keys of config/layouts/*.yaml and config/overrides/*.yaml\n", _table(_flatten_keys(layout))]
    for name, group in settings_keys().items():
        blocks += [f"## Settings: {name}\n", group.meaning + "\n", _table(_flatten_keys(group.spec, f"{name}."), True)]
    return "\n".join(blocks)


def _flatten_keys(keys: dict, prefix: str = "") -> list[tuple[str, Key]]:
    entries = []
    for name, rule in keys.items():
        if isinstance(rule, Key):
            entries.append((prefix + name, rule))
        else:
            inner = f"{prefix}{name}." + ("<name>." if isinstance(rule, NamedEntries) else "")
            entries += _flatten_keys(rule.spec, inner)
    return entries


def _table(keys: list[tuple[str, Key]], with_default: bool = False) -> str:
    lines = [f"| key | {'default' if with_default else 'needed'} | meaning |", "|---|---|---|"]
    for name, key in keys:
        second_cell = f"`{_yaml(key.default)}`" if with_default else ("yes" if key.required else "")
        text = describe_key(key).replace("|", "\\|").replace("<", "&lt;")
        lines.append(f"| `{name}` | {second_cell} | {text} |")
    return "\n".join(lines) + "\n"


def _yaml(value: Any) -> str:
    """A value in YAML notation."""
    if isinstance(value, tuple):
        return "[" + ", ".join(_yaml(v) for v in value) + "]"
    if isinstance(value, str):
        plain_word = value.replace("_", "").replace("-", "").isalpha() and value not in ("true", "false", "null")
        return value if plain_word else json.dumps(value, ensure_ascii=False)
    return json.dumps(value)
