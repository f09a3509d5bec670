"""Describe a finding in words for the check on site: the missing effect, position, time and certainty."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from turnout.constants import Z95_EXACT
from turnout.counts import count_of
from turnout.mismatch.calibrated.levels import IMPACTS
from turnout.number_text import evidence_in_words
from turnout.stages.mismatch_text import title
from turnout.stages.parameter_text import (
    estimate_in_words,
    interval,
    number_in_words,
    parameter_in_words,
    unit_in_words,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

__all__ = [
    "ANSWERS",
    "accepted_parameters",
    "answer",
    "check",
    "facts",
    "parameters",
    "rivals",
    "title",
    "unmet_requirements",
]
FRAMES = {"place": "position", "condition": "recordings at"}  # others are called as in the glossary
MIN_STATED_EVIDENCE = 1.0  # nats: weaker evidence, odds below 3 to 1, singles out no condition (convention)
ANSWERS = {  # verdict: its word, as in docs/mismatch.md, and what it means
    "named": ("named", "the effect that the simulation lacks"),
    "a_or_b": ("a or b", "two effects explain the recordings equally well"),
    "unknown": ("unknown", "no effect in the catalogue explains the difference"),
    "numerics": ("numerics", "the numerical error of the simulation is too large"),
    "none": ("none", "no more difference than at intact turnouts"),
}


def parameters(finding: Mapping[str, Any]) -> list[dict]:
    """Name, value with its 95 % interval, and unit of every fitted parameter.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    list of dict
        ``effect``, ``name``, ``value`` and ``interval`` in words.
    """
    rows = []
    for term in json.loads(finding["term_json"] or "[]"):
        for name, p in term["parameters"].items():
            low, high = interval(term["term"], name, p["value"], p["se"])
            rows.append(_parameter(term["term"], None, name, p["value"], low, high, p["unit"]))
    return rows


def accepted_parameters(rows: Iterable[Mapping[str, Any]]) -> list[dict]:
    """The same for effects accepted in the track file and estimated again.

    Parameters
    ----------
    rows : iterable of mapping
        Rows of ``mismatch_parameters``.

    Returns
    -------
    list of dict
        ``effect``, ``name``, ``value`` and ``interval`` in words.
    """
    names = ("term", "position_m", "parameter", "value", "value_low", "value_high", "unit")
    return [_parameter(*(row[name] for name in names)) for row in rows if row["accepted"]]


def _parameter(
    term: str, position: float | None, name: str, value: float, low: float | None, high: float | None, unit: str
) -> dict[str, str]:
    effect = term.replace("_", " ") + (f" at {position:.1f} m" if position is not None else "")
    unit = unit_in_words(term, name, unit)
    if low is None or high is None:
        text, interval_text = number_in_words(value, unit, 3), "–"
    else:
        text, interval_text = estimate_in_words(value, low, high, unit)
    return {
        "effect": effect,
        "name": parameter_in_words(term, name),
        "value": text,
        "interval": interval_text,
    }


def facts(finding: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is known of a finding: position, frame that it is fixed to, band, time, amount of data, certainty.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    list of (str, str)
        Question and answer.
    """
    evidence = json.loads(finding["evidence_json"] or "{}")
    pairs = [("Where", _where(finding)), (_frame_question(finding), _frame_words(finding, evidence))]
    if finding["band_low_hz"] is not None and finding["verdict"] not in ("none", "numerics"):
        pairs.append(("Band", _band(finding, evidence)))
    if finding["wheel_within_m"] is not None and finding["verdict"] not in ("none", "numerics"):
        pairs.append(
            ("When", f"four fifths of it while a wheel is within {finding['wheel_within_m']:.1f} m of the sensor")
        )
    if words := _conditions(evidence):
        rests = finding["verdict"] in ("named", "a_or_b")
        question = "The name rests on" if rests else "Most evidence in"
        pairs.append((question, words + (_held_out_words(finding) if rests else "")))
    pairs.append(("From", _amount(finding)))
    pairs.append(("Prediction", _held_out_fit(finding)))
    pairs.append(("How sure", _certainty(finding, evidence)))
    return [(question, answer) for question, answer in pairs if answer]


def _where(finding: Mapping[str, Any]) -> str:
    if finding["position_m"] is not None:
        error = finding["position_se_m"]
        return (
            f"{finding['position_m']:.1f} m"
            + (f" ± {Z95_EXACT * error:.2f} m" if error else "")
            + " from the switch toe"
        )
    if finding["channel"]:
        return f"sensor {finding['channel']}"
    if finding["verdict"] in ("named", "a_or_b"):
        return "everywhere among these sensors"
    low, high = finding["place_low_m"], finding["place_high_m"]
    if finding["verdict"] == "none":
        return f"examined: {low:.1f} to {high:.1f} m"
    return f"somewhere in {low:.1f} to {high:.1f} m" if high - low > 0.1 else f"about {low:.1f} m"


def _frame_words(finding: Mapping[str, Any], evidence: Mapping[str, Any]) -> str:
    """What the residual is fixed to: the significant frames, strongest first."""
    if finding["train"]:
        return f"the train: {finding['train']}"
    frames = [f for f in evidence.get("frames", ()) if f["q"] is not None and f["q"] < 0.05]
    words = [
        f"{FRAMES.get(f['frame'], f['frame'])} {f['level']}{' m' * (f['frame'] == 'place')} "
        f"({f['effect_db']:+z.1f} dB, false discovery rate {f['q']:.3f}, n = {f['n']})"
        for f in frames[:3]
    ]
    if finding["verdict"] in ("named", "a_or_b", "unknown") and finding["locked_to"]:
        most = f"; the residual of the base model is largest at {'; '.join(words)}" if words else ""
        return f"{_owner(finding)}{most}"
    return "; ".join(words) or "no position, sensor or train stands out"


def _frame_question(finding: Mapping[str, Any]) -> str:
    """A verdict without a deviation has nothing that could be fixed to something."""
    return "Largest deviation" if finding["verdict"] in ("none", "numerics") else "It is fixed to"


def _held_out_fit(finding: Mapping[str, Any]) -> str:
    """Fit where nothing is compared with it, so that it has no panel; else ""."""
    compared = [finding[key] for key in ("fit_after_pct", "fit_rival_pct", "fit_decoy_pct")]
    if finding["fit_before_pct"] is None or not finding["n_held_out"] or any(fit is not None for fit in compared):
        return ""
    return f"fit {finding['fit_before_pct']:.0f} % on {count_of(finding['n_held_out'], 'held-out recording')}"


def _owner(finding: Mapping[str, Any]) -> str:
    """What a named effect belongs to, in words."""
    if finding["locked_to"] in ("sensor", "clock") and finding["channel"]:
        return f"sensor {finding['channel']}"
    owners = {
        "place": "its position on the track",
        "condition": "load or temperature",
        "amplitude": "how strong the load is",
    }
    return owners.get(finding["locked_to"], f"the {finding['locked_to']}")


def _conditions(evidence: Mapping[str, Any]) -> str:
    gains = sorted(((v or 0.0, k) for k, v in evidence.get("by_condition", {}).items()), reverse=True)
    return "; ".join(f"{k} ({evidence_in_words(v)})" for v, k in gains[:3] if v >= MIN_STATED_EVIDENCE)


def _band(finding: Mapping[str, Any], evidence: Mapping[str, Any]) -> str:
    """Band of the evidence. That of impacts is far above the band in which trains are compared."""
    gains = {name: value or 0.0 for name, value in evidence.get("by_condition", {}).items()}
    is_of_impacts = bool(gains and finding["n_passages"]) and max(gains, key=gains.__getitem__).startswith(IMPACTS)
    of_impacts = " under impacts; trains are compared in a lower band, see their spectra" if is_of_impacts else ""
    return f"{finding['band_low_hz']:.0f} to {finding['band_high_hz']:.0f} Hz{of_impacts}"


def _held_out_words(finding: Mapping[str, Any]) -> str:
    """Words where the recordings that were held out do not decide, "" where they do or where there are none."""
    before, after, error = (finding.get(k) for k in ("fit_before_pct", "fit_after_pct", "fit_gain_se_pct"))
    if before is None or after is None or error is None or not finding["n_held_out"]:
        return ""
    half = Z95_EXACT * error
    if abs(after - before) > half:
        return ""
    n = count_of(finding["n_held_out"], "held-out recording")
    return f"; {n} alone would not decide ({after - before:+z.1f} ± {half:.1f} points of fit)"


def _amount(finding: Mapping[str, Any]) -> str:
    counts = [
        (finding["n_hammer_tests"], "hammer test"),
        (finding["n_passages"], "passage"),
        (finding["n_sensors"], "installed sensor"),
    ]
    return ", ".join(f"{n} {what}{'s' if n != 1 else ''}" for n, what in counts)


def _certainty(finding: Mapping[str, Any], evidence: Mapping[str, Any]) -> str:
    words = f"probability {finding['probability']:.2f}" if finding["probability"] is not None else ""
    if finding["grade"] == "A":
        words += "; with it the recordings are predicted as well as an intact turnout's"
    if finding["grade"] == "B":
        words += "; with it the residual is still larger than at an intact turnout"
    if evidence.get("reason"):
        words += f"; {evidence['reason']}"
    stated = [evidence, *evidence["beside"]] if evidence.get("beside") else []
    each = ", ".join(_single_effect(s, s is not evidence) for s in stated if s["term"])
    return f"{words}; each by itself: {each}" if each else words


def _single_effect(effect: Mapping[str, Any], further: bool) -> str:
    """Name and probability of one of several effects; for a ``further`` one also its reason, given only here."""
    why = f" ({effect['reason']})" if further and effect.get("reason") else ""
    return f"{effect['term'].replace('_', ' ')} {effect['probability']:.2f}{why}"


def answer(finding: Mapping[str, Any]) -> str:
    """The verdict in a few words.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
        Verdict and grade.
    """
    words, _ = ANSWERS[finding["verdict"]]
    return f"{words}, grade {finding['grade']}" if finding["grade"] else words


def check(finding: Mapping[str, Any]) -> str:
    """What to do on site, a sentence.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
        The sentence.
    """
    if finding["verdict"] == "none":
        return "Nothing to check."
    if finding["verdict"] == "numerics":
        return "Nothing on site: refine the mesh and the time step of the simulation."
    action = finding["next_measurement"] or "Inspect the track at this position; repeat the measurement"
    return action.rstrip(".") + "."


def unmet_requirements(finding: Mapping[str, Any]) -> list[dict]:
    """What the recordings cannot show, why, and the measurement that could; one row for all with the same reason.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    list of dict
        ``what``, ``lack`` and ``measurement`` in words.
    """
    effects: dict[tuple[str, str], list[str]] = {}
    for u in json.loads(finding["evidence_json"] or "{}").get("not_examined", ()):
        effects.setdefault((u["lack"], u["measurement"]), []).append(u["what"])
    return [
        {"what": "; ".join(what), "lack": lack, "measurement": measurement}
        for (lack, measurement), what in effects.items()
    ]


def rivals(finding: Mapping[str, Any]) -> list[dict]:
    """Rivals: name, evidence over the base model [nats], share of the excess explained.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    list of dict
        ``name``, ``nats`` and ``explained`` in words, the best first.
    """
    evidence = json.loads(finding["evidence_json"] or "{}")
    return [
        {
            "name": r["family"].replace("_", " "),
            "nats": f"{r['nats']:+z.0f}" if r["nats"] is not None else "–",
            "explained": f"{100 * r['explained']:.0f} %" if r["explained"] is not None else "–",
        }
        for r in evidence.get("ranking", ())
    ]
