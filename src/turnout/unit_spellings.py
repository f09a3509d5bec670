"""Spellings of units in one plain form: wide letters, powers, prefixes, brackets, multiples and peak values."""

import re
import unicodedata

SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺"
SUPERSCRIPT_RUN = re.compile(f"[{SUPERSCRIPTS}]+")
SUPERSCRIPTS_IN_ASCII = str.maketrans(SUPERSCRIPTS, "0123456789-+")
MARKS_IN_ASCII = str.maketrans("\u03bc∕⁄−–∙⋅•×", "µ//--···x")
# Brackets of East Asian texts, and others, each as one character of ASCII.
BRACKETS_IN_ASCII = str.maketrans("（）［］｛｝【】〔〕〖〗〈〉⟨⟩《》", "()[]{}[][][]<><><>")
PAIRS_OF_BRACKETS = ("[]", "()", "{}", "<>")

SECOND = "(?:s|se[ck]|seconds?|sekunden?)"
ACCELERATION = re.compile(
    rf"(nm|µm|um|mm|cm|dm|m|(?:milli|centi)?met(?:er|re)s?|km|ft|feet|foot|in|inch(?:es)?)"
    rf"(?: ?(?:/|per|pro) ?\(?(?:{SECOND} ?(?:(?:\^|\*\*)? ?2| squared)|{SECOND} ?[/*·] ?{SECOND})\)?"
    rf"|[ *·.]?{SECOND} ?(?:\^|\*\*)? ?\(?-2\)?)"
)
LENGTHS = {"um": "µm", "inch": "in", "inches": "in", "feet": "ft", "foot": "ft"} | {
    f"{prefix}{meter}{plural}": symbol
    for prefix, symbol in (("", "m"), ("milli", "mm"), ("centi", "cm"))
    for meter in ("meter", "metre")
    for plural in ("", "s")
}
CAMEL_CASE = re.compile(r"(?<=[a-z])(?=[A-Z])")  # "MetersPerSecondSquared"
FORCE_OF_MASS = re.compile(r"(pound|kilogram|gram)s?[ -]?force|(pound|kilopond)s?")
FORCES = {"pound": "lbf", "kilogram": "kgf", "gram": "gf", "kilopond": "kgf"}
PREFIX_APART = re.compile(r"(da|[munpµkM]) (?=(?:N|V|Pa)$)")
WORD = re.compile(r"(|milli|mi[ck]ro|de[ck]a|kilo|mega)(newton|volt|pascal)s?")
PREFIXES_OF_WORDS = {
    "": "", "milli": "m", "micro": "µ", "mikro": "µ", "deca": "da", "deka": "da", "kilo": "k", "mega": "M",
}  # fmt: skip
SYMBOLS = {"newton": "N", "volt": "V", "pascal": "Pa"}
PEAK = re.compile(r"(.*[^\W_]\)?|.*\d)[ _]?(?:0-)?\(?(?:0-)?(?:pk|peak)\)?")
# A power of ten or a number, with the sign that it multiplies: "10^3", "x 10**-3", "x10".
POWER = r"10(?:\^|\*\*)([+-]?\d{1,2})"
LEADING_MULTIPLE = re.compile(rf"(?:[x*·] ?)?(?:{POWER}|([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?))[ x*·]*(.+)")
TRAILING_POWER = re.compile(rf"(.+?) ?[x*·] ?{POWER}")
# Values over a stretch of time, of which none is a sample: a mean square, a mean, a swing from peak to peak.
OF_A_STRETCH = re.compile(
    r"(?i)(.*)(?:[ _(]|(?<=[a-z2]))(?:rms|eff|pp|p-p|pk[-/ ]?pk|p(?:ea)?k[- ](?:to[- ])?p(?:ea)?k|ptp|mean|avg)\)?"
)


def plain_unit(unit: str) -> str:
    """A unit with letters, powers and brackets of ASCII, and without the brackets around it.

    Parameters
    ----------
    unit : str
        Unit as it is written.

    Returns
    -------
    str
        "µ" is the only letter beyond ASCII that a western unit keeps, beside "°".

    Examples
    --------
    >>> plain_unit("［ｋＮ］"), plain_unit("(m/s²)"), plain_unit("10³ N"), plain_unit("㎨"), plain_unit("(m)/(s)")
    ('kN', 'm/s^2', '10^3 N', 'm/s2', '(m)/(s)')
    """
    text = SUPERSCRIPT_RUN.sub(lambda run: f"^{run[0].translate(SUPERSCRIPTS_IN_ASCII)}", unit)
    text = unicodedata.normalize("NFKC", text.translate(BRACKETS_IN_ASCII)).translate(MARKS_IN_ASCII)
    text = re.sub(r"\^\{([+-]?\d+)\}", r"^\1", text)  # of LaTeX
    return " ".join(without_brackets(text).strip("[]").split())


def without_brackets(text: str) -> str:
    """A text without the brackets of any kind around all of it.

    Parameters
    ----------
    text : str
        A unit, or a cell of a table.

    Returns
    -------
    str
        Without blanks at its ends.

    Examples
    --------
    >>> without_brackets(" [[m/(s^2)]] "), without_brackets("（g）"), without_brackets("(m)/(s)")
    ('m/(s^2)', 'g', '(m)/(s)')
    """
    text = text.strip()
    while len(text) > 1 and (pair := text[0].translate(BRACKETS_IN_ASCII) + text[-1].translate(BRACKETS_IN_ASCII)) in (
        PAIRS_OF_BRACKETS
    ):
        plain = text.translate(BRACKETS_IN_ASCII)
        depths = [plain[:k].count(pair[0]) - plain[:k].count(pair[1]) for k in range(1, len(plain))]
        if min(depths) < 1:
            break
        text = text[1:-1].strip()
    return text


def canonical_spelling(text: str) -> str:
    """The spelling of a unit that tables have, by its form: "mm s^-2" is "mm/s²", "k N" is "kN", "g pk" is "g".

    A sample in units of a peak value is an instantaneous value, as any other.

    Parameters
    ----------
    text : str
        Unit in the form of ``plain_unit``, without a factor.

    Returns
    -------
    str
        Unchanged for any other form.

    Examples
    --------
    >>> [canonical_spelling(t) for t in ("MetersPerSecondSquared", "Pounds", "kilogram-force", "m/(s*s)")]
    ['m/s²', 'lbf', 'kgf', 'm/s²']
    >>> [canonical_spelling(t) for t in ("mm s^-2", "um/s**2", "k N", "Kilonewtons", "g pk", "m/(s^2)", "ms2", "kg")]
    ['mm/s²', 'µm/s²', 'kN', 'kN', 'g', 'm/s²', 'ms2', 'kg']
    """
    if (peak := PEAK.fullmatch(text)) and not unit_of_a_stretch(text):
        text = plain_unit(peak[1])
    words = CAMEL_CASE.sub(" ", text).casefold() if re.search("[a-zA-Z]{4}", text) else text
    if match := ACCELERATION.fullmatch(words):
        return f"{LENGTHS.get(match[1], match[1])}/s²"
    if match := FORCE_OF_MASS.fullmatch(words):
        return FORCES[match[1] or match[2]]
    if match := WORD.fullmatch(text.casefold()):
        return PREFIXES_OF_WORDS[match[1]] + SYMBOLS[match[2]]
    return PREFIX_APART.sub(r"\1", text)


def unit_of_a_stretch(text: str) -> str:
    """What stands before the mark of root mean squares, means, or swings from peak to peak.

    Parameters
    ----------
    text : str
        Unit in the form of ``plain_unit``.

    Returns
    -------
    str
        "" for a text without such a mark. Any word may end as one: "supp".

    Examples
    --------
    >>> [unit_of_a_stretch(t) for t in ("g rms", "gRMS", "m/s^2 (pk-pk)", "mVpp", "g pk", "supp")]
    ['g', 'g', 'm/s^2', 'mV', '', 'su']
    """
    match = OF_A_STRETCH.fullmatch(text)
    return match[1].strip(" _(") if match else ""


def factor_and_unit(text: str) -> tuple[float, str]:
    """Factor of a unit and the unit without it.

    Parameters
    ----------
    text : str
        Unit in the form of ``plain_unit``.

    Returns
    -------
    tuple of (float, str)
        1 and the text itself without a factor.

    Examples
    --------
    >>> factor_and_unit("0.5 mV"), factor_and_unit("x10 N"), factor_and_unit("10^3 N"), factor_and_unit("N·10^3")
    ((0.5, 'mV'), (10.0, 'N'), (1000.0, 'N'), (1000.0, 'N'))
    """
    if match := LEADING_MULTIPLE.fullmatch(text):
        return float(f"1e{match[1]}" if match[1] else match[2]), match[3].strip()
    if match := TRAILING_POWER.fullmatch(text):
        return float(f"1e{match[2]}"), match[1].strip()
    return 1.0, text
