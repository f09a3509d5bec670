"""Words for what metadata state beside rate, scale and unit of the samples: identity, counts, dates, settings.

``subject_of`` is the only question: does a name speak of such a thing. A strong word explains any value ("filter",
"temperature", "trigger"). A weak word ("number", "range", "level") does not where another word of the name speaks of a
rate, a scale or a unit: "Range factor". Words are compared without case and accents; stems count
at the beginning of a word and of a part of a compound.
"""

import re
from functools import lru_cache

from turnout.readers.rate_words import words_of

STRONG, WEAK, NONE = 2, 1, 0

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
    r"|prog$|hyster|filt|high ?pass|low ?pass|bandpass|hochpass|tiefpass|passe|tuning|switching|inverter"
    r"|umricht|propre|egen(?:sv|frek)|cutoff|cut off|coupure|corner|grenz|notch|alias|butter|bessel|window"
    r"|fenster|fenetre|ventana|finestra|overlap|averag|mittel|moyenn|median|detrend|taper|zero ?pad|fft"
    r"|spectr|spektr|octav|terz|lines?$|band|resonan|risonan|eigenfr|eigensv|natural|modal|mode "
    r"|damp(?!fung|fer)|stiff|steif|raideur|pinned|coheren|koharen|snr|noise|rausch|bruit|crest|scheitel|kurtos"
    r"|skewness|leq$|quality factor|guete|gute|safety|sicherheit|contact|kontakt|rise|anstieg|montee|subida"
    r"|salita|stigtid|hold|timeout|delay|verzog|retard|retraso|laten|pretrig|posttrig|vorlauf|nachlauf"
    r"|vorgesch|retr[yi]|max\w* (?:sampl|rate|freq)|peak (?:time|freq)|alarm|overload|uberst|clip|linearit"
    r"|nonlin|transverse|tolera|uncert|unsicher|accura|error|fehler|crosstalk|cmrr|thd|sensitiv|empfind"
    r"|sensibil|gevoelig|folsom|citliv|czul|carrier|trager|porteus|portador|modulat|mains|netz|powerline"
    r"|power line|response|excit|anreg|tone$|sweep range|decay|abkling"
    r"|(?:data|file|block|header|byte|index) ?offset|full ?scale(?! ?count)"
    r"|calibration (?:period|interval|due)|time ?(?:const|offset|scale)|start ?offset|span\b(?! of)|time ?zone"
    r"|zeitkonst|constante de temps|transient|referen|bezug|freq\w* (?:range|resp|limit)"
    r"|frequenz(?:bereich|gang)|gamme de freq|usable|nutzbar|tach|puls|rev$|rotat|drehz|heart|cpu|ram$"
    r"|display|anzeig|plot|screen|zoom|print|map$|karte$|drawing|zeichn"
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
        "trace peak max min rms mean std var tau label axis quality point points mode q sensor transducer name file "
        "files path n no of num size pos ch ver ref reference calibration cal calib calibrated interval"
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
# Words that make a statement about the samples of any subject: "Nyquist", "Empfindlichkeitskorrektur", "channel 2 in".
_OF_SAMPLES = re.compile(r"\bnyquist|corre[ckz]t|korrekt|correz|\b(?:in|as)$|\w per \w")


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
    words = words_of(re.sub(r"[\[({][^\[\](){}]*[\])}]", "", name))
    spaced = " ".join(words)
    if _OF_SAMPLES.search(spaced):
        return NONE
    if not STRONG_WORDS.isdisjoint(words) or _STRONG.search(spaced):
        return STRONG
    is_weak = not WEAK_WORDS.isdisjoint(words) or _WEAK.search(spaced)
    return WEAK if is_weak and not SUSPECT.search(spaced) else NONE
