"""Files generated from the keys of settings and layouts: config.yaml, JSON schemas, docs/settings.md."""

import json
import textwrap
from dataclasses import fields
from pathlib import Path

from turnout.config.document import Branch, Place, load, plain_values
from turnout.config.key_text import describe_key, yaml_text
from turnout.config.layout_schema import layout_keys
from turnout.config.schema import FleetWideKey, Group, Key, NamedEntries, fit_to_schema
from turnout.config.settings import parts
from turnout.config.settings_page import settings_page
from turnout.config.settings_schema import default_of, settings_keys

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
    tree = load(path) if path.exists() and not defaults else Branch(Place(str(path)))
    fit_to_schema(settings_keys(), tree)
    present = plain_values(tree)
    layout, override = layout_keys(), layout_keys()
    return {
        path: config_yaml(present),
        Path(folder) / "schema" / "config.json": schema(settings_keys(), "config/config.yaml", whole=False),
        Path(folder) / "schema" / "layout.json": schema(layout, "config/layouts/<name>.yaml", whole=True),
        Path(folder) / "schema" / "override.json": schema(override, "config/overrides/<id>.yaml", whole=False),
        Path(docs) / "settings.md": settings_page(),
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
            value = (present.get(name) or {}).get(field.name, default)
            changed = "" if value == default else f"default {yaml_text(default)}; "
            lines += textwrap.wrap(changed + describe_key(key), WIDTH, initial_indent="  # ", subsequent_indent="  # ")
            lines.append(f"  {field.name}: {yaml_text(value)}")
    return "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"


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
