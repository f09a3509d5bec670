"""Keys of layouts and overrides: sections, hammer tests, passages, channels and the settings that they may contain."""

from turnout.config.schema import LABEL, FleetWideKey, Group, Key, NamedEntries
from turnout.config.settings_schema import settings_keys

PANELS = ("OT", "SP", "CLP", "CP", "AS")
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
    "offset": Key(
        "number",
        "position of the sensor from the section's position; at mid-span in a hammer test by default half a bay",
        unit="m",
        minimum=-100,
        maximum=100,
    ),
    "mounting": Key("text", "where it sits: hammer, rail head at sleeper, rail head mid-span, rail web, sleeper"),
    "serial": Key("text", "serial number"),
    "limit": Key("number", "range beyond which it clips, in the SI unit of its quantity", above=0, nullable=True),
    "resolution": Key("number", "one step of the converter, in the SI unit of its quantity", above=0, nullable=True),
}
PASSAGE_CHANNEL = {
    **CHANNEL,
    "section": Key("text", "section at which it is mounted; required unless quantity is ignored", pattern=LABEL),
}
# Minimum rates: below them a recording shows no mode of the track. They also catch a rate written in kHz.
# Maximum rates: no converter for these sensors is faster. They catch a rate with a digit too many.
MAX_RATE = 10_000_000
MAX_COUNT = 10**12  # records, or samples of a record: above it a typing error
HAMMER_RATE = Key("number", "samples per second", unit="Hz", minimum=250, maximum=MAX_RATE, nullable=True)
PASSAGE_RATE = Key("number", "samples per second", unit="Hz", minimum=100, maximum=MAX_RATE, nullable=True)
FILES = {
    "files": Key("text", "pattern of the file names below the turnout's raw folder", required=True),
    "format": Key("text", "reader, one of `turnout check --formats`; auto: by the file itself"),
    "rate": HAMMER_RATE,
    "records": Key("integer", "records in one file; null: any number", minimum=1, maximum=MAX_COUNT, nullable=True),
    "samples": Key("integer", "samples per record; null: any number", minimum=1, maximum=MAX_COUNT, nullable=True),
    "time_zone": Key("text", "time zone of the file's time stamps, an IANA name"),
    "checked_entries": Key("text", "entries of the files that state neither rate, scale nor unit; separated by ;"),
}
HAMMER = {
    **FILES,
    "force": Key("text", "channel of the hammer", required=True),
    "response": Key("text", "channel that the models are identified from", required=True),
    "validation": Key("text", "second response; identify.second_response says what for; null: none", nullable=True),
    "channels": NamedEntries(CHANNEL, LABEL, "one entry per channel", required=True),
}
PASSAGES = {
    **FILES,
    "rate": PASSAGE_RATE,
    "channels": NamedEntries(PASSAGE_CHANNEL, LABEL, "one entry per channel", required=True),
}
# Keys that a single section may set differently from the turnout.
SECTION_HAMMER = {name: rule for name, rule in HAMMER.items() if name != "files"}
SECTION = {
    "panel": Key("text", "open track, switch, closure, crossing panel, after the crossing", required=True,
                 choices=PANELS),
    "track": Key("text", "track it lies in", required=True, choices=("main", "diverging", "both")),
    "position": Key("number", "position along the turnout, 0 at the switch toe, towards the crossing", unit="m",
                    required=True, minimum=-10000, maximum=10000),
    "pad": Key("text", "railpad"),
    "sleeper": Key("text", "sleeper"),
    "hammer": Group(SECTION_HAMMER, "what differs for this section", fragment=True),
}  # fmt: skip


# Settings that hold for the whole fleet: a whole section (empty tuple), or some of its keys.
FLEET_WIDE: dict[str, tuple[str, ...]] = {
    "alerts": (),
    "fleet": (),
    "trend": (),
    "passage": ("cluster_maximum", "cluster_seed"),
}


def layout_keys(merged: bool = False) -> dict:
    """Keys of a layout or an override, its own settings included.

    Parameters
    ----------
    merged : bool
        With the settings that hold for the whole fleet, as after merging.

    Returns
    -------
    dict
        Name -> Key, Group or NamedEntries.
    """
    return {
        "description": Key("text", "what this layout is, for people"),
        "sections": NamedEntries(SECTION, LABEL, "one entry per monitored section", required=True),
        "hammer": Group(HAMMER, "how the hammer tests lie on the disk"),
        "passages": Group(PASSAGES, "how the recordings of train passages lie on the disk"),
        "settings": Group(
            settings_keys() if merged else _layout_settings(), "method settings of config.yaml that differ here"
        ),
    }


def _layout_settings() -> dict:
    """The keys of the settings; those that hold for the whole fleet are marked as such."""
    keys: dict = dict(settings_keys())
    for section, names in FLEET_WIDE.items():
        if names:
            spec = keys[section].spec | {name: FleetWideKey("config.yaml") for name in names}
            keys[section] = Group(spec, keys[section].meaning)
        else:
            keys[section] = FleetWideKey("config.yaml")
    return keys
