"""How precisely a file can state a sampling rate: as a double, in single precision, or in the digits that it prints."""

import numpy as np

EXACT = 1e-9
SINGLE = 2.0**-23  # one unit in the last place of a 32 bit float
TEXT = 1e-6
FEWEST_DIGITS = 4


def single_precision(value: float) -> bool:
    """Whether a number may have gone through a 32 bit float.

    >>> single_precision(float(np.float32(1 / 44100))), single_precision(1 / 44100)
    (True, False)
    """
    with np.errstate(over="ignore"):
        return float(np.float32(value)) == value


def step_precision(step: float) -> float:
    """Relative size of one unit in the last digit of a time step [s], or what single precision leaves of it.

    One unit, not half of it: some exporters cut digits off instead of rounding. Fewer than four digits are taken for a
    round number as it was meant: 5E-05 is no 6E-05 cut off.

    >>> print(f"{step_precision(2.267574e-05):.1e} {step_precision(5e-05):.1e} {step_precision(1 / 44100):.1e}")
    4.4e-07 1.0e-09 1.0e-09
    """
    digits = repr(float(step)).partition("e")[0].replace(".", "").strip("0")
    printed = 1.0 / int(digits) if digits.isdigit() and len(digits) >= FEWEST_DIGITS else 0.0
    return max(EXACT, printed, SINGLE if single_precision(step) else 0.0)
