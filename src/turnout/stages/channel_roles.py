"""What each channel of a file may be, by its unit, its name, or the shape of its signal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnout.readers.lazy import Column
from turnout.readers.source import RawRecord
from turnout.units import conversion

# Parts of names that loggers give to channels, in English, German, French, Danish, Italian and Spanish.
FORCE_WORDS = ("force", "hammer", "hamm", "kraft", "marteau", "kræft", "forza", "martell", "fuerza", "martillo", "load")
RESPONSE_WORDS = (
    "acc", "rail", "beschl", "schiene", "spor", "skinne", "rotaia", "carril", "resp", "geber", "sensor", "vib", "velo",
)  # fmt: skip
TIME_WORDS = ("time", "zeit", "temps", "tid", "tempo", "tiempo", "timestamp", "x_value", "t")
ROLE_OF_QUANTITY = {"force": "force", "acceleration": "response", "velocity": "response", "displacement": "response"}
MAX_EXAMINED = 2**20  # samples from which the shape of a signal is judged
MAX_PULSE = 0.01  # s: the pulses of a hammer are shorter
MIN_RATIO = 2.0  # the shortest pulses are those of the force if the next shortest are so much longer
MIN_CREST = 8.0  # peak over root mean square of a signal that consists of single pulses


@dataclass(frozen=True)
class ChannelRole:
    """``name`` is "force", "response", "time", "other" or "" (not known); ``why`` is the evidence.

    ``rank`` orders channels of one role: 0 by the unit, 1 by the name, 2 by the shape of the signal.
    """

    name: str
    why: str = ""
    rank: int = 0


def channel_roles(record: RawRecord, rate: float | None) -> tuple[ChannelRole, ...]:
    """Role of each channel of a record.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    rate : float or None
        Sampling rate, None where it is not known: then no shape is judged. [Hz]

    Returns
    -------
    tuple of ChannelRole
        In the order of the channels.
    """
    roles = [_role_by_unit_or_name(name, unit) for name, unit in zip(record.names, record.units)]
    roles = [_time_axis(x) or role if not role.name else role for role, x in zip(roles, record.samples)]
    unknown = [i for i, role in enumerate(roles) if not role.name]
    if rate is not None and unknown and not any(role.name == "force" for role in roles):
        judged = [i for i, role in enumerate(roles) if role.name in ("", "response")]
        force = _most_impulsive([record.samples[i] for i in judged], rate)
        if force is not None and judged[force[0]] in unknown:
            roles[judged[force[0]]] = ChannelRole("force", force[1], 2)
    has_force = any(role.name == "force" for role in roles)
    for i in unknown:
        if not roles[i].name and has_force:
            roles[i] = ChannelRole("response", "a channel beside the force", 3)
    return tuple(roles)


def _role_by_unit_or_name(name: str, unit: str) -> ChannelRole:
    try:
        dimension = conversion(unit).dimension if unit else ""
    except ValueError:
        dimension = ""
    if dimension in ROLE_OF_QUANTITY:
        return ChannelRole(ROLE_OF_QUANTITY[dimension], f"its unit {unit} is one of {dimension}", 0)
    if dimension and dimension not in ("voltage", "count") and unit != "-":
        return ChannelRole("other", f"its unit {unit} is one of {dimension}")
    plain = name.strip().casefold()
    if re.split(r"[\s\[(]", plain)[0] in TIME_WORDS:
        return ChannelRole("time", "its name")
    if any(word in plain for word in FORCE_WORDS):
        return ChannelRole("force", "its name", 1)
    if any(word in plain for word in RESPONSE_WORDS):
        return ChannelRole("response", "its name", 1)
    return ChannelRole("")


def _time_axis(column: Column) -> ChannelRole | None:
    """The role of a column that rises evenly, else None."""
    head = np.asarray(column[:1000])
    if head.dtype.kind not in "fiu" or len(head) < 8:
        return None
    steps = np.diff(head.astype(float))
    step = float(np.median(steps))
    if step > 0.0 and np.all(np.abs(steps - step) <= 0.5 * step):
        return ChannelRole("time", f"it rises evenly, by {step:.6g} per sample")
    return None


def _most_impulsive(columns: Sequence[Column], rate: float) -> tuple[int, str] | None:
    """(index, evidence) of the signal of the shortest pulses, None if it does not stand out."""
    if len(columns) < 2:
        return None
    lengths, crests = np.array([_pulse_length(np.asarray(x[:MAX_EXAMINED], dtype=float)) for x in columns]).T
    order = np.argsort(lengths)
    first, second = order[0], order[1]
    shortest, next_shortest = lengths[first] / rate, lengths[second] / rate
    if crests[first] < MIN_CREST or shortest > MAX_PULSE or lengths[second] < MIN_RATIO * lengths[first]:
        return None
    return int(first), f"its pulses are the shortest: {1e3 * shortest:.2g} ms, the next {1e3 * next_shortest:.2g} ms"


def _pulse_length(x: np.ndarray) -> tuple[float, float]:
    r"""Length of the largest pulse [samples] and crest factor of a signal.

    .. math:: n = \frac{(\sum x_k^2)^2}{\sum x_k^4}

    over the stretch around the largest value in which the signal returns to a tenth of it for good.
    """
    x = x[np.isfinite(x)]
    x = x - np.median(x) if x.size else x
    top = np.max(np.abs(x), initial=0.0)
    if top == 0.0:
        return np.inf, 0.0
    k = int(np.argmax(np.abs(x)))
    quiet = 200
    loud = np.flatnonzero(np.abs(x) > 0.1 * top)
    gaps = np.flatnonzero(np.diff(loud) > quiet)
    after = loud[gaps[loud[gaps] >= k]]
    before = loud[gaps + 1][loud[gaps + 1] <= k]
    stretch = x[int(before[-1]) if before.size else loud[0] : (int(after[0]) if after.size else loud[-1]) + 1] / top
    energy = float(np.sum(stretch**2))
    return energy**2 / float(np.sum(stretch**4)), float(top / np.sqrt(np.mean(x**2)))
