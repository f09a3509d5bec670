"""Names of entries that mean a unit: of the samples, of something else, or of a condition."""

import re
from functools import lru_cache

from turnout.readers.metadata_names import CONDITION_QUANTITIES
from turnout.readers.rate_units import words_of

# A word for a unit, or a compound that ends with one.
UNIT_WORD = re.compile(
    r"[a-z]*(?:(?<!comm)units?|einheit(?:en)?|eenhe(?:id|den)|enhed(?:er)?|enhet(?:er)?)|unites?|unidad(?:es)?|unita"
    r"|jednotk[ay]|uom|eu|unit(?:string|label)"
)
# Units of other things than the samples of a channel.
OTHER_UNITS = re.compile(
    r"time|zeit|temps|tempo|tid|x$|^h$|horiz|rate|freq|sensitiv|empfind|sensib|speed|length|range|limit|gain|type$|damp"
)


@lru_cache(maxsize=4096)
def is_unit_name(name: str) -> bool:
    """Whether a name means the unit of samples.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for the unit of another thing, such as a time.

    Examples
    --------
    >>> [is_unit_name(n) for n in ("unit_string", "Einheit", "YUnit", "time unit", "Sensitivity unit", "community")]
    [True, True, True, False, False, False]
    """
    words = words_of(name)
    is_named = any(UNIT_WORD.fullmatch(word) for word in words) or "".join(words) == "dimension"
    return is_named and not any(OTHER_UNITS.search(word) for word in words)


@lru_cache(maxsize=4096)
def is_unit_of_other(name: str) -> bool:
    """Whether a name means the unit of something else than samples: "time unit".

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for a name without a word for a unit.
    """
    return any(UNIT_WORD.fullmatch(word) for word in words_of(name)) and not is_unit_name(name)


@lru_cache(maxsize=4096)
def conditions_of_unit(name: str) -> frozenset[str]:
    """Conditions of which a name means the unit, as of "rail_temperature_unit", which is none of a channel "rail".

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    frozenset of str
        Names of conditions; of all temperatures for "temperature_unit".

    Examples
    --------
    >>> sorted(conditions_of_unit("Rail temperature unit")), sorted(conditions_of_unit("temperature_unit"))
    (['rail_temperature'], ['air_temperature', 'rail_temperature'])
    >>> sorted(conditions_of_unit("rail_unit")), sorted(conditions_of_unit("rail_temperature"))
    ([], [])
    """
    words = words_of(name)
    if not any(map(UNIT_WORD.fullmatch, words)):
        return frozenset()
    plain = re.sub(r"[ -]", "_", name.strip().lower())
    others = {word for word in words if not UNIT_WORD.fullmatch(word)}

    def is_meant(condition: str) -> bool:
        of_condition = condition.split("_")
        return plain.startswith(condition) or (of_condition[-1] in others and others <= {*of_condition})

    return frozenset(filter(is_meant, CONDITION_QUANTITIES))
