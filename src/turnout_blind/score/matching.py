"""Compare the answers of one case with its truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.score.names import right_locks, right_names, same_parameters

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from turnout_blind.score.answers import Answer

MAX_POSITION_ERROR = 0.6  # largest error of a right position: one sleeper bay [m]
CONTROL_RESIDUAL = 46.0  # residual of controls in a held-out passage, mostly roughness [% of its norm]
NEUTRAL_VALUES = {"factor": 1.0, "gain": 1.0}  # parameter values without effect; 0 for all others
MIN_CLEAR_GAIN = 3.0  # loss of held-out fit above which an effect is clear [points]


@dataclass(frozen=True)
class CaseResult:
    """Result of one case. ``matches`` per effect: "named", "a_or_b" or "".

    ``is_located`` per effect: whether its position, axle and sensor are right. ``wrong_names`` are names of answers
    without a right one.
    """

    case: str
    stratum: str
    kinds: tuple
    rungs: tuple
    gain: float
    answered: bool
    alarm: bool
    matches: tuple
    is_located: tuple
    is_first_right: bool
    wrong_names: tuple
    first_answer: str
    located: dict = field(default_factory=dict)
    parameters: tuple = ()
    probability: float | None = None
    is_answer_right: bool | None = None
    fits: tuple = (None, None)
    gain_error: float | None = None

    @property
    def is_clear(self) -> bool:
        """Whether the effect costs enough fit to be detectable."""
        return self.gain > MIN_CLEAR_GAIN


def gain_of(visible: Mapping[str, float]) -> float:
    """Visibility in points of fit of an effect that makes up a share of the response.

    Its square adds to that of the control residual: sqrt(46^2 + v^2) - 46. 3 points are lost at v = 16.9 %.

    Parameters
    ----------
    visible : mapping
        Shares "hammer_pct" and "passage_pct". [%]

    Returns
    -------
    float
        Visibility. [points of fit]

    Examples
    --------
    >>> round(gain_of({"hammer_pct": 1.0, "passage_pct": 16.9}), 2)
    3.01
    """
    share = max(visible["hammer_pct"], visible["passage_pct"])
    return float(np.hypot(CONTROL_RESIDUAL, share) - CONTROL_RESIDUAL)


def judge(
    truth: Mapping[str, Any], answers: Sequence[Answer] | None, extra_names: Mapping[str, Sequence[str]] | None = None
) -> CaseResult:
    """Result of a case from its truth and the answers.

    Parameters
    ----------
    truth : mapping
        Truth of the case.
    answers : sequence of Answer or None
        Answers; None: the tool gave none.
    extra_names : mapping or None
        Right names of added effects by kind.

    Returns
    -------
    CaseResult
        The result.
    """
    effects = truth["effects"]
    kinds = tuple(e["kind"] for e in effects)
    alarms = [a for a in answers or () if not a.says_none]
    right_by_effect = [right_names(k, extra_names) for k in kinds]
    matches = tuple(_match_verdict(names, alarms) for names in right_by_effect)
    allowed = {n for names in right_by_effect for n in names}
    wrong_names = _wrong_names(right_by_effect, alarms)
    is_first_right = bool(alarms) and alarms[0].verdict == "named" and alarms[0].names[0] in allowed
    probability, is_right = _stated_probability(truth, answers, alarms, bool(allowed), wrong_names)
    leading = alarms[0] if alarms else answers[0] if answers else None
    return CaseResult(
        truth["case"], truth["stratum"], kinds, tuple(e["rung"] for e in effects), gain_of(truth["visible"]),
        bool(answers), bool(alarms), matches,
        tuple(all(_position_checks(e, n, alarms).values()) for e, n in zip(effects, right_by_effect)),
        is_first_right, wrong_names, _first_answer_text(answers, alarms),
        _location_checks(effects, right_by_effect, alarms),
        tuple(_parameter_errors(effects, right_by_effect, alarms)), probability, is_right,
        (None, None) if leading is None else (leading.before, leading.after),
        None if leading is None else leading.gain_error,
    )  # fmt: skip


def _wrong_names(right_by_effect: Sequence[Sequence[str]], alarms: Sequence[Answer]) -> tuple[str, ...]:
    """Names of the answers that match no effect, or only one that is named already."""
    unmatched, wrong_names = list(right_by_effect), []
    for answer in (a for a in alarms if a.names):
        match = next((names for names in unmatched if set(answer.names) & set(names)), None)
        if match is None:
            wrong_names.append(answer.names[0])
        else:
            unmatched.remove(match)
    return tuple(wrong_names)


def _match_verdict(names: Sequence[str], alarms: Sequence[Answer]) -> str:
    for verdict in ("named", "a_or_b"):
        if any(a.verdict == verdict and set(a.names) & set(names) for a in alarms):
            return verdict
    return ""


def _first_answer_text(answers: Sequence[Answer] | None, alarms: Sequence[Answer]) -> str:
    if not answers:
        return "no answer"
    if not alarms:
        return "none"
    return alarms[0].names[0] if alarms[0].verdict == "named" else alarms[0].verdict


def _stated_probability(
    truth: Mapping[str, Any],
    answers: Sequence[Answer] | None,
    alarms: Sequence[Answer],
    is_known: bool,
    wrong_names: Sequence[str],
) -> tuple[float | None, bool | None]:
    """(stated probability of the answer, whether the answer is right).

    "none" is right without a clear effect, "unknown" if the library does not hold the effects (``is_known`` False).
    """
    if not answers:
        return None, None
    leading = alarms[0] if alarms else answers[0]
    if leading.probability is None:
        return None, None
    if leading.verdict == "none":
        is_hidden = gain_of(truth["visible"]) <= MIN_CLEAR_GAIN
        return leading.probability, truth["stratum"] in ("control", "unidentifiable") or is_hidden
    if leading.verdict == "unknown":
        return leading.probability, bool(truth["effects"]) and not is_known
    return leading.probability, not wrong_names


def _answer_to(names: Sequence[str], alarms: Sequence[Answer]) -> Answer | None:
    """The answer that refers to an effect: one that names it, else the first."""
    return next((a for a in alarms if set(a.names) & set(names)), alarms[0] if alarms else None)


def _location_checks(
    effects: Sequence[Mapping[str, Any]], right_by_effect: Sequence[Sequence[str]], alarms: Sequence[Answer]
) -> dict[str, bool]:
    """{"lock", "place", "axle", "sensor"}: True or False for each that a single effect has."""
    if len(effects) != 1:
        return {}
    effect, answer = effects[0], _answer_to(right_by_effect[0], alarms)
    lock = answer is not None and answer.lock in right_locks(effect["kind"], effect["locked_to"])
    return {"lock": lock, **_position_checks(effect, right_by_effect[0], alarms)}


def _position_checks(effect: Mapping[str, Any], names: Sequence[str], alarms: Sequence[Answer]) -> dict[str, bool]:
    """{"place", "axle", "sensor"}: True or False for each that an effect of the right ``names`` has."""
    answer, where = _answer_to(names, alarms), effect["where"]
    checks: dict[str, bool] = {}
    if effect["locked_to"] in ("place", "amplitude") and "position" in where:
        position = None if answer is None else answer.position
        checks["place"] = position is not None and abs(position - where["position"]) <= MAX_POSITION_ERROR
    if "axle" in where:
        checks["axle"] = answer is not None and answer.axle == where["axle"] and answer.train == where["train"]
    if "sensor" in where:
        checks["sensor"] = answer is not None and answer.sensor == where["sensor"]
    return checks


def _parameter_errors(
    effects: Sequence[Mapping[str, Any]], right_by_effect: Sequence[Sequence[str]], alarms: Sequence[Answer]
) -> Iterator[tuple[float, bool | None]]:
    """(relative error, whether the 95 % interval covers the truth) of each parameter of a named effect.

    The error is relative to the size of the effect. Without a standard error the second is None.
    """
    for effect, names in zip(effects, right_by_effect):
        answer = next((a for a in alarms if a.verdict == "named" and set(a.names) & set(names)), None)
        for name, tool_name in same_parameters(effect).items():
            if answer is None or answer.parameters.get(tool_name, (None,))[0] is None:
                continue
            value, se = answer.parameters[tool_name]
            truth = effect["parameters"][name]
            covers = None if se is None else abs(value - truth) <= 1.96 * se
            yield abs(value - truth) / abs(truth - NEUTRAL_VALUES.get(name, 0.0)), covers
