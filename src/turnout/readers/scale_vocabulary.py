"""Words for the scale of samples in the metadata of any format: factors, offsets, inversions, prefixes, fill values.

A name is compared without case, accents and separators. Certain words are scales whatever follows them; of longer names
only a number counts. Names of other things than the numbers of a channel are neither.
"""

import re
import unicodedata
from functools import lru_cache
from itertools import pairwise

import numpy as np

from turnout.readers.inversions import INVERSION, REVERSED, SIGN, stated_sign
from turnout.readers.metadata_subjects import STRONG, subject_of
from turnout.readers.rate_units import rate_unit, words_of

FACTOR_WORDS = frozenset(
    (
        "scale scaling scalefactor scalingfactor factor calibrationfactor calfactor conversionfactor multiplier gain "
        "slope ymult ygain yscale ordinatescale skalierung skalierungsfaktor faktor kalibrierfaktor verstarkung "
        "facteur facteurdechelle echelle pente skala skalafaktor forstaerkning forstarkning factordeescala escala "
        "ganancia pendiente fattore fattorediscala scala guadagno pendenza"
    ).split()
)
OFFSET_WORDS = frozenset(
    "offset addoffset yoffset intercept yintercept nullpunkt nullpunktverschiebung decalage forskydning "
    "desplazamiento scostamento ordenada versatz baseline ordonneealorigine".split()
)
# Words of longer names that may be a factor or an offset ("InputGain", "Kalibrierfaktor_1"): only a number counts.
POSSIBLE_FACTOR = re.compile(
    r"(?:^|[a-z]{2}|^b)(?<!\ba)gains?$|(?:scale?|skala|escala|scala|echelle)s?$|^escalad|scaling|skali?er|fak?tore?n?$|factors?$|facteurs?$"
    r"|fattor[ei]$|multipl|^mult$|verstark|vorverst|forstaerk|forstark|amplific|^preamp|guadagn|gananc|attenuat"
    r"|abschwach|divis(?:or|eur)$|^divid|^teiler$|prescal|vorteiler|^lsb$|^pga$|^coeff?|^koeff|quantis|umrechn|conversion"
    r"|^polynom|normali[sz]|normier|^quantum$|^verst$|^amp$|^masss?tab$|^multiply$"
)
# Words of an amplifier, and what makes them a setting or a limit.
STRONG_FACTOR = re.compile(
    r"^gains?$|verstark|forstaerk|forstark|amplific|attenuat|guadagn|gananc|zesilen|wzmocn|versterk|^ganho|vahvist"
)
# The amplifier itself, whose value is its model, and what a gain is given in: only a number counts.
AMPLIFIER = re.compile(
    r"verstarker|forstaerker|forstarker|amplificat(?:eu|or|ad)|versterker|wzmacniacz|zesilovac|attenuator"
)
BESIDE_GAIN = re.compile(r"unit|einheit|range|bereich|step|stufe|name|stage|table|label|comment|info|model|^id$|source")
OTHER_GAIN = re.compile(
    r"trigg|control|mode|type|auto|date|datum|number|^n[or]$|max|min|limit|version|error|file|serial"
)
CALIBRATION_WORDS = frozenset("calibration cal calib kalibrierung kalibrering etalonnage taratura calibracion".split())
CALIBRATION = re.compile(r"^(?:cal|kal)(?:ib\w*)?$|^etalonn\w*|^taratura$|^eich\w*|^(?:calib|kalib)\w*(?:wert|value)$")
VALUE = re.compile(r"values?|wert|valeur|valore?|const\w*|konst\w*|weight|gewicht|size|v\w?rdi")
POSSIBLE_OFFSET = re.compile(
    r"offset(?:wert|korrektur)?$|decalage|desplazam|scostam|forskyd|^off?s$|^dc$|^removed$|^subtracted$|abgezogen|^bias$"
    r"|intercept$|^tar[ae]$|^zero$|nullabgleich|nullpunkt|nullwert"
)
STEPS_OF_CONVERTER = re.compile(r"bits?|counts?|lsb|digits?|codes?|quant\w*|eu|unit|div")
NO_SIGN = re.compile(r"off|convention|road|traffic|signals?|call|speed|warning|stop")  # beside "sign"
LEVEL = re.compile(r"dampfung|correct|korrekt|correz")  # a scale if its value is a level in dB
CORRECTION = re.compile(r"correct|korrekt|correz")
PREFIX = re.compile(r"(?:unit|einheit\w*|si)?(?:prefix|vorsatz|prefixe|prefisso|prefijo|praefiks)")
EXPONENT = re.compile(r"(?:scale|unit|decimal)?exponent\d*|zehnerpotenz|poweroften")
# What a number is converted to: "adc_to_volt", "ToSI".
TARGETS = frozenset("si eu volt volts v mv unit units newton newtons n kn g ms physical engineering".split())
CONVERTED = re.compile(r"[a-z]+2([a-z]+)2?")  # "lbf2N"
# Factors and offsets of other things than the numbers of a channel, beside those of ``metadata_subjects``.
OTHER_SCALE = re.compile(
    r"time|zeit|valid|number|^no$|^nr$|freq|rate|power|form|quality|load|sampl|decim|dynamic|posit|byte|pixel|colou?r|axis"
    r"|image|volt(?!s?$|age$)|speed|length|dist|full|range|cross|pad|limit|max|min|cover|peak|^q$|start|begin|mode|type"
    r"|auto|cut|^[xh]$|model"
)
OTHER_OFFSET = re.compile(r"voltage|file|data|block|buffer|header|index")  # a bias, or a position in the file
# What is drawn or shown at a scale: a map, a plot. Words for something that is switched off or sets itself.
DRAWN = re.compile(
    r"(?:site|track|lage|gleis|street)?(?:maps?|plans?|karten?|carte|kort|mappa|mapa|plano)|drawings?|zeichnung|dessin"
    r"|tegning|disegno|dibujo|sketch|images?|bild|photo|foto|display|anzeige|plots?|charts?|diagramm?"
    r"|screen|print\w*|zoom"
)
SCREEN_SCALE = {"vertical", "scale"}  # of the screen of an oscilloscope, per division; its exports are in volts
SWITCHED_OFF = re.compile(
    r"off|none|disabled|deactivated|inactive|aus|ausgeschaltet|abgeschaltet|deaktiviert|keine[rs]?|slukket|ingen|arret"
    r"|auto|automati\w*|agc|desactivee?|aucune?|spento|disattivat[oa]|nessuna?|apagad[oa]|desactivad[oa]|ningun[oa]?"
)
MAX_WORDS_OFF = 4  # of a text that says that something is switched off
PREFIX_VALUES = {
    "k": 1e3, "kilo": 1e3, "m": 1e-3, "milli": 1e-3, "µ": 1e-6, "u": 1e-6, "micro": 1e-6, "mikro": 1e-6, "mega": 1e6,
    "n": 1e-9, "nano": 1e-9, "giga": 1e9, "c": 1e-2, "centi": 1e-2, "d": 1e-1, "deci": 1e-1, "da": 10.0, "h": 100.0,
}  # fmt: skip
FILL_WORDS = frozenset(
    "fillvalue missingvalue nodata nodatavalue invalidvalue novalue nanvalue fehlwert ersatzwert "
    "valeurmanquante manglendevaerdi valoremancante valorfaltante".split()
)
FACTOR, OFFSET, POSSIBLY_FACTOR, POSSIBLY_OFFSET = "factor", "offset", "possibly factor", "possibly offset"
INVERSIONS, PREFIXES, EXPONENTS, LEVELS = "inversion", "prefix", "exponent", "level"
NEUTRAL = {
    FACTOR: 1.0, OFFSET: 0.0, POSSIBLY_FACTOR: 1.0, POSSIBLY_OFFSET: 0.0, INVERSIONS: 1.0, PREFIXES: 1.0,
    EXPONENTS: 1.0, LEVELS: 1.0,
}  # fmt: skip
POLYNOMIAL = re.compile(r"[abcpk][01]")


@lru_cache(maxsize=4096)
def plain_word(name: str) -> str:
    """A name in lower case without accents, separators and a unit in brackets.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    str
        Only its letters and digits.

    Examples
    --------
    >>> plain_word("Scale_Factor [N/V]"), plain_word("Verstärkung")
    ('scalefactor', 'verstarkung')
    """
    letters = unicodedata.normalize("NFKD", re.sub(r"[\[(].*?[\])]", "", name).lower())
    return re.sub(r"[^a-z0-9]", "", letters.replace("æ", "ae").replace("ø", "o").replace("ł", "l"))


def is_scale_name(name: str) -> bool:
    """Whether a name speaks of a factor, an offset or an inversion of the ordinate.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    bool
        True for "gain", "Scale factor", "Skalierung", "Polarity" and the like.
    """
    return bool(scale_meaning(name))


@lru_cache(maxsize=4096)
def scale_meaning(name: str) -> str:
    """Kind of scale of which a name speaks.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    str
        A key of ``NEUTRAL``; "" for any other name.

    Examples
    --------
    >>> [scale_meaning(n) for n in ("gain", "DC offset", "Polarity", "adc_to_volt", "Trigger polarity", "Crest factor")]
    ['factor', 'possibly offset', 'inversion', 'possibly factor', '', '']
    """
    if is_time_per_division(name):
        return ""
    word = plain_word(name)
    stem = word.rstrip("0123456789")
    if stem in FACTOR_WORDS or stem in OFFSET_WORDS:
        return FACTOR if stem in FACTOR_WORDS else OFFSET
    if (converted := CONVERTED.fullmatch(word)) and converted[1] in TARGETS:
        return POSSIBLY_FACTOR
    if EXPONENT.fullmatch(word):
        return EXPONENTS
    words = words_of(re.sub(r"[\[(].*?[\])]", "", name))
    if len(words) > 1 and len(words[-1]) > 1 and (unit := rate_unit(words[-1])) and not unit.is_sampling:
        return ""  # "ntp_offset_ms"
    if (bracket := re.search(r"[\[(](.*?)[\])]", name)) and rate_unit(bracket[1]):
        return ""
    if "per" in words[1:-1]:
        at = words.index("per", 1)
        if {words[at - 1], words[at + 1]} & {"sample", "samples", "value", "channel"}:
            return ""  # "bits per sample"
        is_step = any(STEPS_OF_CONVERTER.fullmatch(w) for w in (words[at - 1], words[at + 1]))
        return POSSIBLY_FACTOR if is_step else ""
    is_correction = any(CORRECTION.match(word) for word in words)
    if any(STRONG_FACTOR.search(word) for word in words):
        if any(OTHER_GAIN.search(word) for word in words):
            return ""
        return POSSIBLY_FACTOR if any(AMPLIFIER.search(w) or BESIDE_GAIN.search(w) for w in words) else FACTOR
    if any(OTHER_SCALE.search(word) for word in words) or is_of_drawing(name) or subject_of(name) == STRONG:
        return ""
    if any(word in ("file", "name") for word in words) or (SCREEN_SCALE <= set(words) or "horizontal" in words):
        return ""
    for pattern, meaning in ((INVERSION, INVERSIONS), (PREFIX, PREFIXES), (EXPONENT, EXPONENTS)):
        if meaning == INVERSIONS and is_other_sign(name):
            continue
        if any(pattern.fullmatch(w) for w in (*words, "".join(words))):
            return meaning
    is_factor = word in CALIBRATION_WORDS or any(POSSIBLE_FACTOR.search(word) for word in words)
    if is_factor or _is_conversion(words) or _is_value_of_step(words):
        return POSSIBLY_FACTOR
    if any(OTHER_OFFSET.search(word) and not (is_correction and word == "voltage") for word in words):
        return ""
    is_offset = any(POSSIBLE_OFFSET.search(w) for w in words) or (is_correction and "offset" in words)
    if is_offset:
        return POSSIBLY_OFFSET
    return LEVELS if any(LEVEL.search(word) for word in words) else ""


def is_other_sign(name: str) -> bool:
    """Whether a name speaks of a signature, a convention or something beside the track, and not of a polarity.

    Parameters
    ----------
    name : str
        Name of an entry.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_other_sign(name) for name in ("Sign-off", "Sign convention", "Road sign", "Sign")]
    [True, True, True, False]
    """
    words = words_of(name)
    return any(map(SIGN.fullmatch, words)) and any(map(NO_SIGN.fullmatch, words))


def _is_conversion(words: tuple[str, ...]) -> bool:
    """Whether words speak of a conversion to a unit: "adc_to_volt", "ToSI"."""
    return any((a == "to" or STEPS_OF_CONVERTER.fullmatch(a)) and b in TARGETS for a, b in pairwise(words))


def _is_value_of_step(words: tuple[str, ...]) -> bool:
    """Whether words speak of a step of the converter or the value of a calibration: "bit_weight", "Kalibrierwert"."""
    if any(CALIBRATION.match(w) for w in words) and (len(words) == 1 or any(VALUE.fullmatch(w) for w in words)):
        return True
    is_step = any(STEPS_OF_CONVERTER.fullmatch(w) for w in words)
    return is_step and len(words) > 1 and any(VALUE.fullmatch(w) for w in words)


@lru_cache(maxsize=4096)
def is_of_drawing(text: str) -> bool:
    """Whether a name or a value speaks of something that is drawn or shown at a scale.

    Parameters
    ----------
    text : str
        Name or value of an entry.

    Returns
    -------
    bool
        True for "1:500 map" and the like.
    """
    return any(DRAWN.fullmatch(word) for word in words_of(text))


# The time that a division of a screen stands for: "Time/div: 1 ms", "Points/div: 25.6", "Timebase: 5 ms/div".
DIVISION = r"(?:\s?/\s?|\s(?:per|pro)\s)div(?:s|isions?)?\b"
NAME_PER_DIVISION = re.compile(
    rf"(?:time|zeit|temps|tid|s|[mun]s|sec|seconds?|points|pts|samples|timebase|horizontal)\b.*{DIVISION}.*",
    re.IGNORECASE,
)
TIME_PER_DIVISION = re.compile(rf"\s*[\d.,]+(?:[eE][+-]?\d+)?\s?(?:s|[mnuµμ]s|sec){DIVISION}\s*", re.IGNORECASE)


def is_time_per_division(name: str, value: object = "") -> bool:
    """Whether an entry states how much time a division of a screen stands for, which is about no sample.

    Parameters
    ----------
    name : str
        Name of the entry.
    value : object
        Its value.

    Returns
    -------
    bool
        False for volts per division, which may be a scale.

    Examples
    --------
    >>> [is_time_per_division(*e) for e in (("Time/div", "1 ms"), ("Timebase", "5 ms/div"), ("Volts/div", "1 V"))]
    [True, True, False]
    """
    text = value if isinstance(value, str) else ""
    is_line = len(re.findall(r"\d+", text)) == 1 and NAME_PER_DIVISION.fullmatch(text.strip())  # "TIME/DIV,500us"
    return bool(is_line or TIME_PER_DIVISION.fullmatch(text) or NAME_PER_DIVISION.fullmatch(name.strip()))


SCALE_OF_DRAWING = re.compile(r"(?:drawing|map|plan)?scale|massstab|echelle|escala|scala|skala")
RATIO_OF_DRAWING = re.compile(r"1 ?[:/] ?\d{3,}")


def is_ratio_of_drawing(name: str, value: object) -> bool:
    """Whether an entry that stands at no channel is the scale of a drawing, which has 1:100 and smaller ones.

    Parameters
    ----------
    name : str
        Name of the entry.
    value : object
        Its value.

    Returns
    -------
    bool
        False for the gain of an amplifier, and for 1:10, which may be one.

    Examples
    --------
    >>> [is_ratio_of_drawing(*e) for e in (("Maßstab", "1:1000"), ("Gain", "1:500"), ("Scale", "1:10"), ("Scale", 500))]
    [True, False, False, False]
    """
    value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    is_ratio = isinstance(value, str) and RATIO_OF_DRAWING.fullmatch(value.strip()) is not None
    return is_ratio and SCALE_OF_DRAWING.fullmatch("".join(words_of(name))) is not None


def says_no_scale(text: str) -> bool:
    """Whether the value under a name of a scale states none of the samples: that of a drawing, or off, or automatic.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    bool
        False for a number other than a ratio, whatever its words.

    Examples
    --------
    >>> [says_no_scale(text) for text in ("1:500 map", "auto", "1:500", "10 (auto off)", "off by 10")]
    [True, True, False, False, False]
    """
    without_ratio = re.sub(r"\b1 ?[:/] ?\d+\b", "", text)
    if re.search(r"\d", without_ratio):
        return False
    words = words_of(text)
    is_off = without_ratio == text and len(words) <= MAX_WORDS_OFF and any(SWITCHED_OFF.fullmatch(w) for w in words)
    return is_off or is_of_drawing(text)


@lru_cache(maxsize=4096)
def is_fill_name(name: str) -> bool:
    """Whether a name speaks of the number that stands for a missing sample.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    bool
        True for "_FillValue", "NoData" and the like.
    """
    return plain_word(name) in FILL_WORDS


def value_of_word(meaning: str, value: object, name: str = "") -> float | None:
    """The factor that a text stands for under a name of an inversion, a prefix or an exponent.

    Parameters
    ----------
    meaning : str
        As ``scale_meaning`` returns it.
    value : object
        Value of the entry.
    name : str
        Its name.

    Returns
    -------
    float or None
        1 for a value that changes nothing or is not understood; -1 for one of an inversion; None for any other meaning
        of scale.

    Examples
    --------
    >>> [value_of_word("inversion", value) for value in ("Verpolt", "nicht invertiert", "rail", 0)]
    [-1.0, 1.0, 1.0, 1.0]
    >>> value_of_word("prefix", "k"), value_of_word("exponent", -3)
    (1000.0, 0.001)
    """
    text = str(value.decode("utf-8", "replace") if isinstance(value, bytes) else value).strip()
    if meaning == INVERSIONS:
        return -1.0 if stated_sign(name or "polarity", text) == REVERSED else 1.0
    if meaning == PREFIXES:
        return 1e6 if text == "M" else PREFIX_VALUES.get(text.casefold().replace("\u03bc", "µ"), 1.0)
    if meaning == LEVELS:
        match = re.fullmatch(r"([+-]?\d+(?:[.,]\d+)?)\s*dB", text, re.IGNORECASE)
        return 10.0 ** (float(match[1].replace(",", ".")) / 20.0) if match else 1.0
    if meaning == EXPONENTS:
        match = re.fullmatch(r"[+-]?\d{1,2}(?:\.0*)?", text)
        return 10.0 ** float(text) if match else 1.0
    return None
