"""What config/layouts/<name>.yaml and config/overrides/<id>.yaml may say."""

from turnout.config.keys import Each, Elsewhere, Group, Key
from turnout.config.settings_keys import settings_keys

LABEL = r"[A-Za-z][A-Za-z0-9-]*"
NAME = r"[A-Za-z][A-Za-z0-9_-]*"
QUANTITIES = ("force", "acceleration", "velocity", "displacement", "strain", "temperature", "ignored")

CHANNEL = {
    "source": Key("name_or_index", "name of the channel in the file, or its number counted from 0", required=True),
    "quantity": Key("text", "what it measures", required=True, choices=QUANTITIES),
    "unit": Key("text", "unit of the numbers in the file; null: as the file says", nullable=True),
    "sensitivity": Key(
        "number", "sensitivity of the sensor; null where the file holds physical units", above=0, nullable=True
    ),
    "sensitivity_unit": Key("text", "its unit: mV/N, mV/g, mV/(m/s²), V/count ..."),
    "sign": Key("integer", "-1 where the sensor is mounted upside down", choices=(1, -1)),
    "offset": Key("number", "place of the sensor from the section's position", unit="m", minimum=-100, maximum=100),
    "mounting": Key("text", "where it sits: hammer, rail head at sleeper, rail head mid-span, rail web, sleeper"),
    "serial": Key("text", "serial number"),
    "limit": Key("number", "range beyond which it clips, in the SI unit of its quantity", above=0, nullable=True),
    "resolution": Key("number", "one step of the converter, in the SI unit of its quantity", above=0, nullable=True),
}
PASSAGE_CHANNEL = {
    **CHANNEL,
    "section": Key("text", "section it watches", required=True, pattern=LABEL),
}
# Below these nothing of a track can be seen; a rate that was meant in kHz lies below them.
HAMMER_RATE = Key("number", "samples per second", unit="Hz", minimum=250, nullable=True)
PASSAGE_RATE = Key("number", "samples per second", unit="Hz", minimum=100, nullable=True)
FILES = {
    "files": Key("text", "pattern of the file names below the turnout's raw folder", required=True),
    "format": Key("text", "reader, one of `turnout check --formats`; auto: by the file itself"),
    "rate": HAMMER_RATE,
    "records": Key("integer", "records in one file; null: not promised", minimum=1, nullable=True),
    "samples": Key("integer", "samples per record; null: not promised", minimum=1, nullable=True),
    "time_zone": Key("text", "time zone of the file's time stamps, an IANA name"),
}
HAMMER = {
    **FILES,
    "force": Key("text", "channel of the hammer", required=True),
    "response": Key("text", "channel that the models are identified from", required=True),
    "validation": Key("text", "second channel, only compared with; null: none", nullable=True),
    "channels": Each(CHANNEL, NAME, "one entry per channel", required=True),
}
PASSAGES = {
    **FILES,
    "rate": PASSAGE_RATE,
    "channels": Each(PASSAGE_CHANNEL, NAME, "one entry per channel", required=True),
}
# What a single section may say otherwise than the rest of the turnout.
SECTION_HAMMER = {name: rule for name, rule in HAMMER.items() if name != "files"}
SECTION = {
    "panel": Key("text", "open track, switch, closure, crossing panel, after the crossing", required=True,
                 choices=("OT", "SP", "CLP", "CP", "AS")),
    "track": Key("text", "track it lies in", required=True, choices=("main", "diverging", "both")),
    "position": Key("number", "place along the turnout, 0 at the switch toe, towards the crossing", unit="m",
                    required=True, minimum=-10000, maximum=10000),
    "pad": Key("text", "railpad"),
    "sleeper": Key("text", "sleeper"),
    "hammer": Group(SECTION_HAMMER, "what differs for this section", fragment=True),
}  # fmt: skip


# Settings that are used once for all turnouts: a whole part, or some of its keys.
FLEET_WIDE: dict[str, tuple[str, ...]] = {"fleet": (), "trend": (), "passage": ("cluster_maximum", "cluster_seed")}


def layout_keys(merged: bool = False) -> dict:
    """Everything a layout or an override may say, settings of its own included; ``merged``: with those of the fleet."""
    return {
        "description": Key("text", "what this layout is, for people"),
        "sections": Each(SECTION, LABEL, "one entry per monitored section", required=True),
        "hammer": Group(HAMMER, "how the hammer tests lie on the disk"),
        "passages": Group(PASSAGES, "how the recordings of train passages lie on the disk"),
        "settings": Group(
            settings_keys() if merged else _own_settings(), "method settings of config.yaml that differ here"
        ),
    }


def _own_settings() -> dict:
    """The settings' keys; those that hold for the whole fleet stand there as belonging elsewhere."""
    found: dict = dict(settings_keys())
    for part, names in FLEET_WIDE.items():
        if names:
            spec = found[part].spec | {name: Elsewhere("config.yaml") for name in names}
            found[part] = Group(spec, found[part].meaning)
        else:
            found[part] = Elsewhere("config.yaml")
    return found
