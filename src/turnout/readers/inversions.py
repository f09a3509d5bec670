"""Values under a name of an inversion, such as "Polarity": which of them leave the sign of the numbers as it is."""

import re
from collections.abc import Sequence
from functools import lru_cache

from turnout.readers.rate_units import words_of
from turnout.readers.stated_numbers import number_and_unit

INVERSION = re.compile(
    r"polari[td]\w*|polaryz\w*|invert\w*|invers\w*|inverz\w*|inwer[st]\w*|neg(?:ative?)?|vorzeichen|sign|signe|segno|signo|fortegn"
    r"|flipped|reversed|negated|negiert|odwroc\w*|obracen\w*"
)
SIGN = re.compile(r"signe?|segno|signo")  # a signature or a road sign as well: of a polarity by its value alone
# Names that say themselves that the sign is reversed; any other says which sign it is.
INVERTED_NAME = re.compile(
    r"invert\w*|invers\w*|inverz\w*|inwer[st]\w*|neg(?:ative?)?|flipped|reversed|negated|negiert|odwroc\w*|obracen\w*"
)
CHANNELS_NAME = re.compile(r"channels?|kan[aea]+le?r?|voies?|sensors?|sensoren|kanal")
# What leaves the sign of the numbers as it is, and what only says that somebody looked at it.
NEUTRAL_WORDS = frozenset(
    "normal normale normaal normalni normalny normalna norm standard std default regular regulier unchanged original "
    "correct unverandert uandret inchange inchangee positive positiv positif positivo positiva positief kladna kladny "
    "dodatnia dodatni plus pos no nein non nej nee ne nie ei false falsch faux falso falsk nepravda falsz off arret "
    "aus uit vypnuto wylaczone slukket fra apagado spento none keine kein aucun aucune ningun ninguno nessuno ingen "
    "zadna zaden geen uninverted unflipped noninverted noninverting inphase up upward upwards bipolar "
    "unipolar".split()
)
CHECKED_WORDS = frozenset(
    "ok okay checked verified gepruft geprueft kontrolliert uberpruft kontrolleret verifie verifiee verifiees "
    "controlled tested getestet testet".split()
)
OTHER_POLARITY = frozenset("supply power battery trigger versorgung speisung alimentation plug stecker cable".split())
REVERSING = re.compile(
    r"inv|invert\w*|invers\w*|inverz\w*|inwer[st]\w*|neg\w*|rev|revers\w*|flip\w*|minus|opposite|umge\w*|umkehr\w*|verpolt|gedreht|vertauscht"
    r"|przeciwn\w*|wrong|omvendt|ompolet|zaporn\w*|ujemn\w*|swapped|odwroc\w*|obracen\w*"
)
PARTS = re.compile(r"[()\[\]/;,|:=.]|\b(?:but|sondern|mais|men)\b")
NEGATIVE = re.compile(r"neg\w*|zaporn\w*|ujemn\w*|minus")
CHANGED_SIGN = re.compile(r"anders|andere[rs]?|different|other|wrong|changed|geandert|verkehrt")  # in a free text
REVERSING_NUMBER = re.compile(r"(?<![\w.,])(?:-\s?1|[+-]?180)(?:[.,]0+)?(?![.,]?\d)")
AFFIRMATIONS = frozenset("true yes ja oui si ano tak wahr vrai vero y t j on enabled ein x".split())
DENIALS = frozenset(
    "not no non nicht kein keine keiner ikke ej nej ne nie niet pas sans without never ohne uden aucun aucune ningun "
    "ninguno nessuno nessuna ingen zadna zaden geen".split()
)
# A sign that is the normal one in some layouts only.
DOWN = frozenset("down downward downwards unten abwarts nedad tension traction".split())
NO_VALUE = frozenset(("", "n/a", "n.a.", "na", "?", "unknown", "nan", "null", "undefined", "not set", "[]"))
MAX_DENIED = 2  # words between a denial and what it denies
MAX_CHANNEL = 64  # a larger number is none of a channel
HALF_TURN = 180.0  # degrees
KEPT, REVERSED, UNCLEAR = 1.0, -1.0, 0.0


@lru_cache(maxsize=4096)
def stated_sign(name: str, text: str) -> float:
    """What a value under a name of an inversion says about the sign of the numbers.

    Parameters
    ----------
    name, text : str
        Name and value of the entry.

    Returns
    -------
    float
        ``REVERSED`` only for a word or a number of an inversion that nothing denies; ``KEPT`` for words of the normal
        sign, of a check, and for no value; ``UNCLEAR`` for all that is not understood.

    Examples
    --------
    >>> [stated_sign("Polarity", text) for text in ("Normal (not inverted)", "(+)", "checked", "minus", "ISO", "N")]
    [1.0, 1.0, 1.0, -1.0, 0.0, 0.0]
    >>> [stated_sign(*entry) for entry in (("Inverted", "yes"), ("Inverted", "N"), ("Sign", "JH"), ("Sign", "-1"))]
    [-1.0, 1.0, 1.0, -1.0]
    """
    plain = re.sub(r"[\u2212\u2013]", "-", text).casefold().strip(" ()[]'\"")
    names = words_of(name)
    is_inverted_name = any(map(INVERTED_NAME.fullmatch, names))
    if plain in NO_VALUE or (plain == "-" and is_inverted_name):
        return KEPT
    if plain == "-" or REVERSING_NUMBER.search(plain) or _is_reversed(plain):
        return REVERSED
    if plain.startswith("+"):
        return KEPT
    words = words_of(text)
    if is_inverted_name and (sign := _sign_under_inverted(plain, words, any(map(CHANNELS_NAME.fullmatch, names)))):
        return sign
    if (stated := number_and_unit(plain)) and (stated[0] == 0.0 or not _is_flag(stated[0])):
        return KEPT
    is_only_sign = not any(INVERSION.fullmatch(w) and not SIGN.fullmatch(w) for w in names)
    if is_only_sign and not is_inverted_name:
        return KEPT  # the initials of somebody
    return KEPT if leaves_sign(plain) else UNCLEAR


def _sign_under_inverted(plain: str, words: tuple[str, ...], is_list: bool) -> float | None:
    """The sign that a flag, or a channel, states under a name such as "Inverted"; None if it is neither."""
    stated = number_and_unit(plain)
    if stated:
        return REVERSED if 0.0 < stated[0] <= MAX_CHANNEL and _is_flag(stated[0]) else None
    if words == ("n",) or words == ("f",):
        return KEPT
    is_affirmed = len(words) == 1 and words[0] in AFFIRMATIONS
    return REVERSED if is_affirmed or (is_list and words and not leaves_sign(plain)) else None


def _is_flag(number: float) -> bool:
    """Whether a number may be a flag, the number of a channel or a half turn, and not that of a peak or the like."""
    return (number == -1.0 or abs(number) == HALF_TURN or 0.0 < number <= MAX_CHANNEL) and number.is_integer()


def _is_reversed(text: str) -> bool:
    """Whether a text has a word of an inversion without a denial before it, and none of the normal sign."""
    reversing = [
        word
        for part in PARTS.split(text)
        for words in (words_of(part),)
        for i, word in enumerate(words)
        if REVERSING.fullmatch(word) and not _is_denied(words, i)
    ]
    if {"positive", "positiv", "positif", "pos"} & set(words_of(text)):  # "tension negative, compression positive"
        reversing = [word for word in reversing if not NEGATIVE.fullmatch(word)]
    return bool(reversing)


def _is_denied(words: Sequence[str], i: int) -> bool:
    return not DENIALS.isdisjoint(words[max(0, i - MAX_DENIED) : i])


def leaves_sign(text: str) -> bool:
    """Whether a text without a word of an inversion says that the sign is the normal one, or was checked.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    bool
        False for all that is not understood.

    Examples
    --------
    >>> [leaves_sign(text) for text in ("Normal", "positive up", "not inverted", "as is", "rail", "not normal")]
    [True, True, True, True, False, False]
    """
    words = words_of(text)
    if words == ("as", "is") or words == ("in", "phase"):
        return True
    is_denied = any(REVERSING.fullmatch(w) and _is_denied(words, i) for i, w in enumerate(words))
    says_normal = any(
        word in NEUTRAL_WORDS | CHECKED_WORDS and (len(words) == 1 if word in DENIALS else not _is_denied(words, i))
        for i, word in enumerate(words)
    )
    is_not_normal = any(w in NEUTRAL_WORDS - DENIALS and _is_denied(words, i) for i, w in enumerate(words))
    return is_denied or (says_normal and not is_not_normal and (DOWN.isdisjoint(words) or "compression" in words))


PHASE = re.compile(
    r"(?:phase|fase|faze|faza)(?:n?(?:lage|winkel|drehung|verschiebung)|shift|angle)?|dephasage|desfase|sfasamento"
)
OTHER_PHASE = re.compile(r"reference|start|works?|construction|[abc]|l[123]|excitation")  # of a generator, of works
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
    if not is_phase_name(name):
        return False
    stated = number_and_unit(text)
    return PI.fullmatch(text.strip()) is not None or (stated is not None and abs(stated[0]) == HALF_TURN)


def is_phase_name(name: str) -> bool:
    """Whether a name means the phase of a signal, and not that of a generator or of works.

    Parameters
    ----------
    name : str
        Name of an entry.

    Returns
    -------
    bool
    """
    words = words_of(name)
    return any(map(PHASE.fullmatch, words)) and not any(map(OTHER_PHASE.fullmatch, words))


POLARITY = re.compile(r"polari[td]\w*|polaryz\w*|vorzeichen|fortegn")


def sign_in_text(text: str) -> float:
    """What a free text that speaks of a polarity or a sign says about the sign of the numbers.

    Parameters
    ----------
    text : str
        Words of a note.

    Returns
    -------
    float
        ``REVERSED``, ``KEPT`` or ``UNCLEAR``; ``KEPT`` for a text that speaks of none, a check, a supply or a trigger.

    Examples
    --------
    >>> [sign_in_text(text) for text in ("Vorzeichen anders als sonst", "polarity checked", "polarity ISO", "new rail")]
    [-1.0, 1.0, 0.0, 1.0]
    """
    words = words_of(text)
    if not any(map(POLARITY.fullmatch, words)) or not OTHER_POLARITY.isdisjoint(words):
        return KEPT
    is_changed = any(CHANGED_SIGN.fullmatch(w) and not _is_denied(words, i) for i, w in enumerate(words))
    if _is_reversed(text.casefold()) or is_changed:
        return REVERSED
    is_kept = leaves_sign(text) or any(word in NEUTRAL_WORDS or word in DENIALS for word in words)
    return KEPT if is_kept else UNCLEAR
