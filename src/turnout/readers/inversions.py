"""Values under a name of an inversion, such as "Polarity": which of them leave the sign of the numbers as it is."""

import re
from functools import lru_cache

from turnout.readers.rate_units import words_of
from turnout.readers.stated_numbers import number_and_unit

INVERSION = re.compile(
    r"polari[td]\w*|polaryz\w*|invert\w*|invers\w*|inverz\w*|neg(?:ative?)?|vorzeichen|sign|signe|segno|signo|fortegn"
    r"|flipped|reversed|negated|negiert|odwroc\w*|obracen\w*"
)
# What leaves the sign of the numbers as it is. Any other value is reported.
NEUTRAL_WORDS = frozenset(
    "normal normale normaal normalni normalny normalna standard default regular regulier unchanged original correct "
    "positive positiv positif positivo positiva positief kladna kladny dodatnia dodatni plus pos "
    "no nein non nej nee ne nie ei false falsch faux falso falsk nepravda falsz off aus arret uit vypnuto wylaczone "
    "slukket fra apagado spento none keine kein aucun aucune ningun ninguno nessuno ingen zadna zaden geen uninverted "
    "unflipped noninverted noninverting inphase".split()
)
DENIALS = frozenset("not no non nicht keine kein ikke ej nej ne nie niet pas sans without in".split())
BESIDE_INVERSION = frozenset("phase inversion polarity polaritat polarite polarita sense deg degrees".split())
NO_VALUE = frozenset(("", "n/a", "n.a.", "na", "?", "unknown", "nan", "null", "undefined", "not set", "[]"))
MAX_CHANNEL = 64  # a larger number is none of a channel
HALF_TURN = 180.0  # degrees


@lru_cache(maxsize=4096)
def leaves_sign(text: str) -> bool:
    """Whether a value under a name of an inversion leaves the sign of the numbers as it is.

    Parameters
    ----------
    text : str
        Value of the entry.

    Returns
    -------
    bool
        True for words of a closed list alone, denials, zero, and no value; False for all that is not understood.

    Examples
    --------
    >>> [leaves_sign(text) for text in ("Normal", "+1", "not inverted", "0°", "minus", "180", "rail", "N")]
    [True, True, True, True, False, False, False, False]
    """
    plain = text.replace("\u2212", "-").strip().casefold()
    if plain in NO_VALUE or plain == "+":
        return True
    if stated := number_and_unit(plain):
        return plain.startswith("+1") or stated[0] == 0.0 or _is_of_other_quantity(stated[0])
    words = words_of(text)
    if not words or re.search(r"[1-9]", plain):
        return False
    if words[0] in DENIALS and len(words) > 1:
        return all(INVERSION.fullmatch(word) or word in BESIDE_INVERSION for word in words[1:])
    return all(word in NEUTRAL_WORDS or word in BESIDE_INVERSION for word in words)


def _is_of_other_quantity(number: float) -> bool:
    """Whether a number is no flag, no number of a channel and no half turn: it is that of a peak or the like."""
    is_of_sign = number == -1.0 or abs(number) == HALF_TURN or 0.0 < number <= MAX_CHANNEL
    return not (is_of_sign and number.is_integer())


PHASE = re.compile(
    r"(?:phase|fase|faze|faza)(?:n?(?:lage|winkel|drehung|verschiebung)|shift|angle)?|dephasage|desfase|sfasamento"
)
PI = re.compile(r"[+-]?(?:pi|\u03c0)(?: ?rad)?", re.IGNORECASE)


def is_half_turn(name: str, text: str) -> bool:
    """Whether an entry states a phase of half a turn, which reverses the sign.

    Parameters
    ----------
    name, text : str
        Name and value of the entry.

    Returns
    -------
    bool
        False for any other phase, and for a phase of works on the track.

    Examples
    --------
    >>> [is_half_turn(*entry) for entry in (("Phase rail", "180°"), ("Phasenlage", "-180.0"), ("Phase", "2"))]
    [True, True, False]
    """
    if not any(map(PHASE.fullmatch, words_of(name))):
        return False
    stated = number_and_unit(text)
    return PI.fullmatch(text.strip()) is not None or (stated is not None and abs(stated[0]) == HALF_TURN)


POLARITY = re.compile(r"polari[td]\w*|polaryz\w*|vorzeichen|fortegn")


def speaks_of_inversion(text: str) -> bool:
    """Whether a free text speaks of a polarity or a sign and does not say that it is the normal one.

    Parameters
    ----------
    text : str
        Words of a note.

    Returns
    -------
    bool

    Examples
    --------
    >>> [speaks_of_inversion(text) for text in ("Vorzeichen anders als sonst", "normal polarity", "new rail")]
    [True, False, False]
    """
    words = words_of(text)
    return any(map(POLARITY.fullmatch, words)) and not any(w in NEUTRAL_WORDS or w in DENIALS for w in words)
