"""Effects that recorded work has ended: what the visits before it show is no longer so."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, compare_onsets
from turnout.mismatch.calibrated.file_comparison import evidence_from_first
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import VisitInformation

Shapes = Sequence[tuple[Mapping[str, float], float]]  # directions with their standard deviations, as ``free_shape``


def newest_work(effect: ChangeEffect, events: Iterable[Event], after: float, until: float) -> float | None:
    """Time of the newest recorded work on a parameter of an effect, ``after`` < time <= ``until``.

    Parameters
    ----------
    effect : ChangeEffect
    events : iterable of Event
        Accepted changes, which open directions, are no work.
    after, until : float
        [years]

    Returns
    -------
    float or None
        [years]
    """
    return max((e.time for e in events if after < e.time <= until and e.opened.keys() & effect.direction), default=None)


def agrees_with_file(
    effect: ChangeEffect,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
) -> bool:
    """Whether an effect is less probable than not at these visits, which the file alone precedes.

    Parameters
    ----------
    effect : ChangeEffect
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
        At least one.
    events : sequence of Event

    Returns
    -------
    bool
    """
    history = estimate_history(parameters, visits, events, accepted=None)
    return bool(evidence_from_first(history, [effect])[0][0] <= 0.0)


def size_after_work(history: History, effect: ChangeEffect, since: float, size: tuple[float, float]) -> float | None:
    """Size of a change after recorded work if it is more probable than not, either as any size or as before the work.

    Parameters
    ----------
    history : History
        As for ``compare_onsets``, without the visits between the change and the work.
    effect : ChangeEffect
        Whether it grows makes no difference.
    since : float
        Time of the last visit without it. [years]
    size : (float, float)
        Before the work, with its standard deviation.

    Returns
    -------
    float or None
        None where the work has ended it. With the other sign than before the work, it is another change.
    """
    (evidence,) = compare_onsets(history, [replace(effect, grows=False)])
    k = int(np.flatnonzero(evidence.times == since)[0])
    information = evidence.size_sds[k] ** -2 - effect.sd**-2
    if information <= 0.0:  # nothing is known after the work
        return size[0]
    value, variance = evidence.sizes[k] / (evidence.size_sds[k] ** 2 * information), 1.0 / information
    with_noise = variance + size[1] ** 2
    of_same_size = 0.5 * (
        value**2 / variance - (value - size[0]) ** 2 / with_noise - float(np.log(with_noise / variance))
    )
    gain = max(float(evidence.gains[k]), float(of_same_size) if value * size[0] > 0.0 else -np.inf)
    return float(evidence.sizes[k]) if gain > 0.0 else None


def repair_events(shapes: Shapes, size: float, times: Iterable[float]) -> list[Event]:
    """Process noise in place of an effect that has ended: at these times it may take any size.

    Parameters
    ----------
    shapes : sequence of (mapping, float)
        The first is that of the effect.
    size : float
        Of the effect.
    times : iterable of float
        [years]

    Returns
    -------
    list of Event
    """
    (direction, sd), *others = shapes
    wide = [(direction, max(sd, abs(size))), *others]
    return [Event(t, {}, dict(d), s) for t in times for d, s in wide]
