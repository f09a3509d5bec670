"""Units of rates and time steps, and the words of a name without case, accents and punctuation."""

import math
import re
import unicodedata
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from turnout.units import in_latin

PER = {"per", "pro", "par", "por", "al", "pr", "je"}
UNIT_PER = re.compile(rf"\s*(?:/|\b(?:{'|'.join(sorted(PER))})\b\.?)\s*")
SAMPLES = re.compile(
    r"s|sa|samp|samples?|smpl|pts?|points?|scans?|messwerte?|abtastwerte?|werte?|punkte?|puntos?|punti|malinger|ech"
    r"|echantillons?|campioni|muestras|count|data ?points?|mess(?:ungen|punkte)|probek|pomiarow|vzorku|monsters"
)
VALUES = re.compile(r"(?:data ?)?values?|readings?|mesures?|valeurs?|valori|valores|misure|medidas|vaerdier|varden")
SECONDS = set(
    "s sec secs second seconds sek sekund sekunde sekunden sekunder seconde secondes secondi secondo segundo "
    "segundos".split()
)
TIME_UNITS = {
    **dict.fromkeys(SECONDS, Fraction(1)),
    **dict.fromkeys(("ms", "msec", "millisec", "millisecond", "milliseconds", "millisekunden"), Fraction(1, 10**3)),
    **dict.fromkeys(
        ("µs", "us", "usec", "µsec", "microsec", "microsecond", "microseconds", "mikrosekunden"), Fraction(1, 10**6)
    ),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), Fraction(1, 10**9)),
    **dict.fromkeys(("ps",), Fraction(1, 10**12)),
    **dict.fromkeys(("min", "mins", "minute", "minutes", "minuten"), Fraction(60)),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours", "stunden"), Fraction(3600)),
    **dict.fromkeys(("d", "day", "days", "tage"), Fraction(86400)),
}
# Beginnings of the same words in further languages, with what may follow: "milisekundy", "millisecondi", "msecs"
TIME_STEMS = (
    (re.compile(r"(?:mill?i|m)ss?e[ckg][a-z]*"), Fraction(1, 10**3)),
    (re.compile(r"(?:mi[ck]ro|[µu])ss?e[ckg][a-z]*"), Fraction(1, 10**6)),
    (re.compile(r"(?:nano|n)ss?e[ckg][a-z]*"), Fraction(1, 10**9)),
)
PREFIXES = {"": Fraction(1), "k": Fraction(10**3), "m": Fraction(10**6), "g": Fraction(10**9)}
RATE_UNIT = re.compile(r"(k|m|g)?(?:hz|hertz|sps)")


@lru_cache(maxsize=4096)
def seconds_of(word: str) -> Fraction | None:
    """Seconds of one unit of time.

    Parameters
    ----------
    word : str
        The unit in lower case, without accents.

    Returns
    -------
    Fraction or None
        None for a word that is no unit of time.

    Examples
    --------
    >>> seconds_of("ms"), seconds_of("milisekundy"), seconds_of("mm")
    (Fraction(1, 1000), Fraction(1, 1000), None)
    """
    if word in TIME_UNITS:
        return TIME_UNITS[word]
    return next((scale for stem, scale in TIME_STEMS if stem.fullmatch(word)), None)


@dataclass(frozen=True)
class RateUnit:
    """Unit of a rate [Hz per unit] or of a step [s per unit]; ``is_sampling`` if it counts samples, as in "kS/s"."""

    is_step: bool
    scale: Fraction
    is_sampling: bool = False


@lru_cache(maxsize=4096)
def rate_unit(text: str) -> RateUnit | None:
    """Unit of a sampling rate or a time step.

    Parameters
    ----------
    text : str
        Unit as it is written, without its number.

    Returns
    -------
    RateUnit or None
        None for any other unit.

    Examples
    --------
    >>> rate_unit("kS/s").scale, rate_unit("µs/pt").is_step, rate_unit("Samples per second").scale, rate_unit("V")
    (Fraction(1000, 1), True, Fraction(1, 1), None)
    """
    latin = in_latin(text)
    plain = latin.strip("[](){} .").casefold().replace("é", "e").replace("\u03bc", "µ")
    plain = re.sub(r"\s*(?:/|per\s+)\s*(?:ch|chan|channel|kanal)$", "", plain)
    if match := RATE_UNIT.fullmatch(plain):
        return RateUnit(False, PREFIXES[match[1] or ""], plain.endswith("sps"))
    if seconds := seconds_of(plain):
        return RateUnit(True, seconds)
    if re.fullmatch(r"(?:1? ?/ ?s(?:ec)?|s\^?-1|s⁻¹)", plain):
        return RateUnit(False, Fraction(1))
    parts = UNIT_PER.split(plain)
    if len(parts) != 2:
        return None
    over, under = parts
    if under in SECONDS and (not over or VALUES.fullmatch(over)):  # "per second", "values/s": of a display, too
        return RateUnit(False, Fraction(1))
    if under in SECONDS:
        for prefix, scale in PREFIXES.items():
            if over.startswith(prefix) and SAMPLES.fullmatch(over[len(prefix) :].strip()):
                return RateUnit(False, scale, True)
    if SAMPLES.fullmatch(under) and (seconds := seconds_of(over)):
        return RateUnit(True, seconds, True)
    return None


PER_MINUTE = re.compile(r"rpm|cpm|u/min|1/min|min\^?-1|min⁻¹")
RADIANS_PER_SECOND = re.compile(r"rad(?:ians?)?\s*(?:/|per|\s)\s*s(?:ec(?:ond)?)?|rad s(?:\^?-1|⁻¹)")


def hertz_of(unit: str) -> float | None:
    """Hertz of one unit of a frequency.

    Parameters
    ----------
    unit : str
        Unit as it is written, without its number.

    Returns
    -------
    float or None
        None for a unit that is none of a frequency.

    Examples
    --------
    >>> hertz_of("kHz"), hertz_of("rpm") == 1 / 60, round(hertz_of("rad/s"), 4), hertz_of("ms"), hertz_of("order")
    (1000.0, True, 0.1592, None, None)
    >>> hertz_of("mHz"), hertz_of("MHz")
    (0.001, 1000000.0)
    """
    of_rate, plain = rate_unit(unit), unit.strip("[](){} .").casefold()
    if of_rate is not None:
        if plain == "mhz" and "MHz" not in unit:  # without case, milli and mega are the same
            return 1e-3
        return None if of_rate.is_step or of_rate.is_sampling else float(of_rate.scale)
    if RADIANS_PER_SECOND.fullmatch(plain):
        return 1.0 / (2.0 * math.pi)
    return 1.0 / 60.0 if PER_MINUTE.fullmatch(plain) else None


@lru_cache(maxsize=4096)
def words_of(name: str) -> tuple[str, ...]:
    """Words of a name, without case, accents and punctuation.

    Parameters
    ----------
    name : str
        Name of an entry or column.

    Returns
    -------
    tuple of str
        Its words in lower case.

    Examples
    --------
    >>> words_of("Fréquence d’échantillonnage"), words_of("XIncrement"), words_of("SampleRate_Hz")
    (('frequence', 'd', 'echantillonnage'), ('x', 'increment'), ('sample', 'rate', 'hz'))
    """
    text = (
        name.replace("_", " ")
        .replace("ø", "o")
        .replace("Ø", "O")
        .replace("æ", "ae")
        .replace("ß", "ss")
        .replace("Δ", "delta ")
    )
    text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    text = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text.replace("/", " per "))
    return tuple(re.findall(r"[^\W\d_]+", re.sub(r"\b([kmg]) (?=hz\b)", r"\1", text.lower())))
