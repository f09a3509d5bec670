"""Values, intervals and parameters of effects in words: units that people use, no more digits than are certain."""

import math

import numpy as np

from turnout import physics
from turnout.constants import Z95_EXACT
from turnout.mismatch.engine.thresholds import THRESHOLDS

MILLI_UNITS = {"m": "mm", "s": "ms"}
LARGE_UNITS = {"N": (1e4, 1e-3, "kN"), "N s/m": (1e4, 1e-3, "kN s/m"), "N/m": (1e5, 1e-6, "MN/m")}
UNKNOWN_INTERVAL = "–"  # of a parameter without a standard error
SHARE = "share"  # unit of a share of 1, which is written in per cent
PERCENT_UNITS = {"1/K": "% per kelvin"}
NOT_CLOSED = "not determined, as no train here closes it"  # the size of a gap


def number_in_words(value: float, unit: str, digits: int = 2) -> str:
    """A value with its unit, small ones in mm or ms, large ones in kN or MN/m, shares in per cent.

    Parameters
    ----------
    value : float
        The number.
    unit : str
        Its unit.
    digits : int
        Significant digits.

    Returns
    -------
    str

    Examples
    --------
    >>> number_in_words(0.00112, "m"), number_in_words(1.31, "-"), number_in_words(0.012, "1/K")
    ('1.1 mm', '1.3', '1.2 % per kelvin')
    >>> number_in_words(1.25e5, "N s/m"), number_in_words(0.054, SHARE), number_in_words(99.7, "Hz")
    ('120 kN s/m', '5.4 %', '100 Hz')
    """
    factor, suffix = _scale(value, unit)
    number = factor * value
    rounded = float(f"{number:.{digits}g}")
    if abs(rounded) < 100:
        return f"{number:.{digits}g}{suffix}"
    return f"{rounded if factor != 1.0 else number:.0f}{suffix}"


def _scale(value: float, unit: str) -> tuple[float, str]:
    """Factor and unit, behind a space, in which a value is written."""
    if unit in PERCENT_UNITS:
        return 100.0, f" {PERCENT_UNITS[unit]}"
    if unit == SHARE:
        return 100.0, " %"
    if unit in MILLI_UNITS and abs(value) < 0.1:
        return 1e3, f" {MILLI_UNITS[unit]}"
    if unit in LARGE_UNITS and abs(value) >= LARGE_UNITS[unit][0]:
        return LARGE_UNITS[unit][1], f" {LARGE_UNITS[unit][2]}"
    return 1.0, "" if unit in ("-", "") else f" {unit}"


def estimate_in_words(value: float, low: float, high: float, unit: str) -> tuple[str, str]:
    """An estimate and its interval, both to the last digit that half the interval leaves significant.

    Parameters
    ----------
    value, low, high : float
        Estimate and limits.
    unit : str
        Their unit.

    Returns
    -------
    (str, str)
        Value, and interval with its unit.

    Examples
    --------
    >>> estimate_in_words(0.00253, 0.0, 0.00842, "m"), estimate_in_words(27.041, 27.013, 27.079, "m")
    (('3 mm', '0 to 8 mm'), ('27.04 m', '27.01 to 27.08 m'))
    >>> estimate_in_words(5.1e7, 4.06e7, 6.2e7, "N/m"), estimate_in_words(0.5, 0.5, 0.5, "-")
    (('51 MN/m', '41 to 62 MN/m'), ('0.5', '–'))
    >>> estimate_in_words(0.0076, 0.0, 0.054, SHARE), estimate_in_words(23456.0, 20100.0, 26900.0, "m/s²")
    (('1 %', '0 to 5 %'), ('23,000 m/s²', '20,000 to 27,000 m/s²'))
    >>> estimate_in_words(0.5, 0.0, float("inf"), "-")
    ('0.5', '–')
    """
    if not high > low or not math.isfinite(high - low):
        return number_in_words(value, unit, 3), UNKNOWN_INTERVAL
    factor, suffix = _scale(value, unit)
    half, numbers = 0.5 * factor * (high - low), [factor * v for v in (value, low, high)]
    exponent = math.floor(math.log10(half))
    last = exponent - (half < 2.0 * 10.0**exponent)
    mark = "," if max(map(abs, numbers)) >= 1e4 else ""
    texts = [f"{round(v, -last) + 0.0:{mark}.{max(0, -last)}f}" for v in numbers]
    return texts[0] + suffix, f"{texts[1]} to {texts[2]}{suffix}"


def interval(term: str, name: str, value: float, se: float) -> tuple[float, float]:
    """95 % interval of a term's parameter; not below 0 if it cannot be negative, a share of 1 not above 1.

    Parameters
    ----------
    term : str
        Name of the effect.
    name : str
        Name of the parameter.
    value : float
        Estimate.
    se : float
        Its standard error.

    Returns
    -------
    (float or None, float or None)
        Both limits in the unit of the parameter.

    Examples
    --------
    >>> [round(interval(*what, 0.1, 0.1)[0], 3) for what in (("hanging_sleeper", "seated"), ("kink", "depth"))]
    [0.0, -0.096]
    >>> [round(interval(*what, 0.9, 0.1)[1], 3) for what in (("loose_fastening", "lost"), ("local_pad", "factor"))]
    [1.0, 1.096]
    """
    parameters = _parameters_of(term)
    lower_limit = 0.0 if any(p.name == name and p.bounds[0] >= 0.0 for p in parameters) else -np.inf
    upper_limit = 1.0 if unit_in_words(term, name, "-") == SHARE else np.inf
    return (
        float(max(value - Z95_EXACT * se, min(lower_limit, value))),
        float(min(value + Z95_EXACT * se, max(upper_limit, value))),
    )


def parameter_in_words(term: str, name: str) -> str:
    """Name and meaning of a term's parameter; the name only for a term outside the library.

    Parameters
    ----------
    term : str
        Name of the effect.
    name : str
        Name of the parameter.

    Returns
    -------
    str

    Examples
    --------
    >>> parameter_in_words("hanging_sleeper", "gap"), parameter_in_words("kink", "depth")
    ('gap: clearance when unloaded', 'depth')
    """
    return ": ".join([name, *(p.meaning for p in _parameters_of(term) if p.name == name)])


def parameter_estimate(term: str, name: str, value: float, se: float, unit: str) -> tuple[str, str]:
    """A fitted parameter and its 95 % interval in words, ("not determined", "") where its size has no upper limit.

    Parameters
    ----------
    term : str
        Name of the effect.
    name : str
        Name of the parameter.
    value : float
        Estimate.
    se : float
        Its standard error.
    unit : str
        Unit of both.

    Returns
    -------
    (str, str)
        Value, and interval with its unit.

    Examples
    --------
    >>> parameter_estimate("hanging_sleeper", "seated", 0.0076, 0.0237, "-")
    ('1 %', '0 to 5 %')
    >>> parameter_estimate("hanging_sleeper", "gap", 0.0025, 0.003, "m")
    ('not determined, as no train here closes it', '')
    """
    effect = physics.effects_by_name().get(term)
    if effect is not None and effect.message_unbounded and name == effect.parameters[0].name:
        if se > THRESHOLDS.max_bounded_error * abs(value):
            return NOT_CLOSED, ""
    low, high = interval(term, name, value, se)
    return estimate_in_words(value, low, high, unit_in_words(term, name, unit))


def unit_in_words(term: str, name: str, unit: str) -> str:
    """Unit of a parameter for a text: ``SHARE`` for what is a share of 1.

    Parameters
    ----------
    term : str
        Name of the effect.
    name : str
        Name of the parameter.
    unit : str
        Its unit.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_in_words("hanging_sleeper", "seated", "-"), unit_in_words("local_pad", "factor", "-")
    ('share', '-')
    """
    own = next((p for p in _parameters_of(term) if p.name == name), None)
    is_share = own is not None and unit == "-" and own.neutral == own.bounds[0] == 0.0 and own.bounds[1] <= 1.0
    return SHARE if is_share else unit


def _parameters_of(term: str) -> tuple[physics.Parameter, ...]:
    """Parameters of an effect by its name, () for one outside the library."""
    effect = physics.effects_by_name().get(term)
    return effect.parameters if effect else ()
