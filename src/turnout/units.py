"""Units of raw files and layouts, and their conversion to SI."""

import math
import re
from dataclasses import dataclass
from functools import lru_cache

from turnout.constants import KMH, STANDARD_GRAVITY
from turnout.unit_spellings import canonical_spelling, factor_and_unit, plain_unit, unit_of_a_stretch

IGNORED = "ignored"  # quantity of a channel that is in the file and is not read

# dimension -> {spelling: (scale, offset)} with SI = scale * number + offset
UNITS = {
    "voltage": {"V": (1.0, 0.0), "mV": (1e-3, 0.0), "µV": (1e-6, 0.0), "kV": (1e3, 0.0)},
    "count": {"count": (1.0, 0.0)},
    "force": {
        "N": (1.0, 0.0),
        "mN": (1e-3, 0.0),
        "daN": (10.0, 0.0),
        "hN": (100.0, 0.0),
        "kN": (1e3, 0.0),
        "MN": (1e6, 0.0),
        "gf": (1e-3 * STANDARD_GRAVITY, 0.0),
        "kgf": (STANDARD_GRAVITY, 0.0),
        "tf": (1e3 * STANDARD_GRAVITY, 0.0),
        "dyn": (1e-5, 0.0),
        "lbf": (4.4482216152605, 0.0),
        "kip": (4448.2216152605, 0.0),
    },
    "acceleration": {
        "m/s²": (1.0, 0.0),
        "nm/s²": (1e-9, 0.0),
        "µm/s²": (1e-6, 0.0),
        "mm/s²": (1e-3, 0.0),
        "cm/s²": (1e-2, 0.0),
        "dm/s²": (0.1, 0.0),
        "km/s²": (1e3, 0.0),
        "ft/s²": (0.3048, 0.0),
        "in/s²": (0.0254, 0.0),
        "g": (STANDARD_GRAVITY, 0.0),
        "mg": (1e-3 * STANDARD_GRAVITY, 0.0),
        "µg": (1e-6 * STANDARD_GRAVITY, 0.0),
    },
    "velocity": {"m/s": (1.0, 0.0), "mm/s": (1e-3, 0.0), "km/h": (1 / KMH, 0.0)},
    "displacement": {"m": (1.0, 0.0), "mm": (1e-3, 0.0), "µm": (1e-6, 0.0)},
    "strain": {"m/m": (1.0, 0.0), "µm/m": (1e-6, 0.0), "%": (1e-2, 0.0)},
    "pressure": {"Pa": (1.0, 0.0), "kPa": (1e3, 0.0)},
    "temperature": {"°C": (1.0, 0.0), "K": (1.0, -273.15), "°F": (5 / 9, -160 / 9)},
}
# Units of parameter files, compound ones included: spelling -> (SI unit, factor)
PARAMETER_UNITS = {
    "-": ("-", 1.0),
    "%": ("-", 0.01),
    "dB": ("dB", 1.0),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "µm": ("m", 1e-6),
    "kg": ("kg", 1.0),
    "t": ("kg", 1e3),
    "kg/m": ("kg/m", 1.0),
    "kg m²": ("kg m²", 1.0),
    "t m²": ("kg m²", 1e3),
    "kg/m³": ("kg/m³", 1.0),
    "Pa": ("Pa", 1.0),
    "MPa": ("Pa", 1e6),
    "N/mm²": ("Pa", 1e6),
    "GPa": ("Pa", 1e9),
    "m⁴": ("m⁴", 1.0),
    "cm⁴": ("m⁴", 1e-8),
    "mm⁴": ("m⁴", 1e-12),
    "m²": ("m²", 1.0),
    "cm²": ("m²", 1e-4),
    "mm²": ("m²", 1e-6),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "N/m": ("N/m", 1.0),
    "kN/m": ("N/m", 1e3),
    "MN/m": ("N/m", 1e6),
    "kN/mm": ("N/m", 1e6),
    "N s/m": ("N s/m", 1.0),
    "kN s/m": ("N s/m", 1e3),
    "N s/m²": ("N s/m²", 1.0),
    "N/m^1.5": ("N/m^1.5", 1.0),
    "GN/m^1.5": ("N/m^1.5", 1e9),
    "s/m": ("s/m", 1.0),
    "N/m per N": ("N/m per N", 1.0),
    "m/s²": ("m/s²", 1.0),
    "m/s": ("m/s", 1.0),
    "km/h": ("m/s", 1.0 / KMH),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "1/s": ("1/s", 1.0),
    "Hz": ("Hz", 1.0),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "1/K": ("1/K", 1.0),
    "°C": ("°C", 1.0),
}


def parameter_unit(text: str) -> tuple[str, float] | None:
    """SI unit and factor of a unit of parameter files, also where it is typed without superscripts or blanks.

    Parameters
    ----------
    text : str
        The unit as it is written.

    Returns
    -------
    tuple of (str, float) or None
        SI unit, and the factor that leads to it; None for an unknown unit.

    Examples
    --------
    >>> parameter_unit("kN/mm"), parameter_unit("kg/m3"), parameter_unit("kNs/m"), parameter_unit("mn/m")
    (('N/m', 1000000.0), ('kg/m³', 1.0), ('N s/m', 1000.0), None)
    """
    spelling = re.sub(r"[·*]", " ", text)
    spelling = re.sub(r"(?<=m)\^?([234])(?![\d.])", lambda match: "²³⁴"[int(match[1]) - 2], spelling)
    spelling = re.sub(r"(?<=N)s(?=/)", " s", spelling)
    return PARAMETER_UNITS.get(" ".join(spelling.split()))


SPELLINGS = {
    "V": "v",
    "µV": "uV",
    "count": "counts Counts COUNT cts digit digits ADC LSB lsb",
    "kgf": "kp kg-f kg_f kgF KGF",
    "tf": "t-f t_f tonf",
    "gf": "g-f",
    "lbf": "lb_f lb-f lb lbs LBF",
    "kip": "kips klbf",
    "dyn": "dyne dynes",
    "cm/s²": "Gal gal",
    "g": "gn g_n g0 g_0 G gravity g's G's Gs gee gees",
    "m/s": "MeterPerSecond MetersPerSecond",
    "km/h": "kph KilometerPerHour",
    "m": "meter Meter metre",
    "mm": "millimeter Millimeter millimetre",
    "µm": "um micrometer Micrometer",
    "m/m": "strain -",
    "µm/m": "um/m µstrain ustrain microstrain ue µε",
    "°C": "degC deg_C Celsius celsius DegreeCelsius C",
    "K": "Kelvin kelvin",
    "°F": "degF Fahrenheit",
}
SI = {
    "force": "N",
    "acceleration": "m/s²",
    "velocity": "m/s",
    "displacement": "m",
    "strain": "m/m",
    "pressure": "Pa",
    "temperature": "°C",
}
_CANONICAL = {plain_unit(name): name for units in UNITS.values() for name in units}
_CANONICAL |= {plain_unit(spelling): name for name, spellings in SPELLINGS.items() for spelling in spellings.split()}
_CANONICAL |= {"deg C": "°C", "Deg C": "°C", "deg F": "°F", "Deg F": "°F", "ug": "µg"}


# Letters of units in Russian. Without г, the gram: the acceleration of gravity is written with a Latin letter.
CYRILLIC = str.maketrans(dict(zip("кНмсВГцдБ", "kNmsVHzdB")))
CYRILLIC_LETTER = re.compile(r"[\u0400-\u04ff]")


def in_latin(text: str) -> str:
    """A text with the letters of Russian units in Latin.

    Parameters
    ----------
    text : str
        A unit, or a number with its unit.

    Returns
    -------
    str
        Unchanged without a Cyrillic letter.

    Examples
    --------
    >>> in_latin("20 кГц"), in_latin("м/с²"), in_latin("мкс"), in_latin("kN")
    ('20 kHz', 'm/s²', 'µs', 'kN')
    """
    return text.replace("мк", "µ").translate(CYRILLIC) if CYRILLIC_LETTER.search(text) else text


@dataclass(frozen=True)
class Conversion:
    """SI = ``scale`` * number + ``offset``, of ``dimension`` (a key of ``UNITS``)."""

    dimension: str
    scale: float
    offset: float = 0.0


def _canonical_name(text: str) -> str | None:
    """Name of a unit in ``UNITS``, without a factor; None if it is not known."""
    return _CANONICAL.get(text) or _CANONICAL.get(plain_unit(canonical_spelling(text)))


def is_of_a_stretch(unit: str) -> bool:
    """Whether a unit says that its numbers are no samples: root mean squares, means, or swings from peak to peak.

    Parameters
    ----------
    unit : str
        Unit as it is written.

    Returns
    -------
    bool
        False where no known unit stands before the mark.

    Examples
    --------
    >>> [is_of_a_stretch(unit) for unit in ("g rms", "0.5 mVpp", "m/s² (pk-pk)", "g pk", "kp", "supp", "left mean")]
    [True, True, True, False, False, False, False]
    """
    _, name = factor_and_unit(unit_of_a_stretch(in_latin(plain_unit(unit))))
    return _canonical_name(name) is not None


@lru_cache(maxsize=1024)
def conversion(unit: str) -> Conversion:
    """Conversion of numbers in a unit to SI; a leading factor is the value of one step or of full scale.

    Parameters
    ----------
    unit : str
        Unit as a file or layout writes it; "µ" may be either of its two code points.

    Returns
    -------
    Conversion
        Dimension, scale and offset.

    Raises
    ------
    ValueError
        For a unit that is not in the table.

    Examples
    --------
    >>> conversion("kN").scale
    1000.0
    >>> conversion("0.5 mV").scale
    0.0005
    >>> round(conversion("°F").scale * 32 + conversion("°F").offset, 9)
    0.0
    """
    text = in_latin(plain_unit(unit))
    factor, name = 1.0, _canonical_name(text)
    if name is None:
        factor, text = factor_and_unit(text)
        name = _canonical_name(text)
    if name is None and is_of_a_stretch(unit):
        raise ValueError(
            f"the unit {unit!r} is not known: such values are taken over a stretch of time, and no samples"
        )
    if name is None or not math.isfinite(factor) or factor == 0:
        alike = sorted({known for spelling, known in _CANONICAL.items() if spelling.lower() == text.lower()})
        hint = f" (did you mean {' or '.join(map(repr, alike))}?)" if alike else ""
        known_units = ", ".join(sorted(set(_CANONICAL.values())))
        raise ValueError(f"the unit {unit!r} is not known{hint}; known are {known_units}")
    dimension = next(d for d, units in UNITS.items() if name in units)
    scale, offset = UNITS[dimension][name]
    return Conversion(dimension, factor * scale, offset)


@lru_cache(maxsize=1024)
def to_si(quantity: str, unit: str, sensitivity: float | None = None, sensitivity_unit: str = "") -> Conversion:
    r"""Conversion from raw numbers in ``unit`` to the SI unit of ``quantity``.

    .. math:: x = \frac{u}{S}, \quad [S] = \mathrm{mV/N},\ \mathrm{mV/g},\ \mathrm{count/N} \ldots
        \qquad x = u S, \quad [S] = \mathrm{N/V},\ \mathrm{N/count} \ldots

    Parameters
    ----------
    quantity : str
        A key of ``SI``.
    unit : str
        Unit of the raw numbers, electrical or physical, with an optional factor: "0.305 mV" where one
        step of the converter is 0.305 mV, "10 V" where 1.0 is a full scale of 10 V.
    sensitivity : float or None
        Required for electrical units; not used for physical ones.
    sensitivity_unit : str
        Unit of the sensitivity, such as "mV/N".

    Raises
    ------
    ValueError
        For a unit that cannot become the SI unit of ``quantity``.

    Examples
    --------
    A hammer of 0.23 mV/N: 1 V is 4347.8 N.

    >>> round(to_si("force", "V", 0.23, "mV/N").scale, 1)
    4347.8
    """
    if quantity == IGNORED:
        return Conversion(IGNORED, 1.0)
    if quantity not in SI:
        raise ValueError(f"the quantity {quantity!r} is not known; known are {', '.join(SI)}")
    raw = conversion(unit)
    if raw.dimension == quantity:
        return raw
    if sensitivity is None:
        raise ValueError(f"{unit!r} is no unit of {quantity} and no sensitivity is given")
    if not math.isfinite(sensitivity) or sensitivity <= 0:
        raise ValueError(f"the sensitivity must be above 0, not {sensitivity!r}; use the sign to turn a channel around")
    numerator, denominator = _split_fraction(sensitivity_unit)
    ratio = sensitivity * numerator.scale / denominator.scale
    if (numerator.dimension, denominator.dimension) == (raw.dimension, quantity):
        return Conversion(quantity, raw.scale / ratio)
    if (numerator.dimension, denominator.dimension) == (quantity, raw.dimension):
        return Conversion(quantity, raw.scale * ratio)
    raise ValueError(f"a sensitivity in {sensitivity_unit!r} does not lead from {unit!r} to {SI[quantity]!r}")


def volts_per_unit(quantity: str, sensitivity: float, sensitivity_unit: str) -> float | None:
    """Sensitivity of a sensor in volts per SI unit of what it measures.

    Parameters
    ----------
    quantity : str
        A key of ``SI``.
    sensitivity : float
        The sensitivity.
    sensitivity_unit : str
        Its unit, such as "mV/N" or "N/V".

    Returns
    -------
    float or None
        None if the unit is none between volts and this quantity.

    Examples
    --------
    >>> volts_per_unit("force", 0.23, "mV/N"), volts_per_unit("force", 4000.0, "N/V"), volts_per_unit("force", 2, "N")
    (0.00023, 0.00025, None)
    """
    try:
        numerator, denominator = _split_fraction(sensitivity_unit)
    except ValueError:
        return None
    ratio = sensitivity * numerator.scale / denominator.scale
    dimensions = (numerator.dimension, denominator.dimension)
    if dimensions == ("voltage", quantity):
        return ratio
    return 1.0 / ratio if dimensions == (quantity, "voltage") and ratio else None


def _split_fraction(unit: str) -> tuple[Conversion, Conversion]:
    """Numerator and denominator of a unit: "mV/(m/s²)" -> voltage, acceleration; "m/s²/V" -> acceleration, voltage."""
    text = unit.strip()
    for numerator, _, denominator in (text.partition("/"), text.rpartition("/")):
        try:
            return conversion(_strip_brackets(numerator)), conversion(_strip_brackets(denominator))
        except ValueError:
            continue
    raise ValueError(f"the sensitivity's unit {unit!r} is not of the form mV/N, mV/(m/s²), N/count")


def _strip_brackets(text: str) -> str:
    text = text.strip()
    return text[1:-1] if text.startswith("(") and text.endswith(")") else text
