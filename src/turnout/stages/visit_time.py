"""Time of a visit as the calibrated model counts it: years of the calendar."""

from __future__ import annotations

from datetime import date

from turnout.constants import DAYS_PER_YEAR

MIDDLE_OF_MONTH = 15  # day that a visit of a whole month counts as


def years_of(visit: str) -> float:
    """Time of a visit in years; of a month its middle.

    Parameters
    ----------
    visit : str
        YYYY-MM-DD or YYYY-MM.

    Returns
    -------
    float
    """
    return date.fromisoformat(visit if len(visit) > 7 else f"{visit}-{MIDDLE_OF_MONTH}").toordinal() / DAYS_PER_YEAR


def day_of(time: float) -> str:
    """Day of a time of the calibrated model.

    Parameters
    ----------
    time : float
        [years]

    Returns
    -------
    str
        YYYY-MM-DD.

    Examples
    --------
    >>> day_of(years_of("2024-02-29"))
    '2024-02-29'
    """
    return date.fromordinal(round(time * DAYS_PER_YEAR)).isoformat()
