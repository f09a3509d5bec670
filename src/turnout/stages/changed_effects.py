"""Accepted changes as effects of a single visit: the base model contains them, and each visit estimates their size.

The entry of an accepted change has no size. So its effect starts without one, under a wide prior.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from turnout.stages.accepted_changes import MAX_DISTANCE, AcceptedChange
from turnout.stages.accepted_effects import AcceptedEffect

# Effect of a change -> effects of a visit: name, field of the position, parameter, value without effect, a third of
# the prior standard deviation, in the unit of the parameter. The bed beside a gap may be soft, too.
SOFT_BED = ("local_ballast", "sleeper", "factor", 1.0, 0.3)
EFFECTS: Mapping[str, tuple[tuple[str, str, str, float, float], ...]] = {
    "local_ballast": (SOFT_BED,),
    "hanging_sleeper": (SOFT_BED, ("hanging_sleeper", "sleeper", "gap", 0.0, 3e-4)),
    "local_pad": (("local_pad", "sleeper", "factor", 1.0, 0.3),),
    "sensor_gain": (("sensor_gain", "channel_name", "gain", 1.0, 0.1),),
    "sensor_position": (("sensor_position", "channel_name", "shift", 0.0, 0.1),),
    "surface_dip": (("surface_dip", "place", "depth", 0.0, 3e-4),),
}


def changed_effects(
    changes: Iterable[AcceptedChange], time: float, supports: Sequence[float] | np.ndarray, sensors: Mapping[str, float]
) -> tuple[AcceptedEffect, ...]:
    """Effects that a visit may show of accepted changes.

    Parameters
    ----------
    changes : iterable of AcceptedChange
    time : float
        Of the visit. Changes that began later are none of it. [years]
    supports : (n,) sequence of float
        Positions of the supports. [m]
    sensors : mapping
        Channel -> position of its sensor. [m]

    Returns
    -------
    tuple of AcceptedEffect
        One for each support, sensor or dip, without a size.

    Examples
    --------
    >>> change = AcceptedChange("local_pad", 7.2, 7.8, since=2024.0, until=2024.5)
    >>> [e.key for e in changed_effects([change], 2025.0, [6.6, 7.2, 7.8], {})]
    ['local_pad[7.2 m]', 'local_pad[7.8 m]']
    >>> changed_effects([change], 2023.9, [6.6, 7.2, 7.8], {})
    ()
    """
    effects = {e.key: e for c in changes if c.since < time for e in _effects_of(c, supports, sensors)}
    return tuple(effects.values())


def _effects_of(
    change: AcceptedChange, supports: Sequence[float] | np.ndarray, sensors: Mapping[str, float]
) -> Iterator[AcceptedEffect]:
    low, high = change.first - MAX_DISTANCE, change.last + MAX_DISTANCE
    sites: dict[str, list] = {
        "sleeper": [round(float(x), 3) for x in supports if low < x < high],
        "channel_name": [name for name, x in sensors.items() if low <= x <= high],
        "place": [0.5 * (change.first + change.last)],
    }
    for family, field, parameter, neutral, error in EFFECTS[change.term]:
        for site in sites[field]:
            yield AcceptedEffect(family, {field: site}, {parameter: (neutral, error)})
