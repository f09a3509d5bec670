"""Numbers in texts: limits without an exponent of a programming language, evidence with the odds that it means."""

from __future__ import annotations

import math
import re

LARGEST_ODDS = 1_000_000  # to 1: beyond, the number tells nobody anything
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_DECIMAL_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def decimal_number(text: str) -> float:
    """The number that a person wrote: digits with a decimal point, with or without a sign and an exponent.

    Python and YAML also read "24_6" as 246 and "0x18" as 24, which nobody means in a table or an option.

    Parameters
    ----------
    text : str
        Text of a cell, an option or a value; blanks around it do not count.

    Returns
    -------
    float
        The number.

    Raises
    ------
    ValueError
        For any other text, "nan" and "inf" included.

    Examples
    --------
    >>> decimal_number("24.6"), decimal_number(" -2e4 "), decimal_number(".5")
    (24.6, -20000.0, 0.5)
    >>> decimal_number("24_6")
    Traceback (most recent call last):
    ValueError: '24_6' is no decimal number
    """
    if not _DECIMAL_NUMBER.fullmatch(text.strip()):
        raise ValueError(f"{text!r} is no decimal number")
    return float(text)


def number_text(value: float) -> str:
    """A limit as a message states it: in digits, with marks for thousands from a million on, else a power of ten.

    Parameters
    ----------
    value : float
        The limit.

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> number_text(10_000_000), number_text(250), number_text(0.004), number_text(1e-6), number_text(-2.5e6)
    ('10,000,000', '250', '0.004', '0.000001', '-2,500,000')
    >>> number_text(1e15), number_text(-2e9), number_text(1e-12), number_text(0.0), number_text(float("inf"))
    ('10¹⁵', '-2·10⁹', '10⁻¹²', '0', 'inf')
    >>> number_text(999_999.7), number_text(0.00009999999)
    ('1,000,000', '0.0001')
    """
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    value = float(f"{value:.6g}")  # the digits of a limit; 999,999.7 is a million
    exponent = math.floor(math.log10(abs(value)) + 1e-12)
    if -4 <= exponent < 6:
        return f"{value:g}"
    if 6 <= exponent < 9:
        return f"{value:,.0f}"
    if -6 <= exponent < 0:
        return f"{value:.{5 - exponent}f}".rstrip("0")
    return power_of_ten_text(value)


def value_with_half_width(value: float, half_width: float, unit: str = "") -> str:
    """A value with the half width of its 95 % interval, which has two significant digits.

    Parameters
    ----------
    value : float
        The value.
    half_width : float
        Half width of its 95 % interval, in the unit of the value.
    unit : str
        Unit; "" or "-" for none.

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> value_with_half_width(0.238154, 0.00104), value_with_half_width(1234.5, 67.8, "N/m")
    ('0.2382 ± 0.0010 (95 %)', '1234 ± 68 N/m (95 %)')
    >>> value_with_half_width(0.5, float("nan")), value_with_half_width(2.0, 0.0)
    ('0.5, uncertainty not known', '2, uncertainty not known')
    """
    unit = "" if unit in ("", "-") else f" {unit}"
    if not (math.isfinite(half_width) and half_width > 0.0):
        return f"{value:.4g}{unit}, uncertainty not known"
    n_decimals = max(0, 1 - math.floor(math.log10(float(f"{half_width:.1e}"))))
    return f"{value:z.{n_decimals}f} ± {half_width:.{n_decimals}f}{unit} (95 %)"


def power_of_ten_text(value: float, n_digits: int = 6) -> str:
    """A number as a multiple of a power of ten.

    Parameters
    ----------
    value : float
        Finite and not 0.
    n_digits : int
        Largest number of significant digits.

    Returns
    -------
    str
        Its text; the power alone where the multiple is one.

    Examples
    --------
    >>> power_of_ten_text(1.5e-5), power_of_ten_text(-1e9), power_of_ten_text(9.9996e5, n_digits=3)
    ('1.5·10⁻⁵', '-10⁹', '10⁶')
    """
    mantissa, _, exponent = f"{value:.{n_digits - 1}e}".partition("e")
    power = "10" + str(int(exponent)).translate(_SUPERSCRIPTS)
    mantissa = f"{float(mantissa):.{n_digits}g}"
    return {"1": power, "-1": f"-{power}"}.get(mantissa, f"{mantissa}·{power}")


def evidence_in_words(nats: float) -> str:
    """Evidence with its unit, and as odds of the likelier to the less likely explanation.

    Parameters
    ----------
    nats : float
        Log Bayes factor. [nats]

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> evidence_in_words(12.0), evidence_in_words(4.0), evidence_in_words(80.0)
    ('12 nats, odds of 160,000 to 1', '4.0 nats, odds of 55 to 1', '80 nats, odds above 1,000,000 to 1')
    >>> evidence_in_words(-3.0), evidence_in_words(0.24), evidence_in_words(float("inf"))
    ('-3.0 nats, odds of 1 to 20', '0.2 nats, odds of 1.3 to 1', 'infinite nats, odds above 1,000,000 to 1')
    """
    number = f"{nats:.{int(abs(nats) < 10.0)}f}" if math.isfinite(nats) else "infinite"
    if abs(nats) > math.log(LARGEST_ODDS):
        size = f"above {LARGEST_ODDS:,} to 1" if nats > 0.0 else f"below 1 to {LARGEST_ODDS:,}"
        return f"{number} nats, odds {size}"
    ratio = math.exp(abs(nats))
    odds = f"{ratio:.2g}" if ratio < 10.0 else f"{float(f'{ratio:.2g}'):,.0f}"
    return f"{number} nats, odds of {f'{odds} to 1' if nats >= 0.0 else f'1 to {odds}'}"
