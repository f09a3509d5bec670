"""Words for a sampling rate, a time step and a time axis in the metadata of any format, by general rules.

A name is split into words without case, accents and punctuation ("XIncrement", "wf_increment", "Fréquence
d'échantillonnage"). Words of sampling with a word of rate or step are certain; each alone, or an unknown word with a
frequency as its value, is possible. Names of filters, devices and counts are neither. English, German, French, Danish,
Italian and Spanish forms are recognised, and some Dutch, Swedish and Czech ones.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from turnout.readers.rate_units import PER, SAMPLES, SECONDS, RateUnit, rate_unit, seconds_of, words_of

SAMPLING = re.compile(
    r"samp|smpl?|abtast|tastrate|echantill|muestr|campion|bemonster|aftast|scan|acq|adqui|erfass|prove"
)
# The same in other languages. There a word of rate or step counts only beside one of sampling, because no list of other
# frequencies is known. Characters are as ``words_of`` returns them, without marks.
OTHER_SAMPLING = re.compile(
    "probkow|vzork|amostr|mintav|nayttee?n|orneklem|uzork|esantion|provtag|дискретиз|выборк|опроса"
    "|采样|采樣|取样|取樣|採樣|標本化|サンフリンク|δειγματοληψ"
)
OTHER_RATE = re.compile(
    "czestotliw|taajuu|frekans|taxa|nopeus|szybkosc|частот|скорост|频率|頻率|周波数|レート|率$|συχνοτ"
)
OTHER_STEP = re.compile("okres|odstep|jakso|krok|aralıg|интервал|период|шаг|间隔|間隔|周期")
WEAK_SAMPLING = re.compile(
    r"mess|mesur|medi[dc]|misur|male|maling|meas|meting|meet|record|aufzeich|enregistr|registr|logg|data|daq|adc|digit|conver|output"
)
RATE = re.compile(r"freq|frq|frekv|frequ|frec|kmitoc")
RATE_TOKENS = {
    "rate", "rates", "taux", "tasa", "cadence", "cadenza", "cadencia", "velocidad", "velocita", "vitesse", "hastighed",
    "takt", "clock", "snelheid", "tasso", "hz",
}  # fmt: skip
RATE_ENDINGS = ("rate", "takt", "speed", "geschwindigkeit", "hastighed", "hastighet")  # beside a word of sampling
STEP = re.compile(r"interval|inkr|incr|period|schritt|skridt|xinc|tidstrin|tidssteg|raster")
# A distance or a resolution is a step only with a word of time or of sampling.
STEP_BESIDE = re.compile(
    r"resol|auflos|oplos|risoluz|spacing|distan|abst[ae]n|afstand|espac|separa|between|zwischen|mellem"
)
STEP_TOKENS = {
    "step",
    "steps",
    "stepsize",
    "pas",
    "passo",
    "paso",
    "delta",
    "inc",
    "trin",
    "steg",
    "timestep",
    "tick",
    "dt",
}
TIME = re.compile(
    r"^(?:x|h|horz?|t|horizontal\w*|wf|zeit\w*|time\w*|tid|tids\w*|temps|tiempo|tempo|temporal\w*|temporel\w*|tijd\w*)$"
)
CERTAIN_RATES = {
    "fs",
    "rate",
    "sps",
    "fsample",
    "fsampling",
    "fsamp",
    "sr",
    "samplespersecond",
    "fa",
    "fabtast",
    "abtfreq",
    "srate",
    "odr",
}
CERTAIN_STEPS = {
    "dt",
    "tstep",
    "tinc",
    "dtime",
    "deltat", "δt", "deltax", "dx", "xincrement", "xinc", "xincr", "increment", "inkrement", "timestep",
    "xdelta", "tdelta", "ts", "tsample", "deltatime", "timedelta", "secondspersample", "timepersample", "hinterval",
    "abtastzeit", "sampletime",
}  # fmt: skip
POSSIBLE_RATES = {"fe", "fc"}  # of French and Italian: also other things
RATE_WORD = re.compile(r"(?:[a-z]{1,2}|adc|dac|daq|data|daten|frame|tick|line|log)rates?")
PER_SAMPLE = ("sample", "samples", "point")
# What is counted per second beside samples: not a rate of sampling.
NOT_COUNTED = re.compile(
    r"met|mile|foot|feet|inch|zoll|rev|umdreh|tour|gir|vuelt|rad|grad|deg|byt|okt|octet|pack|newt|volt"
)
POSSIBLE = POSSIBLE_RATES | {
    "sampling", "abtastung", "echantillonnage", "muestreo", "campionamento", "bemonstering", "vzorkovani", "timebase",
    "zeitbasis", "samplingtime", "abtastzeitraum",
    "probkowanie", "amostragem", "mintavetelezes", "naytteenotto", "ornekleme", "provtagning", "дискретизация", "采样",
    "サンフリンク",
}  # fmt: skip
# Names of other frequencies, of settings, counts and times of day.
OTHER = re.compile(
    r"filt|pass(?!o)|cut|grenz|band|coup|cort|tagli|gra?en?s|eigen|reson|natur|modal|netz|mains|calib|kalib|tarat|etalonn|sensitiv"
    r"|servic|wart|inspec|trigg|bit|baud|start|begin|debut|inicio|inizio|stop|date(?!n)|datum|number|anzahl|count|nombre"
    r"|antal|numero|aantal|cantidad|max|range|bereich|nyquist|carrier|refresh|update|oversampl|decim|ratio|heart|rot"
    r"|anreg|excit|sinus|sweep|\balias|antialias|\btone?\b|\bspan\b|\bcent(?:er|re)\b|mitten|corner|octav|\bupper\b|\blower\b|\bring\b|\bcpu\b|crystal|qu?artz|quarz|mode$|unit|einheit|label|dimension|counter|zahler|filename|offset"
)
# Words for frequency as a whole, and what may stand beside one that is the sampling rate: the device, the record, its
# channels and quantities, and words without a meaning of their own. "Bolt frequency" is one of the bolt.
FREQUENCY = re.compile(
    r"frequen(?:z(?:en|a|e)?|c(?:y|ies|es?|ias?)|ties?)|frekven(?:s(?:er|en)?|ce|ca|cia)|frec(?:uencias?|venta)|kmitocet"
    r"|freqs?(?!u)|frq"
)
OF_RECORD = re.compile(
    r"clock|takt|horlog|reloj|orolog|adc|dac|daq|board|card|carte|karte|kort$|scheda|tarjeta|logg|grab|device|gerat"
    r"|appar|dispos|modul(?!at)|digit|wandl|conver|hardware|system|sistema|instrument|scan|record|aufzeich|enregistr|registr"
    r"|channel|kanal|kanaele|voie|canal|data|daten|donnees|dati$|datos|file|datei|fichier|output|ausgang|sortie|salida"
    r"|input|eingang|entree|entrada|base|basis|master|main|haupt|princip|time|zeit|tid|temps|tiempo|tempo|sett?ing"
    r"|einst|regl|config|konfig|mess|mesur|medi[dc]|misur|male|maling|meas|frame|tick|point|punkt|nominal|nenn|actual"
    r"|real|reel|effe[ck]t|true|used|current|default|select|stor|speich|save|final|value|wert|valeur|valor"
    r"|forc|kraft|acc|beschl|vibrat|schwing|vzork|amostr|probk|mintav|nayt|ornek|esant|uzork|sampl"  # sampling
)
NO_MEANING = {"and", "the", "for", "von", "der", "die", "das", "des", "fur", "del", "della", "dei", "les", "los", "per"}
# What a word of sampling with a word of rate or step leaves possible: "Signal sample rate".
BESIDE_RATE = re.compile(r"signal|source|quelle|block|buffer|spectr|fft")
# Names of other durations: a short one under any other name may be a time step.
DURATION = re.compile(
    r"delay|verzog|retard|retraso|ritardo|forsink|laten|width|breite|largeur|rise|fall|anstieg|constant|konstant|tau$"
    r"|dead|tot(?:zeit)?$|hold|halte|timeout|durat|dauer|duree|durac|durat|varighed|expos|belicht|decay|abkling|window|fenster"
    r"|pulse|puls|impact|stoss|contact|kontakt|choc|jitter|uncert|unsicher|gate|settl|warm|dwell|length|lange|longueur"
    r"|elapsed|total|gesamt|tolera|error|fehler|skew|drift|shift|lag$|averag|mittel|weight|bewert|overlap|peak|accura"
    r"|montee|subida|salita|stig|ping|hop$"
)
AXIS_UNIT = re.compile(r"x|t|time|units?|s|secs?|seconds?|[mun]?s|sek(?:unden)?")


CERTAIN, POSSIBLY, NOT = 2, 1, 0


@dataclass(frozen=True)
class NameMeaning:
    """Whether a name means a sampling rate or a time step, how sure (CERTAIN, POSSIBLY, NOT), and the unit in it."""

    certainty: int
    is_step: bool | None = None
    unit: RateUnit | None = None
    unknown_unit: str = ""


NAME_WITH_UNIT = re.compile(r"^(.*?)\s*[\[({]([^\[\](){}]*)[\])}]\s*$")


@lru_cache(maxsize=4096)
def name_meaning(name: str) -> NameMeaning:
    """What the name of an entry says about sampling rate and time step.

    Parameters
    ----------
    name : str
        Name of an entry, with its unit in brackets or as its last word if it has one.

    Returns
    -------
    NameMeaning
        Certainty, kind and unit.

    Examples
    --------
    >>> [name_meaning(n).certainty for n in ("Scan rate", "Abtastintervall", "Update rate", "Low pass", "Periode")]
    [2, 2, 0, 0, 1]
    >>> name_meaning("dt_ms").unit.scale, name_meaning("Pas de temps [µs]").is_step
    (Fraction(1, 1000), True)
    """
    if (path := re.split(r"[.:/\\]", name.strip("./:\\ ")))[1:] and path[-1].strip() in PATH_SYMBOLS:
        name = path[-1].strip()  # "settings.dt"
    unit_text = ""
    if (match := NAME_WITH_UNIT.match(name.strip())) and match[1]:
        name, unit_text = match[1], match[2]
    if (whole := rate_unit(name)) and whole.is_sampling:  # "s/pt"
        return NameMeaning(CERTAIN, whole.is_step, whole)
    unit = rate_unit(unit_text) if unit_text else None
    if unit_text and unit is None and SAMPLING.search(unit_text.casefold()):
        name, unit_text = f"{name} {unit_text}", ""  # "Clock rate (acquisition)"
    words = _with_per([word for word in words_of(name) if word not in ("wf", "the")])
    is_symbol = "".join(words) in CERTAIN_RATES | CERTAIN_STEPS and len(words[0]) == 1
    if (
        not unit_text
        and len(words) > 1
        and not is_symbol
        and "per" not in words
        and words[-1] not in UNITS_NOT_IN_NAMES
    ):
        unit = rate_unit(words[-1])
        words = words[:-1] if unit else words
    certainty, is_step = _meaning([w for w in words if not (REDUCTION.search(w) if unit else REDUCED.search(w))])
    spaced = " ".join(words)
    if unit is not None and certainty == NOT and words and not OTHER.search(spaced) and not is_other_frequency(words):
        if not unit.is_step or unit.is_sampling:
            is_sampled = unit.is_sampling or bool(SAMPLING.search(spaced))
            certainty, is_step = (CERTAIN if is_sampled else POSSIBLY), unit.is_step
        elif unit.scale <= 1 and not DURATION.search(spaced) and not BEGIN.search(name) and not is_time_name(name):
            certainty, is_step = POSSIBLY, True
    if unit is not None and certainty == NOT and unit.is_step and unit.scale <= SHORT_UNIT and SHORT.search(spaced):
        certainty, is_step = POSSIBLY, True  # whatever else the name says
    if unit is None and unit_text and re.fullmatch(r"[a-zA-Z]\w{0,3}", unit_text.strip()) is None:
        unit_text = ""  # an explanation, not a unit
    return NameMeaning(certainty, is_step, unit, "" if unit else unit_text)


BEGIN = re.compile(r"(?:^|[\W_])t[ _]?0(?:$|[\W_])", re.IGNORECASE)  # the time of the first sample
SHORT = re.compile(f"{STEP.pattern}|{SAMPLING.pattern}")
SHORT_UNIT = Fraction(1, 10**6)  # s: an interval in such a unit may be that of the samples under any name
PATH_SYMBOLS = ("fs", "sr", "dt", "delta", "dx", "rate")  # last part of a path of names
UNITS_NOT_IN_NAMES = ("t", "d", "h", "min")  # last words of a name that are no unit


def _with_per(words: list[str]) -> list[str]:
    """The words with "per" for its other languages in front of the last one, as in "Werte pro Sekunde"."""
    is_per = len(words) > 2 and words[-2] in PER and words[-1] in SECONDS
    return [*words[:-2], "per", words[-1]] if is_per else words


def _meaning(words: list[str]) -> tuple[int, bool | None]:
    """(certainty, whether it is a step) of the words of a name."""
    joined, spaced = "".join(words), " ".join(words)
    if joined in CERTAIN_RATES:
        return CERTAIN, False
    if joined in CERTAIN_STEPS:
        return CERTAIN, True
    if "per" in words[1:-1] and words[-1] in PER_SAMPLE and AXIS_UNIT.fullmatch(words[-3]):
        return CERTAIN, True
    if OTHER.search(spaced) or not words:
        return NOT, None
    counted = words[-3] if len(words) > 2 and words[-2] == "per" and words[-1] in SECONDS else ""
    is_counted = len(counted) > 2 and bool(SAMPLES.fullmatch(counted))
    is_rate = any(word in RATE_TOKENS or RATE.search(word) or RATE_WORD.fullmatch(word) for word in words)
    is_rate |= any(word.endswith(RATE_ENDINGS) and SAMPLING.search(word + spaced) for word in words)
    is_rate |= any(word.endswith(("rate", "takt")) and WEAK_SAMPLING.search(word) for word in words)
    is_rate |= is_counted or (len(counted) > 2 and not NOT_COUNTED.search(counted))
    is_step = bool(STEP.search(joined)) or any(word in STEP_TOKENS for word in words)
    is_counted = "per" in words[1:-1] and NOT_COUNTED.search(words[-3]) is not None  # "bytes per sample"
    is_step |= "per" in words and len(words) > 2 and words[-1] in PER_SAMPLE and not is_rate and not is_counted
    is_sampling = bool(SAMPLING.search(spaced)) or any(SAMPLES.fullmatch(w) and len(w) > 2 for w in words)
    if OTHER_SAMPLING.search(spaced):
        is_sampling, is_rate = True, is_rate or bool(OTHER_RATE.search(spaced))
        is_step |= bool(OTHER_STEP.search(spaced))
    is_timed = any(TIME.match(word) for word in words)
    is_measuring = bool(WEAK_SAMPLING.search(spaced)) and not re.search(r"data|daten", spaced)
    is_certain = (is_step and (is_sampling or is_timed)) or (is_rate and (is_sampling or is_measuring))
    if BESIDE_RATE.search(spaced):
        return (POSSIBLY if is_certain else NOT), (is_step if is_step != is_rate else None)
    if is_certain:
        return CERTAIN, is_step and (is_sampling or is_timed)
    if (STEP_BESIDE.search(joined) and (is_sampling or is_timed)) or (is_sampling and is_timed):
        return POSSIBLY, True
    if not (is_step or is_rate) and {"fs", "sr"} & set(words):
        return POSSIBLY, False
    if is_rate and not is_step and is_other_frequency(words):
        return NOT, None
    if is_step or is_rate:
        return POSSIBLY, (is_step if is_step != is_rate else None)
    return (POSSIBLY if joined in POSSIBLE else NOT), (False if joined in POSSIBLE_RATES else None)


def is_other_frequency(words: Sequence[str]) -> bool:
    """Whether words speak of the frequency of something else than the recording.

    Parameters
    ----------
    words : sequence of str
        Words of a name, as ``words_of`` returns them.

    Returns
    -------
    bool
        True for a word of frequency with words of which none concerns the recording.

    Examples
    --------
    >>> [is_other_frequency(words_of(n)) for n in ("Bolt frequency", "Trägerfrequenz", "Board frequency", "Frequency")]
    [True, True, False, False]
    """
    if not any(FREQUENCY.search(word) for word in words):
        return False
    stems = [stem for word in words for stem in FREQUENCY.split(word)]
    subjects = [stem for stem in stems if len(stem) > 2 and stem not in NO_MEANING]
    return bool(subjects) and not any(OF_RECORD.search(subject) for subject in subjects)


# A reduction of the sampling rate behind the converter, and words for what is reduced.
REDUCTION = re.compile(
    r"decimat|decimi|dezimat|dezimier|downsampl|subsampl|oversampl|unterabtast|uberabtast|sousechant|surechant"
    r"|submuestr|sobremuestr|sottocampion|sovracampion|nedsampl|thinning|stride"
)
REDUCED = re.compile(r"decimated|dezimierte|downsampled|subsampled|unterabgetastet|decimee?s?$")


@lru_cache(maxsize=4096)
def reduction_of_name(name: str) -> str:
    """Whether a name speaks of a reduction of the sampling rate: samples that were left out or averaged.

    Parameters
    ----------
    name : str
        Name of an entry.

    Returns
    -------
    str
        "factor" for "Decimation" and the like, "rate" for "Decimated rate" and the like, "" for any other name.
    """
    words = (*(words := words_of(name)), "".join(words))
    if any(REDUCED.search(word) for word in words):
        return "rate"
    return "factor" if any(REDUCTION.search(word) for word in words) else ""


def is_rate_name(name: str) -> bool:
    """Whether a name certainly means a sampling rate or a time step.

    Parameters
    ----------
    name : str
        Name of an entry or variable.

    Returns
    -------
    bool
        True for "fs", "Sample rate", "Abtastintervall" and the like.
    """
    return name_meaning(name).certainty == CERTAIN


TIME_NAME = re.compile(
    r"^(?:t|time|times|timestamps?|datetime|timeaxis|timevector|elapsed|zeit|zeiten|zeitstempel|zeitachse|uhrzeit|messzeit"
    r"|tid|tidspunkt|tider|temps|tempo|tiempo|tijd|tijdstip|sekunden|seconds|sec|cas|horodatage)$"
)


def is_time_name(name: str) -> bool:
    """Whether a column of this name is a time axis.

    Parameters
    ----------
    name : str
        Name of a column, without its unit.

    Returns
    -------
    bool
        True for "Time", "time_s", "Zeit", "timestamp" and the like.

    Examples
    --------
    >>> [is_time_name(n) for n in ("time_s", "Zeit", "rel. time", "temperature", "T", "t")]
    [True, True, True, False, False, True]
    """
    if name.strip() == "T":
        return False
    words = [word for word in words_of(name) if seconds_of(word) is None or word == "t"]
    words = [
        word for word in words if word not in ("rel", "relative", "abs", "absolute", "sample", "utc", "stamp", "x")
    ]
    return (len(words) == 1 and bool(TIME_NAME.match(words[0]))) or name.strip().lower() == "x_value"
