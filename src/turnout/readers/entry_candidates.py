"""What a value of the metadata may state about the samples, by its form and the words beside it.

A value is a candidate for a rate, a scale or a unit if its unit is one of frequency, time or amplitude, if it says how
numbers become others ("x100", "1 V = 10 g", "inverted"), or if it is a bare number that a device may have as a setting.
Values that other modules compare with the layout are none. Under a name that speaks of something else as a whole
(``explained_subject``) only a unit of sampling and a number that can be the rate in another unit are. Under a name of
which only some words do, every candidate is a weak one.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

from turnout.readers.inversions import REVERSED, UNCLEAR, is_half_turn, sign_in_text, stated_sign
from turnout.readers.metadata_subjects import (
    LENGTH,
    NONE,
    SENSITIVITY_STEMS,
    STRONG,
    WEAK,
    explained_subject,
    subject_of,
)
from turnout.readers.number_meanings import is_code, is_inverse_of_rate, number_value, rates_of_number
from turnout.readers.precision import Interval, readings
from turnout.readers.rate_statements import USUAL_RATES, statements_of_value
from turnout.readers.rate_units import PER, SECONDS, RateUnit, rate_unit, words_of
from turnout.readers.rate_vocabulary import CERTAIN, NAME_WITH_UNIT, SAMPLING, SHORT_UNIT, name_meaning
from turnout.readers.scale_vocabulary import (
    INVERSIONS,
    LEVELS,
    is_fill_name,
    is_other_sign,
    is_ratio_of_drawing,
    is_scale_name,
    plain_word,
    scale_meaning,
)
from turnout.readers.source import CONDITIONS, SIMULATED_CONDITIONS
from turnout.readers.stated_counts import is_block_name
from turnout.readers.stated_quantities import quantity_of_text
from turnout.readers.stated_units import known_unit
from turnout.readers.time_texts import looks_dated
from turnout.readers.unit_names import UNIT_WORD, is_unit_of_other
from turnout.units import Conversion, in_latin

RATE, SCALE, UNIT, DURATION = "sampling rate", "scale", "unit", "duration"
RATE_OR_SCALE, SCALE_OR_OFFSET = "rate, scale or offset", "scale or offset"
AMPLITUDES = frozenset(("force", "acceleration", "voltage", "count"))
ORDINATES = AMPLITUDES | {"velocity", "displacement", "strain"}
MAX_TEXT = 1000  # characters of a text that are searched
MIN_PER_SECOND = 1000.0  # a name that ends with seconds may mean a number per second from here on: "ndata_sec"
MIN_LIMIT = 0.01  # a smaller number is no count, limit or size
RATES_IN_TEXT = (2000.0, 1e6)  # Hz: round numbers in a text that may be a rate
MAX_WORDS = 12  # of a text that says what was done to the samples
MAX_LABEL = 3  # words of a quantity with its unit
MAX_SIZE = 40  # characters of a candidate that are shown

LETTER = r"(?:[^\W\d_]|[°%‰])"
PER_SECOND = rf"(?:{'|'.join(sorted(PER))})\.? (?:{'|'.join(sorted(SECONDS, key=len, reverse=True))})\b"
QUANTITY = re.compile(
    r"(?<![\d.,^])(?!\d\dE\d\b)([+-]?(?:\d+(?:[.,'’\u00a0\u202f]\d+)*|[.,]\d+)(?:[eE][+-]?\d+)?)"
    rf"(?:[ \u00a0-]?({PER_SECOND}|(?!x\d){LETTER}+[²³]?(?:\^?-?\d(?![\d.,]))?"
    rf"(?:/\(?{LETTER}+[²³]?(?:\^?\d)?\)?){{0,3}}(?: {PER_SECOND})?))?"
)
BARE_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
WHOLE_NUMBER = re.compile(r"\+?\d+(?:\.0*)?")
UPPER_FACTOR = re.compile(r"X\d+")
WORD_AND_NUMBER = re.compile(r"([^\W\d_]{2,})[\s:=]{1,3}([+-]?\d+(?:\.\d+)?)")
GROUPED_DIGITS = re.compile(r"\d{1,3} \d{3}\b")
PIECES = re.compile(r"[;|\n]|,(?!\d)")
NAMED = re.compile(r"(?:.*[:=]\s*)?([^\W\d][^:=]{0,40}?)\s*[:=]\s*([^:=]+|\d+\s?:\s?\d+)")
PART_OF_SECOND = re.compile(r"\b1\s?/\s?(\d[\d.,' ]*)\s?(s|sec|ms)\b")  # "1/20000 s"
# Words of a name that means the duration of the recording: "Duration [s]", "Total measurement time", "Messdauer".
DURATION_WORD = re.compile(
    r"durations?|dauer|duree|durata|duracion|varighed|(?:mess|aufnahme|aufzeichnungs)(?:dauer|zeit)|acquisition|mesure"
    r"|misura|medicion|recor(?:d|ding|ded)|measur(?:ement|ing|ed)"
)
BESIDE_DURATION = frozenset("total time length of the s sec second seconds min".split())
RATIO = re.compile(r"(\d+)\s?:\s?(\d+)")
# How numbers become others: "x100", "10fach", "2.5*x", "1 V = 10 g", "0.3 mV/bit", "Q1.15".
CONVERSION = re.compile(
    r"(?:^|(?<=[\s=,;(]))[x×*]\s?(?:(?!1(?![\d.,]))\d|[-\u2212]\s?1(?![\d.,]|\s?[cmk]?m\b))|(?<![\w.,])(?!1\s?[x×])\d[\d.,]*\s?(?:[x×](?=$|[\s,;)]|\s?[+-]\s?\d)|-?fach|-?fold)"
    r"|\b(?:gain|factor|faktor|facteur|fattore|scale)s?\b[^\d;,]{0,8}(?!1(?![\d.,]))\d|\b(?:re)?scaled\b[^\d;,]{0,8}\d"
    r"|\bslope\b[^;]{1,20}\b(?:intercept|offset)\b|\b(?:times|fois|mal|gange)\b|\b[abm]\s?=\s?[+-]?[\d.]+|\d\s?[*·⋅]|[*·⋅]\s?\d|\b(?:raw|value|counts?|x|lsb|adc)\s?[/*]\s?\d|\by\s?="
    rf"|\d\s?{LETTER}+\s?=\s?[+-]?[\d.,]+\s?{LETTER}+"
    r"|(?:/\s?|\bper\s)(?:bit|lsb|count|digit|code|step|adu|div)s?\b|\b(?-i:Q)\d{1,2}(?:\.\d{1,2})?\b",
    re.IGNORECASE,
)
UNIT_IN_TEXT = re.compile(
    rf"(?:\b(?:in|en|as|i|im)\s*[:=]?\s+(?:units of\s+)?|(?<!/)[\[(]\s*|[,/|:]\s+)"
    rf"({LETTER}+[²³]?(?:\^?\d)?(?:/{LETTER}+[²³]?(?:\^?\d)?)?)(?=$|[\s\]),;.|'’])(?!\)\s?/)"
)
LABEL_WITH_UNIT = re.compile(rf"([^\W\d_]+)[_ ]({LETTER}+(?:/{LETTER}+[²³]?)?)")
LEVEL_UNIT = re.compile(r"dB", re.IGNORECASE)
# Units of force and acceleration that a layout cannot state.
FOREIGN_UNIT = re.compile(
    r"[kM]?(?:lbf?s?|pounds?|kips?|dyn(?:es?)?|[tT]onf|ozf|pdl)|Gal|gal|gees?|milli-?g|g's|[mµ]Gal|µN|µg|k?gf|ksi|psi|Vrms|Vpk"
)
# Units of other things than samples, rates and times.
HARMLESS_UNIT = re.compile(
    r"°?[CF]|K|%|‰|ppm|[kmcµu]?m[²³]?|in|ft|kg|t|lb|oz|[mk]?A|Ah|[mk]?W|[kM]?(?:Ohm|Ω)|[pnµu]?F|[mh]?Pa|m?bar|k[mg]/[^\W\d_]+|mph"
    r"|m/s|rpm|deg|°|rad|[kMG]i?B|bytes?|bits?|Bit|[kMG]?N/mm?|ch|div|dBm|year|y|a|d|h|min|MGT(?:/y)?"
)
# Words for what was done to the samples, for what was not, and for what should have been.
CHANGED = re.compile(
    r"raw|roh\w{0,6}|brut|unscaled|unskaliert|uncalibrated|unkalibriert|counts?|imperial|customary|inv|invert\w*|invers\w*"
    r"|revers(?:ed|al)|negat(?:e|ed|ive)|flip(?:ped)?|normali[sz]\w*|normier\w*|amplified|verstarkt|amplifie|attenuated"
    r"|umgepolt|verpolt|prepolovan\w*|ompolet"
    r"|multipl(?:y|ied|ier)|multipliz\w*|divided|resampled|decimated|downsampled|integrated|differentiated|binary|voltage|volts|percent"
)
# Names of the way in which an oscilloscope records, where "raw" is none of averages or envelopes.
TYPE_WORDS = frozenset("type mode acquisition acq waveform trace".split())
INVERTED = re.compile(r"inv|invert\w*|flip\w*|negat\w*|revers\w*|raw")
DENIED = re.compile(
    r"no|not|nicht|ikke|niet|none|nein|non|nej|ingen|off|false|0|normal|without|ohne|sans|uden|never|kein\w*"
)
CONVERTED = re.compile(
    r"scaled|skaliert|calibrated|kalibriert|converted|umgerechnet|physical|physikalisch|si|etalonne|compensated|applied|abgezogen|removed|subtracted"
    r"|angewend\w*|applique\w*"
)
AFFIRMED = frozenset("yes true ja oui si on 1".split())
# Names that a format defines: start of the abscissa, state of the scaling, versions, numbers of dimensions.
STANDARD_NAMES = frozenset(
    ("x0", "tstart", "xstart", "hoffset", "wfstartoffset", "niscalingstatus", "startoffset", "feature", "major",
     "minor", "writerversion", "readerversion", "netcdf4dimid", "netcdf4coordinates", "nidatatype", "nichannellength")
)  # fmt: skip
NO_STATEMENT = frozenset(("", "-", "n/a", "na", "?", "unknown", "nan", "null", "undefined", "not set"))
DATED = re.compile(r"\d{1,4}[-./]\s?\d{1,2}[-./]\s?\d{1,4}|\d{2}:\d{2}(?::\d{2})?|\d{1,2}[-. ][A-Za-z]{3}[-. ]\d{2,4}")


@dataclass(frozen=True)
class Candidate:
    """What a value may state: ``statement`` says of what, ``text`` are its words.

    ``is_weak`` is True if only little speaks for it. ``rates`` are the sampling rates that it may mean. ``number`` is
    the bare number, NaN if it has a unit; ``unit`` the unit if the text is one; ``seconds`` the times it may mean. [s]
    ``is_of_other`` is True if the name speaks of something else: then only a number that contradicts the rate plainly
    counts. ``is_of_record`` is True if the name means the duration of the recording and nothing else.
    """

    statement: str
    text: str
    is_weak: bool = False
    rates: tuple[Interval, ...] = ()
    number: float = float("nan")
    unit: str = ""
    seconds: tuple[float, ...] = ()
    is_of_other: bool = False
    is_of_record: bool = False


@lru_cache(maxsize=16384)
def candidates(name: str, group: str, text: str) -> tuple[Candidate, ...]:
    """What a value may state about the samples, without what its name explains.

    Parameters
    ----------
    name, group : str
        Name of the entry, and that of its group.
    text : str
        Its value.

    Returns
    -------
    tuple of Candidate
        Empty for a value that states nothing.

    Examples
    --------
    >>> [c.statement for c in candidates("Mode", "", "20 kS/s @ 24 bit")], candidates("Filter", "", "BE 5 kHz")
    (['sampling rate'], ())
    """
    text = in_latin(" ".join(text[:MAX_TEXT].split()))
    is_standard = plain_word(name) in STANDARD_NAMES or is_scale_name(group)
    if is_standard or text.casefold() in NO_STATEMENT or DATED.match(text) or looks_dated(text):
        return ()
    return tuple(_of_entry(name, group, text))


def _of_entry(name: str, group: str, text: str) -> Iterator[Candidate]:
    """Candidates of an entry or of a named piece of a text, by what its name explains."""
    if is_other_sign(name) and "convention" in words_of(name) and stated_sign("polarity", text) == REVERSED:
        yield Candidate(SCALE, text[:MAX_SIZE], True)
    if name in SIMULATED_CONDITIONS or is_other_sign(name) or _is_unit_of_sensitivity(name):
        return
    if is_half_turn(name, text):
        yield Candidate(SCALE, text[:MAX_SIZE])
        return
    if scale_meaning(name) == INVERSIONS:
        if stated_sign(name, text) == UNCLEAR:
            yield Candidate(SCALE, text[:MAX_SIZE], True)
        return
    subject = STRONG if explained_subject(group) == STRONG else explained_subject(name)
    if subject == STRONG:
        yield from _of_other_subject(text)
        return
    is_partly_other = STRONG in (subject_of(name), subject_of(group))
    for candidate in _of_value(name, text, subject):
        yield replace(candidate, is_weak=True) if is_partly_other else candidate


def _is_unit_of_sensitivity(name: str) -> bool:
    """Whether a name means the unit of a sensitivity, which is none of the samples."""
    return any(map(UNIT_WORD.fullmatch, words_of(name))) and re.search(SENSITIVITY_STEMS, plain_word(name)) is not None


def _of_other_subject(text: str) -> Iterator[Candidate]:
    """Candidates of a text about something else: rates of sampling, and a number that may be the rate."""
    is_sampled = SAMPLING.search(text.casefold()) is not None
    for match in QUANTITY.finditer(text):
        unit = rate_unit(match[2]) if match[2] else None
        is_step = unit is not None and unit.is_step and is_inverse_of_rate(match[1], float(unit.scale))
        if unit and (unit.is_sampling or is_step or (is_sampled and not unit.is_step)):
            yield from _of_rate(match[0], match[1], unit, is_weak=True)
    if BARE_NUMBER.fullmatch(text):
        yield from _numbers_of_other(text)
    elif len(unit_text := text.split()[-1]) > 1 and len(text.split()) <= 2 and not re.search(r"\d", text):
        yield from (replace(c, is_weak=True) for c in _of_unit(unit_text) if c.unit)


def _is_compared(name: str, text: str) -> bool:
    """Whether other modules understand an entry as the rate, and compare it."""
    is_certain = name_meaning(name).certainty == CERTAIN
    return is_certain and any(statement.intervals for statement in statements_of_value(name, text))


def _numbers_of_other(number: str) -> Iterator[Candidate]:
    """A number that its name explains, unless it is the rate in another form, or a step."""
    yield Candidate(RATE, number, True, number=number_value(number), is_of_other=True)
    if is_inverse_of_rate(number, 1.0):
        yield from _of_rate(number, number, RateUnit(True, Fraction(1)), is_weak=True)


def _of_value(name: str, text: str, subject: int) -> Iterator[Candidate]:
    if DATED.match(text):
        return
    cells = re.split(r"[;\s]+|,\s?", text)
    if DECIMAL_COMMA.fullmatch(text):
        yield from _of_number(name, text.replace(",", "."), _unit_of_name(name), subject)
    elif len(cells) > 1 and all(map(BARE_NUMBER.fullmatch, cells)) and not GROUPED_DIGITS.match(text):
        for cell in cells:
            yield from _of_number(name, cell, _unit_of_name(name), subject)
    elif whole := QUANTITY.fullmatch(text):
        is_bare = not whole[2]
        stated = (
            _of_number(name, whole[1], _unit_of_name(name), subject) if is_bare else _of_quantity(name, whole, subject)
        )
        yield from _full_rates(name, stated)
    else:
        unread = {piece for part in re.split(r"[;|\n]|,\s", text) if "," in part for piece in part.split(",")}
        for piece in map(str.strip, PIECES.split(text)):
            named = NAMED.fullmatch(piece)
            if named and piece in unread and name_meaning(named[1]).certainty == CERTAIN:
                yield from _of_value("", named[2].strip(), NONE)  # other modules do not separate it
            elif named:
                is_other = explained_subject(piece[: named.start(2)]) == STRONG
                yield from _of_entry(piece[: named.start(2)] if is_other else named[1], "", named[2].strip())
            elif piece and not named:
                yield from _of_text(name, piece, subject)


def _full_rates(text: str, stated: Iterator[Candidate]) -> Iterator[Candidate]:
    """Candidates of a text; a Nyquist frequency is half the sampling rate."""
    for candidate in stated:
        is_half = "nyquist" in text.casefold()
        yield replace(candidate, rates=tuple(i.divide(0.5) for i in candidate.rates)) if is_half else candidate


def _of_text(name: str, text: str, subject: int) -> Iterator[Candidate]:
    """Candidates of a piece of free text under a name."""
    if units := tuple(_of_unit(text)):
        is_of_other = is_unit_of_other(name)
        other_words = " ".join(word for word in words_of(name) if not UNIT_WORD.fullmatch(word))
        if not is_of_other or explained_subject(other_words) == WEAK:  # "range unit"
            yield from (replace(c, is_weak=True) if is_of_other else c for c in units)
        return
    if subject_of(name) != STRONG:
        yield from _of_state(name, text)
    if not is_scale_name(name) and (counted := WORD_AND_NUMBER.fullmatch(text)):
        yield from _of_entry(counted[1], "", counted[2])  # "div 1000"
    if explained_subject(text) == STRONG:
        yield from _of_other_subject(text)
        return
    ratio = RATIO.fullmatch(text)
    if UPPER_FACTOR.fullmatch(text):
        yield Candidate(SCALE, text, True)  # or a name of a model
    elif CONVERSION.search(text) or (ratio and ratio[1] != ratio[2] and not is_ratio_of_drawing(name, text)):
        yield Candidate(SCALE, text[:MAX_SIZE])
    for match in PART_OF_SECOND.finditer(text):
        scale = Fraction(1000 if match[2] == "ms" else 1)
        yield from _of_rate(match[0], match[1], RateUnit(False, scale), is_weak=False)
    quantities = (c for match in QUANTITY.finditer(text) for c in _of_quantity(name, match, subject, is_part=True))
    yield from _full_rates(f"{name} {text}", quantities)
    if (words := text.split())[1:] and len(words) <= MAX_LABEL and len(words[-1]) > 1 and not re.search(r"\d", text):
        yield from _of_unit(words[-1])  # "siła kN"
    elif (label := LABEL_WITH_UNIT.fullmatch(text)) and quantity_of_text(label[1]):
        yield from _of_unit(label[2])  # "accel_g"
    for match in UNIT_IN_TEXT.finditer(text):
        unit = known_unit(match[1])
        if unit and unit.dimension in AMPLITUDES | {"velocity"}:
            yield _unit_candidate(match[1], unit)


def _of_unit(text: str) -> Iterator[Candidate]:
    """A candidate of a text that is a unit."""
    unit = None if re.match(r"[+-]?[.,]?\d", text) else known_unit(text)
    if unit and unit.dimension in ORDINATES:
        yield _unit_candidate(text, unit)
    elif unit is None and FOREIGN_UNIT.fullmatch(text):
        yield Candidate(UNIT, text, unit=text)


def _unit_candidate(text: str, unit: Conversion) -> Candidate:
    """A unit; one of volts or counts may be that of the sensor's signal."""
    return Candidate(UNIT, text, unit.dimension in ("voltage", "count"), unit=text)


def _unit_of_name(name: str) -> str:
    """The unit in brackets behind a name, or its last word if that is one."""
    if match := NAME_WITH_UNIT.match(name.strip()):
        return match[2]
    word = re.split(r"[\s_]", name.strip())[-1]
    is_unit = rate_unit(word) or known_unit(word) or HARMLESS_UNIT.fullmatch(word)
    return word if word != name.strip() and len(word) > 1 and is_unit else ""


def _of_number(name: str, number: str, unit: str, subject: int) -> Iterator[Candidate]:
    """Candidates of a bare number under a name."""
    if (
        _is_compared(name, number)
        or scale_meaning(name) not in ("", LEVELS)
        or is_fill_name(name)
        or is_block_name(name)
    ):
        return  # by other modules
    if "_".join(words_of(name)) in CONDITIONS:
        return  # the condition itself: a speed, a temperature
    value = number_value(number)
    quantity = QUANTITY.fullmatch(f"{number} {unit}") if rate_unit(unit) or HARMLESS_UNIT.fullmatch(unit) else None
    is_counted = unit.casefold() in SECONDS and value >= MIN_PER_SECOND
    if quantity and not is_counted:
        yield from _of_quantity(name, quantity, subject)
        return
    if value == 1.0 and any(map(INVERTED.fullmatch, words_of(name))):
        yield Candidate(SCALE, number)
    if LEVEL_UNIT.fullmatch(name.strip()) and value:  # the name is the unit, and no number is a code: "dB: 20"
        yield Candidate(SCALE_OR_OFFSET, number, True)
        return
    if value in (0.0, 1.0) or (WHOLE_NUMBER.fullmatch(number) and is_code(value)):
        return
    if subject == WEAK and LENGTH.search(" ".join(words_of(name))):
        yield Candidate(DURATION, number, True, number=value, seconds=(value, value / 1000.0))
    if subject == WEAK and abs(value) >= MIN_LIMIT:
        yield from _numbers_of_other(number)
        return
    yield Candidate(RATE_OR_SCALE, number, True, rates_of_number(number), value)


def _of_state(name: str, text: str) -> Iterator[Candidate]:
    """What a word says was done to the samples: "raw", "inverted"; or a flag under such a name."""
    words, names = words_of(text) or (text.casefold(),), words_of(name)
    is_denied = any(map(DENIED.fullmatch, words))
    if len(words) == 1 and (is_denied or words[0] in AFFIRMED):
        pattern = CONVERTED if is_denied else CHANGED
        is_changed = any(map(pattern.fullmatch, names))
    else:
        sign = sign_in_text(text)
        is_changed = any(map(CHANGED.fullmatch, words)) or sign == REVERSED
        is_changed = is_changed and not is_denied and len(words) <= MAX_WORDS
        if sign == UNCLEAR and not is_changed and len(words) <= MAX_WORDS:
            yield Candidate(SCALE, text[:MAX_SIZE], True)
    if is_changed:
        is_type = words == ("raw",) and TYPE_WORDS.issuperset(names)
        yield Candidate(SCALE, text[:MAX_SIZE], is_type)


def _of_quantity(name: str, match: re.Match[str], subject: int, is_part: bool = False) -> Iterator[Candidate]:
    """Candidates of a number with its unit, in a text or alone."""
    number, unit, value = match[1], match[2] or "", number_value(match[1])
    if value == 0.0:
        return
    stated = RateUnit(False, Fraction(1000)) if unit in ("k", "ks", "kS") else rate_unit(unit) if unit else None
    if stated is not None:
        if not _is_compared(name, f"{number} {unit}"):
            is_of_record = not is_part and _means_duration(name)
            for candidate in _of_rate(match[0], number, stated, is_weak=subject == WEAK or len(unit) == 1):
                yield replace(candidate, is_of_record=is_of_record and candidate.statement == DURATION)
    elif not unit:
        is_round = value.is_integer() and (value % 100 == 0 or value % 1024 == 0)
        if is_round and RATES_IN_TEXT[0] <= value <= RATES_IN_TEXT[1]:
            yield Candidate(RATE, number, True, rates_of_number(number), value)
    elif subject == NONE:
        amplitude = known_unit(unit)
        if LEVEL_UNIT.fullmatch(unit):
            yield Candidate(SCALE_OR_OFFSET, match[0], True)
        elif amplitude and amplitude.dimension in AMPLITUDES:
            yield Candidate(SCALE_OR_OFFSET, match[0], True)
        elif not is_part and amplitude is None and not HARMLESS_UNIT.fullmatch(unit):
            yield from _of_number(name, number, "", subject)  # a unit that is not known


def _means_duration(name: str) -> bool:
    """Whether a name means the duration of the recording and nothing else."""
    further = [word for word in words_of(name) if word not in BESIDE_DURATION]
    return bool(further) and all(map(DURATION_WORD.fullmatch, further))


def _of_rate(text: str, number: str, unit: RateUnit, is_weak: bool) -> Iterator[Candidate]:
    """A candidate of a rate, a step or a duration."""
    intervals = tuple(i for reading in readings(number) if (i := reading.interval(unit.scale, unit.is_step)))
    usual = tuple(i for i in intervals if USUAL_RATES[0] <= i.rate <= USUAL_RATES[1])
    if unit.is_step and not unit.is_sampling and intervals:
        is_long = unit.scale > SHORT_UNIT
        seconds = tuple(1.0 / interval.rate for interval in intervals)
        yield Candidate(RATE if usual else DURATION, text, is_weak or is_long, usual, seconds=seconds)
    elif usual:
        yield Candidate(RATE, text, is_weak, usual)
