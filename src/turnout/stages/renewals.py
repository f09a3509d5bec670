"""Visits since the renewal of a turnout: what was measured before says nothing of the new structure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

from turnout.config.events import RENEWAL, now
from turnout.constants import DAYS_PER_YEAR
from turnout.stages.visit_time import day_of, years_of
from turnout.stages.work_days import recorded_events

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig

Value = TypeVar("Value")


def renewal_of(turnout: TurnoutConfig) -> float | None:
    """Day of the newest recorded renewal of the whole turnout, None without one; a planned one has not happened.

    Parameters
    ----------
    turnout : TurnoutConfig

    Returns
    -------
    float or None
        [years]
    """
    days = [
        e.first_day_after.toordinal() / DAYS_PER_YEAR
        for e in recorded_events(turnout)
        if e.kind == RENEWAL and e.section is None and e.at <= now()
    ]
    return max(days, default=None)


def since_renewal(turnout: TurnoutConfig, by_visit: Mapping[str, Value]) -> dict[str, Value]:
    """Values of the visits on or after the newest renewal of the whole turnout; of all without one.

    Parameters
    ----------
    turnout : TurnoutConfig
    by_visit : mapping
        Visit -> value. A month counts as its middle.

    Returns
    -------
    dict
        In the given order.
    """
    renewal = renewal_of(turnout)
    return {visit: value for visit, value in by_visit.items() if renewal is None or years_of(visit) >= renewal}


def renewal_note(turnout: TurnoutConfig) -> str:
    """Words on the renewal for an error without visits, "" without a renewal.

    Parameters
    ----------
    turnout : TurnoutConfig

    Returns
    -------
    str
    """
    renewal = renewal_of(turnout)
    return "" if renewal is None else f" since its renewal on {day_of(renewal)}"
