"""An answer of the calibrated model, and the name of the effect with the most evidence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from turnout.mismatch.calibrated.belief import ACCEPTED_EFFECT, Innovation, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, change_sd
from turnout.mismatch.calibrated.constants import CALIBRATION

CHANGE, FILE = QUESTIONS = ("change", "file")
# Group of a parameter -> the effect of the library that changes it
NAMES = {
    "ballast": "local_ballast",
    "pad": "local_pad",
    "gain": "sensor_gain",
    "seat": "sensor_position",
    "depth": "surface_dip",
    "dip": "surface_dip",
    "preload": "pad_preload",
    "hardening": "ballast_hardening",
}


def stated_unit(unit: str, group: str) -> str:
    """Unit that is stated with a value: "ln" for the logarithm of a factor on the value of the file.

    Parameters
    ----------
    unit : str
        Unit of the parameter; "-" of a logarithm, of a gain, and of a factor of an accepted effect.
    group : str
        Group of the parameter.

    Returns
    -------
    str

    Examples
    --------
    >>> stated_unit("-", "ballast"), stated_unit("-", "gain"), stated_unit("m", "seat")
    ('ln', '-', 'm')
    """
    return "ln" if unit == "-" and group not in ("gain", ACCEPTED_EFFECT) else unit


@dataclass(frozen=True)
class StretchEnds:
    """Intervals of the positions of the first and the last support that have changed. [m]

    ``first`` and ``last`` are (least, largest). None is an open end: the change may reach farther than the supports
    that can be distinguished, or than the longest stretch that is compared.
    """

    first: tuple[float | None, float]
    last: tuple[float, float | None]


@dataclass(frozen=True)
class ModelAnswer:
    """Answer of the calibrated model after one ``visit``.

    ``question`` of ``QUESTIONS``; ``verdict`` "none", "named", "a_or_b" or "unknown" with its ``names``.
    ``parameter`` has changed by ``size`` (standard error ``sd``, ``unit``), or by as much per year if it ``grows``.
    ``onset``: last time without and first time with the change [years], None against the file. ``gain`` is the evidence
    less the logarithm of the number of candidates [nats], None where the answer does not rest on one. ``changed`` are
    all parameters that change alike, ``total`` is the change of each at the visit with its standard error ``total_sd``,
    whatever course the change has taken, ``ends`` are those of their stretch.
    """

    visit: str
    question: str
    verdict: str
    names: tuple[str, ...] = ()
    parameter: str = ""
    group: str = ""
    position: float | None = None
    size: float | None = None
    sd: float | None = None
    unit: str = ""
    onset: tuple[float, float] | None = None
    gain: float | None = None
    grows: bool = False
    changed: tuple[str, ...] = ()
    total: float | None = None
    total_sd: float | None = None
    ends: StretchEnds | None = None


@dataclass(frozen=True)
class LeadingEffect:
    """The effect with the most evidence."""

    parameter: str
    name: str
    group: str
    position: float | None
    unit: str
    size: tuple[float, float]
    gain: float
    onset: tuple[float, float] | None
    grows: bool

    @classmethod
    def of(
        cls,
        effect: ChangeEffect,
        by_name: Mapping[str, StateParameter],
        size: tuple[float, float],
        gain: float,
        onset: tuple[float, float] | None = None,
    ) -> LeadingEffect:
        """The effect of a candidate.

        Parameters
        ----------
        effect : ChangeEffect
        by_name : mapping of str to StateParameter
        size : (float, float)
            Size and its standard deviation.
        gain : float
            [nats]
        onset : (float, float) or None
            [years]

        Returns
        -------
        LeadingEffect
        """
        parameter = by_name.get(effect.name)
        first = parameter or by_name.get(next(iter(effect.direction)))
        group = group_of(effect, by_name)
        unit = first.unit if first and group != "dip" else "m"
        position = position_of(effect.name, parameter) if effect.position is None else effect.position
        position = _nose_near(position, by_name.values()) if group == "dip" else position
        return cls(
            effect.name.partition(",")[0], name_of(effect, by_name), group, position, unit, size, gain, onset,
            onset is not None and effect.grows,
        )  # fmt: skip

    def unknown(self, visit: str, question: str, jump: StateParameter) -> ModelAnswer:
        """Answer "unknown", at the parameter whose jump explains most.

        Parameters
        ----------
        visit, question : str
        jump : StateParameter

        Returns
        -------
        ModelAnswer
        """
        return ModelAnswer(
            visit, question, "unknown", (), jump.name, jump.group, position_of(jump.name, jump), onset=self.onset,
            gain=self.gain,
        )  # fmt: skip

    def answer(self, visit: str, question: str, names: Sequence[str]) -> ModelAnswer:
        """Answer with these names.

        Parameters
        ----------
        visit, question : str
        names : sequence of str

        Returns
        -------
        ModelAnswer
        """
        return ModelAnswer(
            visit, question, "named" if len(names) == 1 else "a_or_b", tuple(names[:2]), self.parameter, self.group,
            self.position, *self.size, self.unit, self.onset, self.gain, self.grows,
        )  # fmt: skip


def is_explained(before: Innovation, after: Innovation) -> bool:
    """Whether an effect explains the innovation of its first visit: at least a share of the excess over the expected.

    A substitute for an effect that has no name explains little of it, however much evidence it has.

    Parameters
    ----------
    before, after : Innovation

    Returns
    -------
    bool
    """
    excess = [i.statistic - i.n_directions for i in (before, after)]
    return excess[1] <= max((1.0 - CALIBRATION.min_explained_share) * excess[0], 0.0)


def with_rivals(names: Sequence[str], stated: LeadingEffect, rivals: Iterable[str]) -> list[str]:
    """The names and those of rivals, each once.

    Parameters
    ----------
    names : sequence of str
    stated : LeadingEffect
    rivals : iterable of str

    Returns
    -------
    list of str
    """
    return [*names, *(n for n in dict.fromkeys(rivals) if n not in (*names, stated.name))]


def _nose_near(position: float | None, parameters: Iterable[StateParameter]) -> float | None:
    """Position of the nose whose surface a dip changes, else that of the dip itself."""
    if position is None:
        return None
    at = position
    noses = [x for p in parameters if p.group == "depth" and (x := position_of(p.name, p)) is not None]
    nose = min(noses, key=lambda x: abs(x - at), default=at)
    return nose if abs(nose - at) <= CALIBRATION.nose_reach else at


def position_of(name: str, parameter: StateParameter | None) -> float | None:
    """Position of a candidate [m]: that of its parameter, or the number behind "@" or "at" in its name; none of a wave.

    Parameters
    ----------
    name : str
    parameter : StateParameter or None

    Returns
    -------
    float or None
    """
    if parameter is not None and parameter.position is not None:
        return parameter.position
    if parameter is not None and parameter.group == "wave":  # it names its stretch
        return None
    number = re.search(r"(?:@| at )(-?\d+(?:\.\d+)?)", name)
    return float(number.group(1)) if number else None


def name_of(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> str:
    """Name of the effect of the library that a candidate is.

    Parameters
    ----------
    effect : ChangeEffect
    by_name : mapping of str to StateParameter

    Returns
    -------
    str
    """
    return NAMES[group_of(effect, by_name)]


def group_of(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> str:
    """Group of the parameters that an effect changes, "dip" for the waves of a dip.

    Parameters
    ----------
    effect : ChangeEffect
    by_name : mapping of str to StateParameter

    Returns
    -------
    str
    """
    parameter = by_name.get(effect.name)
    return parameter.group if parameter else effect.group or "dip"


def least_size(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> float:
    """Least size of a candidate that causes any action.

    Parameters
    ----------
    effect : ChangeEffect
    by_name : mapping of str to StateParameter

    Returns
    -------
    float
    """
    group = group_of(effect, by_name)
    return CALIBRATION.least_dip if group == "dip" else dict(CALIBRATION.least_sizes)[group]


def free_shape(
    effect: ChangeEffect, parameters: Sequence[StateParameter], candidates: Sequence[ChangeEffect]
) -> list[tuple[Mapping[str, float], float]]:
    """Directions of an effect with their standard deviations. A dip of the surface may have any shape.

    Wear lowers a nose unevenly: beside the dip, all dips and numbers of the file's surface within
    ``CALIBRATION.nose_reach`` may change.

    Parameters
    ----------
    effect : ChangeEffect
    parameters : sequence of StateParameter
    candidates : sequence of ChangeEffect

    Returns
    -------
    list of (mapping, float)
        Parameter -> change per unit of size, and standard deviation of the size.
    """
    by_name = {p.name: p for p in parameters}
    at = position_of(effect.name, by_name.get(effect.name))
    directions: list[tuple[Mapping[str, float], float]] = [(effect.direction, effect.sd)]
    if group_of(effect, by_name) not in ("dip", "depth") or at is None:
        return directions
    dips = [c for c in candidates if group_of(c, by_name) == "dip" and c.grows == effect.grows]
    numbers = [p for p in parameters if p.group in ("surface", "depth")]
    near = [(position_of(c.name, None), (c.direction, c.sd)) for c in dips]
    near += [(position_of(p.name, p), ({p.name: 1.0}, change_sd(p, parameters))) for p in numbers]
    return directions + [d for x, d in near if x is not None and abs(x - at) <= CALIBRATION.nose_reach]
