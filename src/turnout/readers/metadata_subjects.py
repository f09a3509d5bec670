"""Words for what metadata state beside rate, scale and unit of the samples: identity, counts, dates, settings.

``subject_of`` asks whether any word of a name speaks of such a thing: then no rule may reject a file because of it. A
strong word ("filter", "temperature", "trigger") does, a weak word ("number", "range", "level") unless another word
speaks of a rate, a scale or a unit: "Range factor". ``explained_subject`` asks whether every word does: only then the
name explains its value. Words are compared without case and accents; stems count at the beginning of a word and of a
part of a compound.
"""

import re
from functools import lru_cache

from turnout.readers.rate_units import words_of

STRONG, WEAK, NONE = 2, 1, 0
MIN_STEM = 4  # letters: a shorter one is part of too many other words

# Sensitivity of a sensor, of which ``sensitivity_comparison`` compares the value.
SENSITIVITY_STEMS = r"sensitiv|empfind|sensibi|gevoelig|folsom|citliv|czu[l\u0142]|kanslig|herkkyy|erzekeny|hassasiyet"

# Stems (English, German, French, Danish, Swedish, Dutch, Spanish, Italian, Czech, Polish); "$" is the end of a word.
STRONG_STEMS = (
    # identity, people, places, software, devices
    r"serial|seriennummer|serienr|firmware|softw|version|revision|schema|author|autor|operat"
    r"|bedien|medewerker|obsluha|company|firma|project|projekt|customer|phone|address|adress|station"
    r"|bahnhof|strecke|rechner|uuid|guid|imei|checksum|crc32|signature|hash|language|script|program"
    r"|invoice|order|standard|engineers?$|team|report|sheet|photo|picture|foto|colou?r|farbe"
    r"|couleur|brightness|volume|fan$|usb|wlan|network|baud|port$|payload|heap|boot|reset"
    r"|cable|kabel|connector|pinout"
    # date, time of day, clock quality
    r"|(?<!up )date(?!n)|datum|fecha|timezone|zeitzone|utc|timestamp|uptime|laufzeit|runtime|created"
    r"|modified|erstellt|due$|year|jahr|ntp|pps\b|drift|jitter|gps|gnss|satell|latit|longit|altit|hdop"
    # environment and supply
    r"|temp(?!s\b|o\b|or)|tepl|humid|feucht|luftf|pression|pressure|druck|wind|rain|regen|pluie|weather"
    r"|wetter|vejr|vader|meteo|pocasi|pogod|batter|akku|supply|speis|excitation|erreg|impedanc|impedanz"
    r"|capacit|current|strom|iepe|ccld|icp|bridge|brucke|altitude"
    # geometry and the track
    r"|radius|rayon|radio|raggio|gauge|spurweite|scartament|chainage|kilomet|progress|sleeper|schwell"
    r"|travers|travies|svell|dwarsl|prazec|podklad|crossing|turnout|switch|weiche|aiguill|desvio|scambio"
    r"|vyhybk|rozjazd|wissel|sporskift|herzst|radlenk|ballast|schotter|tamp|stopf|tracks?$|gleis|voies?$"
    r"|binario|spoor|spor$|nose$|rail ?pads?\b|zwischenl|rail profil|schienenprofil|flangew|bearer|height"
    r"|hohe|hauteur|altura|altezza|width|breite|largeur|diamet|durchmess|thickness|dicke|angle|winkel"
    r"|neigung|slope of|uberhoh|position|longitude|elevat|azimut|magnitud"
    r"|depth|profondeur|exposure|aperture|balance|auftrag|percent|bolt|screw|torque|cant$|curve|kurve|courbe"
    # trains and impacts
    r"|train|zug|treno|wheel|rader|axle|achslast|achszahl|essieu|wagen|carriage|traffic|gewicht des|mass(?!einh|s?tab)"
    r"|masa|massa|hmotn|impact|schlag|schlage|coup$|coups$|golpe|colpo|uderz|uder|slag|tips?$|embout"
    r"|operator|speed of|line speed|velocidad de linea|vitesse des"
    # settings of other things: triggers, filters, windows, limits, analysis
    r"|trigg|ausloes|auslos|declench|disparo|wyzwal|spoust|threshold|schwelle|seuil|umbral|soglia|taersk"
    r"|prog$|hyster|filt|high ?pass|low ?pass|bandpass|hochpass|tiefpass|passe|tuning|switching|inverter(?!et|a[dt])"
    r"|umricht|propre|egen(?:sv|frek)|cutoff|cut off|coupure|corner|grenz|notch|alias|butter|bessel|window"
    r"|fenster|fenetre|ventana|finestra|overlap|averag|mittel|moyenn|median|detrend|taper|zero ?pad|fft"
    r"|spectr|spektr|octav|terz|lines?$|band|resonan|risonan|eigenfr|eigensv|natural|modal|mode "
    r"|damp(?!fung|fer)|stiff|steif|raideur|pinned|coheren|koharen|snr|noise|rausch|bruit|crest|scheitel|kurtos"
    r"|skewness|leq$|quality factor|guete|gute|safety|sicherheit|contact|kontakt|rise|anstieg|montee|subida"
    r"|salita|stigtid|hold|timeout|delay|verzog|retard|retraso|laten|pretrig|posttrig|vorlauf|nachlauf"
    r"|vorgesch|retr[yi]|max\w* (?:sampl|rate|freq)|peak (?:time|freq)|alarm|overload|uberst|clip|linearit"
    r"|nonlin|transverse|tolera|uncert|unsicher|accura|error|fehler|crosstalk|cmrr|thd|"
    rf"{SENSITIVITY_STEMS}|carrier|trager|porteus|portador|modulat|mains|netz|powerline"
    r"|power line|response|excit|anreg|tone$|sweep range|decay|abkling"
    r"|(?:data|file|block|header|byte|index) ?offset|full ?scale(?! ?count)"
    r"|calibration (?:period|interval|due)|time ?(?:const|offset|scale)|start ?offset|span\b(?! of)|time ?zone"
    r"|zeitkonst|constante de temps|transient|referen|bezug|freq\w* (?:range|resp|limit)"
    r"|frequenz(?:bereich|gang)|gamme de freq|usable|nutzbar|tach|puls|rev$|rotat|drehz|heart|cpu|ram$"
    r"|gradient|refresh|display|anzeig|plot|screen|zoom|print|map$|karte$|drawing|zeichn"
)
STRONG_WORDS = frozenset(
    (
        "dip iso mag mem pct "
        "id ids sn fw hw ip mac url lat lon alt km pk nr sw os vbat rssi dbm msg task run job hit hits shot "
        "node dof form page room zip age lift hum hz0 hp lp hpf lpf aaf tip hour minute second microsecond "
        "month day days weekday direction richtung sat fix track left right stage phase repetition marker "
        "title location locations lid"
    ).split()
)
# Words of counts, limits and states, which a word of rate, scale or unit overrules.
WEAK_STEMS = (
    r"distan|entfern|abstand|afstand|length|lange|longueur|longitud|slot|steckpl|chassis|rack|buffer|puffer"
    r"|memory|speicher|disk|storage|card|hammer|marteau|martill|martell|klad|mlot|geschwind|hastighed"
    r"|rychlost|predkosc|vitesse|velocid|snelheid|number|nummer|anzahl|nombre|numero|numer|antal|aantal|cantidad"
    r"|pocet|liczba|count(?!s? per)|samples?$|abtastwert|echantillons|punkter|channels?$|kanale?r?$|canal"
    r"|voies|blocks?$|segment|records?$|averages|bytes?$|bits?$|total|header|index|range|bereich|gamme"
    r"|gama$|campo|rango|upper|lower|limit|level|pegel|niveau|nivel|start|stop|begin|first|last|previous"
    r"|voltage|spannung|tension|size|status|state|type|class|kind|code|seq|config|auto|armed|event|test"
    r"|measurement|messung|messpunkt|messstelle|stell|shift reg|volt(?:age)?s?$|model|manufact|letter"
    r"|initial|period of|due|step of"
)
WEAK_WORDS = frozenset(
    (
        "trace peak max min rms mean std var tau quality point points mode sensor transducer name file "
        "files path no of num size pos ch ver ref reference calibration cal calib calibrated interval"
    ).split()
)
# What says that a name may speak of a rate, a scale or a unit in spite of a weak word.
SUSPECT = re.compile(
    r"physical|digital|factor|faktor|facteur|fattor|coef|koef|scal|skal|echelle|gain|ampli|verst|conv|umrech|corr|korr|calib|kalib|etalon"
    r"|multip|divi|ratio|slope|freq|frekv|frec|frq|rate|takt|clock|interv|period|step|schritt|shift|norm|polyn|offset|tare"
    r"|zero|remov|null|unit|einheit|format|weight|lsb|digit|quant|per\b|speed|spacing|increment|value|time|durat|dauer|per(?:s|p)"
)
# Where a stem counts: at the beginning of a word, or in a compound behind four letters or more that end in no prefix.
# "Schienentemperatur" is a temperature; "Aufschlag" is no impact, "Rapport" no port and "Conversion" no version.
BORDER = (
    r"(?:\b|(?<=[a-z]{4})"
    + "".join(rf"(?<!{prefix})" for prefix in "auf con durch inter kon nach super sup trans uber ueber unter".split())
    + ")"
)
_STRONG = re.compile(rf"{BORDER}(?:{STRONG_STEMS})".replace("$", r"\b"))
_WEAK = re.compile(rf"{BORDER}(?:{WEAK_STEMS})".replace("$", r"\b"))
# Words without a meaning of their own, beside words of another subject.
_FILLER = re.compile(
    r"of|the|for|in|on|at|and|or|to|from|by|with|is|has|as|a|an|von|vom|der|die|das|des|dem|den|fur|zu|zum|zur|und|am|im|bei|mit"
    r"|de|du|d|l|la|le|les|des|et|en|a|au|sur|el|del|los|y|por|di|della|del|dei|il|e|per|af|og|til|pa|i|van|het|een"
    r"|no|nr|n|id|x|y|z|m|s|c|v|g|k|hz|khz|ms|us|mm|cm|km|kg|kn|mn|mv|ma|db|deg|pct|rpm|kmh|mb|gb|hpa|mbar|nm"
    r"|rails?|left|right|links|rechts|gauche|droite|min|max|mean|rms|std|nominal|actual|total|current|average|main|new"
    r"|value|name|text|info|note|data|user|is|used|measured|set|on|off|external|internal|ambient|top|bottom|first|last"
    r"|next|previous|number|type|line|free|air|site|field|special|general|own|all|each|high|low|fast|slow|auto|manual"
    r"|head|panel|board|host|device|session|signals?|channels?|ch|nchan|sensor|input|output|pre|post|grid|group|sub|zone"
    r"|amp|min|med|acc|rel|abs|required|free|sd|core|adc|fpga|valid|shared|local|remote|wf|ni|teds|document|spill"
    r"|floor|force|load|acceleration|accel|velocity|kraft|beschleunigung|schiene|luft|skinne|voie|gleis|h|min|sec|dbm|dbfs|ppm|degc|nm|mbit|kb|kbit|degree|degrees|percent|amount|h|t|f|r"
)
# Words that make a statement about the samples of any subject: "Nyquist", "Empfindlichkeitskorrektur", "channel 2 in".
_OF_SAMPLES = re.compile(r"\bnyquist|corre[ckz]t|korrekt|correz|\b(?:in|as)$|(?<!bits)(?<!bytes) per \w")

# A coefficient of a calibration, "cal_a", "calB", "a_calibration": a single letter is no article there.
_CALIBRATION = r"[ck]al(?:ib(?:ration|rierung|rering)?)?"
# A scale is one whatever its subject, apart from figures that are called factors.
_OF_SCALE = re.compile(
    rf"^{_CALIBRATION} [a-z]$|^[a-z] {_CALIBRATION}$|"
    r"(?<!quality )(?<!crest )(?<!form )(?<!coverage )(?<!load )(?<!damping )fa[ck]tor|facteur|fattor|[ck]oef"
    r"|scal(?:e|ing)\b|skal|\bgain"
    r"|verstark|multipl|umrechn|conver|gananc|guadagn|weight\b|tare|\bunits?\b|einheit|\bspan\b"
)
# What a strong word may be the frequency, rate, time or limit of.
_OF_FREQUENCY = re.compile(
    r"fre[qck]\w*|rates?|times?|speed|zeit\w*|factor|ratio|period|durations?|spacing|limits?|state|status|check"
)
# Words for a stretch of the recording itself: they explain counts of it, but not its length.
_RECORD = re.compile(r"\b(?:shots?|hits?|impacts?|windows?|fenster|fenetre|coups?|schlag|slag|golpe|colpo)\b")
LENGTH = re.compile(r"length|lange\b|longueur|lengte|laengde|span\b|extent|durat|dauer|duree|varighed|durac|durat")
_OTHER_OFFSET = re.compile(r"\b(?:(?:file|trigger|trig|utc|pps|ntp|ptp|clock) ?offset|bias (?:volt|curr)\w*)")
_BRACKETS = re.compile(r"[\[({][^\[\](){}]*[\])}]")
_PATH = re.compile(r"[.:/\\]+(?! )")


@lru_cache(maxsize=4096)
def subject_of(name: str) -> int:
    """How surely a name speaks of something else than rate, scale or unit of the samples.

    Parameters
    ----------
    name : str
        Name of an entry, with or without its group.

    Returns
    -------
    int
        STRONG, WEAK (unless the value is plainly a rate or a scale) or NONE.

    Examples
    --------
    >>> [subject_of(n) for n in ("Filterfrequenz", "Number of blocks", "Range factor", "Skinnetemperatur", "Aufschlag")]
    [2, 1, 0, 2, 0]
    """
    words = words_of(_BRACKETS.sub("", name))
    spaced = " ".join(words)
    if _OF_SAMPLES.search(spaced):
        return NONE
    if not STRONG_WORDS.isdisjoint(words) or _STRONG.search(spaced):
        return STRONG
    is_weak = not WEAK_WORDS.isdisjoint(words) or _WEAK.search(spaced)
    return WEAK if is_weak and not SUSPECT.search(spaced) else NONE


@lru_cache(maxsize=4096)
def explained_subject(name: str) -> int:
    """How surely a name as a whole speaks of something else: every word must, and a word of a scale never does.

    Parameters
    ----------
    name : str
        Name of an entry, with or without its group; of a path the last part must be explained as well.

    Returns
    -------
    int
        As ``subject_of``; NONE if a word is not known.

    Examples
    --------
    >>> [explained_subject(n) for n in ("Filter frequency", "Filter wght", "Temperature factor", "Slot", "slot2.c")]
    [2, 0, 0, 1, 0]
    """
    if _OF_SAMPLES.search(name.casefold()):
        return NONE
    name = _BRACKETS.sub("", name)
    subject = _subject_of_words(words_of(name))
    last = _PATH.split(name.strip("./:\\ "))[-1]
    return subject if last == name or not subject else (subject if _subject_of_words(words_of(last)) else NONE)


def _subject_of_words(words: tuple[str, ...]) -> int:
    spaced = " ".join(words)
    if not words or _OF_SAMPLES.search(spaced) or _OF_SCALE.search(spaced):
        return NONE
    strong = (
        _words_with(_STRONG, spaced)
        | _words_with(_OTHER_OFFSET, spaced)
        | {i for i, word in enumerate(words) if word in STRONG_WORDS}
    )
    weak = _words_with(_WEAK, spaced) | {i for i, word in enumerate(words) if word in WEAK_WORDS}
    subjects = strong | weak
    if not subjects or any(i not in subjects and not _FILLER.fullmatch(word) for i, word in enumerate(words)):
        is_frequency = bool(strong) and all(
            i in subjects or _FILLER.fullmatch(word) or _OF_FREQUENCY.fullmatch(word) for i, word in enumerate(words)
        )
        return STRONG if is_frequency else NONE
    return STRONG if strong - _words_with(_RECORD, spaced) else WEAK


def _words_with(pattern: re.Pattern[str], spaced: str) -> set[int]:
    """Numbers of the words in which a match lies; a short one must be a whole word."""
    found: set[int] = set()
    for match in pattern.finditer(spaced):
        around = spaced[max(match.start() - 1, 0) : match.end() + 1].strip()
        if len(match[0]) < MIN_STEM and around != match[0]:
            continue
        found.update(range(spaced.count(" ", 0, match.start()), spaced.count(" ", 0, match.end()) + 1))
    return found
