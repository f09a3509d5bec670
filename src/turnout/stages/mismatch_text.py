"""Sentences that describe a finding to the person who inspects the track."""

import json
from collections.abc import Mapping, Sequence
from string import Formatter
from typing import Any

from turnout import physics
from turnout.constants import Z95_EXACT
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.stages.parameter_text import (
    UNKNOWN_INTERVAL,
    estimate_in_words,
    interval,
    number_in_words,
    unit_in_words,
)

MIN_SURFACE_DEVIATION = 2.0  # prior standard deviations from the track file's value that are worth a sentence
ONE_SUPPORT = 0.31  # m to either side; an interval of a position that is larger contains several supports
UNFINISHED = "Whether something is missing is open"
MAX_MEASUREMENTS, MAX_EFFECTS = 2, 2  # in the sentence on what was not examined; the page has all


PARAMETER_NAMES = {
    "place": "position",
    "power": "power of the flanks (1 straight, 2 parabolas)",
    "share": "share before the deepest point",
}


def headline(finding: Mapping[str, Any]) -> str:
    """The ``title``, followed by the reason of a named verdict.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
    """
    text, reason = title(finding), json.loads(finding["evidence_json"] or "{}").get("reason")
    if finding["verdict"] != "named" or not reason or not json.loads(finding["term_json"] or "[]"):
        return text
    return f"{text} {reason[:1].upper()}{reason[1:]}."


def title(finding: Mapping[str, Any]) -> str:
    """One sentence: the effect that the simulation left out, or the verdict instead.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
    """
    terms = json.loads(finding["term_json"] or "[]")
    if finding["verdict"] in ("named", "a_or_b") and terms:
        rivals = [finding["rival_term"] if finding["verdict"] == "a_or_b" else None, *(None for _ in terms[1:])]
        pairs = zip(terms, rivals)
        return "; ".join(effect_in_words(t, finding) + _rival_text(t.get("or", rival)) for t, rival in pairs) + "."
    low, high = finding["place_low_m"], finding["place_high_m"]
    if finding["verdict"] == "unknown":
        where = _location_text(finding, low, high)
        evidence = json.loads(finding.get("evidence_json") or "{}")
        if evidence.get("is_ambiguous"):
            return f"Something is there {where}, and these recordings cannot name it: {evidence['reason']}."
        if evidence.get("cause") == "all trains":
            return whole_sentence(evidence["reason"])
        if not evidence.get("is_finished", True):
            return f"{UNFINISHED}, as the search was not finished. The simulation differs most {where}."
        return f"Something is missing {where}, and no known effect explains it."
    return finding["sentence"] or ""


def whole_sentence(text: str) -> str:
    """The text with a capital and a full stop.

    Parameters
    ----------
    text : str
        Not empty.

    Returns
    -------
    str

    Examples
    --------
    >>> whole_sentence("no passage resembles the simulation of its train")
    'No passage resembles the simulation of its train.'
    """
    return f"{text[0].upper()}{text[1:]}."


def requirements_in_words(unexamined: Sequence[Any]) -> str:
    """One sentence on what recordings cannot show, by the measurements that could: first that of most effects.

    Parameters
    ----------
    unexamined : sequence
        Each with its ``words`` and ``measurement``.

    Returns
    -------
    str
        "" where nothing is left out.

    Examples
    --------
    >>> from types import SimpleNamespace as Effect
    >>> requirements_in_words([Effect(words="a soft pad", measurement="hammer tests")])
    'These recordings cannot show a soft pad (needs hammer tests).'
    """
    groups: dict[str, list[str]] = {}
    for u in unexamined:
        groups.setdefault(u.measurement, []).append(u.words)
    texts = []
    for measurement, effects in sorted(groups.items(), key=lambda item: -len(item[1]))[:MAX_MEASUREMENTS]:
        more = len(effects) - MAX_EFFECTS
        words = "; ".join([*effects[:MAX_EFFECTS], *([f"{more} more"] if more > 0 else [])])
        texts.append(f"{words} (needs {measurement})")
    return f"These recordings cannot show {'; '.join(texts)}." if texts else ""


def surface_sentence(estimate: Mapping[str, Any]) -> str:
    """A sentence on a number of the running surface that differs from the track's file, "" if it agrees.

    Parameters
    ----------
    estimate : mapping
        One of ``surface_estimates``.

    Returns
    -------
    str
        "" where the file may be right.

    Examples
    --------
    >>> depth = {"term": "running_surface_kink", "place": 26.7, "name": "depth", "unit": "m", "filed": 1e-3}
    >>> surface_sentence({**depth, "value": 4e-3, "se": 1e-4, "off": 2.8})
    'The depth of the kink at 26.7 m is 4 mm (3.8 to 4.2 mm), the track file has 1 mm.'
    >>> surface_sentence({**depth, "value": 1.3e-3, "se": 1e-4, "off": 0.5})
    ''
    """
    if estimate["off"] < MIN_SURFACE_DEVIATION:
        return ""
    half = Z95_EXACT * estimate["se"]
    values = estimate["value"], estimate["value"] - half, estimate["value"] + half, estimate["filed"]
    value, low, high, filed = (number_in_words(v, estimate["unit"], 3) for v in values)
    name, feature = (
        PARAMETER_NAMES.get(estimate["name"], estimate["name"]),
        estimate["term"].removeprefix("running_surface_").replace("_", " "),
    )
    subject = f"{name} of the {feature} at {estimate['place']:.1f} m"
    return f"The {subject} is {value} ({low.removesuffix(' mm')} to {high}), the track file has {filed}."


def _rival_text(rival: str | None) -> str:
    name = (rival or "").replace("_", " ")
    return f", or the effect is “{name}”: these recordings cannot distinguish the two" if rival else ""


def _location_text(finding: Mapping[str, Any], low: float, high: float) -> str:
    """Location of the effect in words, else the range of the measurements."""
    if finding["position_m"] is not None:
        position, margin = finding["position_m"], 2.0 * (finding["position_se_m"] or 0.0)
        interval = f", between {position - margin:.1f} and {position + margin:.1f} m"
        return f"at {position:.1f} m" + interval * (margin > ONE_SUPPORT)
    if finding["train"]:
        train, axle = _train_and_axle(finding)
        return f"on axle {axle} of {train}" if axle else f"on {train}"
    if finding["channel"]:
        return f"in channel {finding['channel']}"
    between = f"between {low:.1f} and {high:.1f} m" if high - low > 0.1 else f"about {low:.1f} m"
    return f"{between} that comes and goes without a wheel" if finding["locked_to"] == "clock" else between


def _train_and_axle(finding: Mapping[str, Any]) -> tuple[str, int | None]:
    """Name of the train that a finding is fixed to, without the axle that follows in its column, and the axle or None.

    >>> _train_and_axle({"train": "IC 2000, axle 3", "axle": 3}), _train_and_axle({"train": "IC 2000", "axle": None})
    (('IC 2000', 3), ('IC 2000', None))
    """
    train, axle = finding["train"], finding["axle"]
    return (train.removesuffix(f", axle {axle}") if axle else train), axle


def _position_text(positions: Sequence[float], shift: float, possible: Sequence[float] | None) -> str:
    """Middle of the positions of an effect, with the range of those that are possible.

    >>> _position_text((8.4,), 0.0, (7.8, 8.4)), _position_text((7.8, 9.0), 0.0, None), _position_text((), 0.0, None)
    ('8.4 m (7.8 to 8.4 m)', '8.4 m', 'an unknown place')
    """
    if not positions:
        return "an unknown place"
    text = f"{sum(positions) / len(positions) + shift:.1f} m"
    return f"{text} ({possible[0]:.1f} to {possible[1]:.1f} m)" if possible else text


def _wheel_text(train: str, axle: int | None, rivals: Sequence[int] = ()) -> str:
    """Axle of a train in words, with those that may be the one instead.

    >>> _wheel_text("IC 2000", 3), _wheel_text("IC 2000", 3, (4,)), _wheel_text("a train", None)
    ('axle 3 of IC 2000', 'axle 3 or 4 of IC 2000', 'an axle of a train')
    """
    return f"axle {' or '.join(map(str, (axle, *rivals)))} of {train}" if axle else f"an axle of {train}"


def effect_in_words(term: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """The message of an effect, with its position and sizes, without a full stop.

    Parameters
    ----------
    term : mapping
        As ``accepted_effects.describe_term`` gives it.
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
    """
    fixed = term["fixed"]
    axle = fixed["wheel"] + 1 if "wheel" in fixed else None
    train = fixed.get("train") or (_train_and_axle(finding)[0] if finding["train"] else "a train")
    of_supports = [fixed[k] for k in ("sleeper", "support", "first", "last", "place") if k in fixed]
    positions = [term["position"]] if "position" in term else of_supports
    shift = term["parameters"].get("shift", {"value": 0.0})["value"] if "place" in fixed else 0.0
    words = {name: str(value) for name, value in fixed.items()}
    words |= {name: _estimate(term, name)[0] for name in term["parameters"]}
    words |= {f"{name}_size": _estimate(term, name, of_size=True)[0] for name in term["parameters"]}
    words |= {
        "place": _position_text(positions, shift, term.get("possible_positions")),
        "channel": fixed.get("channel_name") or finding["channel"] or "?",
        "train": train,
        "wheel": _wheel_text(train, axle, term.get("rival_axles", ())),
    }
    try:
        template = _sentence_template(term)
        return template.format(**words) + _intervals(term, template)
    except KeyError:  # an effect outside the library, or one with other parameters when it was reported
        return f"{term['term'].replace('_', ' ').capitalize()} at {words['place']}"


def _estimate(term: Mapping[str, Any], name: str, of_size: bool = False) -> tuple[str, str]:
    """A parameter of an effect and its 95 % interval in words, or those of its absolute value."""
    p = term["parameters"][name]
    low, high = interval(term["term"], name, p["value"], p["se"])
    values = (-p["value"], -high, -low) if of_size and p["value"] < 0.0 else (p["value"], low, high)
    return estimate_in_words(*values, unit_in_words(term["term"], name, p["unit"]))


def _intervals(term: Mapping[str, Any], template: str) -> str:
    """The 95 % intervals of the parameters in a sentence; of the size with its meaning where the sentence has none.

    "" where the sentence says that the size has no upper limit.
    """
    effect = physics.effects_by_name()[term["term"]]
    if template == effect.message_unbounded:
        return ""
    fields = {field for _, field, _, _ in Formatter().parse(template) if field}
    stated = [n for n in term["parameters"] if {n, f"{n}_size"} & fields]
    if not stated and effect.parameters[0].name not in term["parameters"]:
        return ""
    if not stated:
        size = effect.parameters[0]
        value, limits = _estimate(term, size.name)
        return f" ({size.meaning}: {value}" + (f", 95 % interval {limits})" if limits != UNKNOWN_INTERVAL else ")")
    limits_of = {n: _estimate(term, n, f"{n}_size" in fields)[1] for n in stated}
    limits_of = {n: limits for n, limits in limits_of.items() if limits != UNKNOWN_INTERVAL}
    if not limits_of:
        return ""
    names = "; ".join(limits if len(limits_of) == 1 else f"{n} {limits}" for n, limits in limits_of.items())
    return f" (95 % interval{'s' * (len(limits_of) > 1)}: {names})"


def _sentence_template(term: Mapping[str, Any]) -> str:
    effect = physics.effects_by_name()[term["term"]]
    size = term["parameters"].get(effect.parameters[0].name)
    if effect.message_negative and size and size["value"] < 0.0:
        return effect.message_negative
    is_unbounded = size and size["se"] > THRESHOLDS.max_bounded_error * abs(size["value"])
    return effect.message_unbounded if effect.message_unbounded and is_unbounded else effect.message
