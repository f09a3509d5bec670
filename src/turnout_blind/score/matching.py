"""Compare the answers of one case with its truth."""

from dataclasses import dataclass, field

import numpy as np

from turnout_blind.score.names import right_locks, right_names, same_parameters

BAY = 0.6  # largest error of a right position: one sleeper bay [m]
LEVEL = 46.0  # residual of controls in a held-out passage, mostly roughness [% of its norm]
NEUTRAL = {"factor": 1.0, "gain": 1.0}  # parameter values without effect; 0 for all others
CLEAR = 3.0  # loss of held-out fit above which an effect is clear [points]


@dataclass(frozen=True)
class Judged:
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
    hits: tuple
    placed: tuple
    first: bool
    wrong: tuple
    said: str
    located: dict = field(default_factory=dict)
    parameters: tuple = ()
    probability: float | None = None
    probably_right: bool | None = None
    fits: tuple = (None, None)
    gain_error: float | None = None

    @property
    def clear(self):
        """Whether the effect costs enough fit to be detectable."""
        return self.gain > CLEAR


def gain_of(visible):
    """Visibility in points of fit of an effect that makes up a share ``visible`` of the response [%].

    Its square adds to that of the control residual: sqrt(46^2 + v^2) - 46. 3 points are lost at v = 16.9 %.

    >>> round(gain_of({"hammer_pct": 1.0, "passage_pct": 16.9}), 2)
    3.01
    """
    share = max(visible["hammer_pct"], visible["passage_pct"])
    return float(np.hypot(LEVEL, share) - LEVEL)


def judge(truth, answers, more=None):
    """``CaseResult`` of a case from its truth and ``answers`` (None if the tool gave none)."""
    effects = truth["effects"]
    kinds = tuple(e["kind"] for e in effects)
    loud = [a for a in answers or () if not a.silent]
    right = [right_names(k, more) for k in kinds]
    hits = tuple(_hit(names, loud) for names in right)
    allowed = {n for names in right for n in names}
    wrong = _wrong(right, loud)
    first = bool(loud) and loud[0].verdict == "named" and loud[0].names[0] in allowed
    probability, sound = _probability(truth, answers, loud, bool(allowed), wrong)
    ahead = loud[0] if loud else (answers or [None])[0]
    return Judged(
        truth["case"], truth["stratum"], kinds, tuple(e["rung"] for e in effects), gain_of(truth["visible"]),
        bool(answers), bool(loud), hits,
        tuple(all(_where(e, n, loud).values()) for e, n in zip(effects, right)),
        first, wrong, _said(answers, loud),
        _located(effects, right, loud),
        tuple(_compared(effects, right, loud)), probability, sound,
        (None, None) if ahead is None else (ahead.before, ahead.after), ahead and ahead.gain_error,
    )  # fmt: skip


def _wrong(right, loud):
    """Names of the answers that match no effect, or only one that is named already."""
    free, wrong = list(right), []
    for answer in (a for a in loud if a.names):
        fits = next((names for names in free if set(answer.names) & set(names)), None)
        if fits is None:
            wrong.append(answer.names[0])
        else:
            free.remove(fits)
    return tuple(wrong)


def _hit(names, loud):
    for verdict in ("named", "a_or_b"):
        if any(a.verdict == verdict and set(a.names) & set(names) for a in loud):
            return verdict
    return ""


def _said(answers, loud):
    if not answers:
        return "no answer"
    if not loud:
        return "none"
    return loud[0].names[0] if loud[0].verdict == "named" else loud[0].verdict


def _probability(truth, answers, loud, known, wrong):
    """(stated probability of the answer, whether the answer is right).

    "none" is right without a clear effect, "unknown" if the library does not hold the effects (``is_known`` False).
    """
    if not answers:
        return None, None
    ahead = loud[0] if loud else answers[0]
    if ahead.probability is None:
        return None, None
    if ahead.verdict == "none":
        hidden = gain_of(truth["visible"]) <= CLEAR
        return ahead.probability, truth["stratum"] in ("control", "unidentifiable") or hidden
    if ahead.verdict == "unknown":
        return ahead.probability, bool(truth["effects"]) and not known
    return ahead.probability, not wrong


def _best(names, loud):
    """The answer that refers to an effect: one that names it, else the first."""
    return next((a for a in loud if set(a.names) & set(names)), loud[0] if loud else None)


def _located(effects, right, loud):
    """{"lock", "place", "axle", "sensor"}: True or False for each that a single effect has."""
    if len(effects) != 1:
        return {}
    effect, answer = effects[0], _best(right[0], loud)
    lock = answer is not None and answer.lock in right_locks(effect["kind"], effect["locked_to"])
    return {"lock": lock, **_where(effect, right[0], loud)}


def _where(effect, names, loud):
    """{"place", "axle", "sensor"}: True or False for each that an effect of the right ``names`` has."""
    answer, where, found = _best(names, loud), effect["where"], {}
    if effect["locked_to"] in ("place", "amplitude") and "position" in where:
        near = answer is not None and answer.position is not None
        found["place"] = near and abs(answer.position - where["position"]) <= BAY
    if "axle" in where:
        same = answer is not None and answer.axle == where["axle"]
        found["axle"] = same and answer.train == where["train"]
    if "sensor" in where:
        found["sensor"] = answer is not None and answer.sensor == where["sensor"]
    return found


def _compared(effects, right, loud):
    """(relative error, whether the 95 % interval covers the truth) of each parameter of a named effect.

    The error is relative to the size of the effect. Without a standard error the second is None.
    """
    for effect, names in zip(effects, right):
        answer = next((a for a in loud if a.verdict == "named" and set(a.names) & set(names)), None)
        for own, theirs in same_parameters(effect).items():
            if answer is None or answer.parameters.get(theirs, (None,))[0] is None:
                continue
            value, se = answer.parameters[theirs]
            truth = effect["parameters"][own]
            covers = None if se is None else abs(value - truth) <= 1.96 * se
            yield abs(value - truth) / abs(truth - NEUTRAL.get(own, 0.0)), covers
