"""The finding of an open alarm in one sentence: what, where, since when, and what the trains say."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnout.constants import Z95


def sentence_of(row: Mapping[str, Any], n_with_trains: int = 0) -> str:
    """The finding in one sentence, every value with its interval and the number of recordings.

    Parameters
    ----------
    row : mapping
        Row of ``change_findings``; without "trains_visit" no train tells of it.
    n_with_trains : int
        Visits whose trains, too, are part of the answer.

    Returns
    -------
    str
    """
    basis = f"{row['n_recordings']} hammer tests of {row['n_visits']} visits"
    basis += f", and the trains of {n_with_trains} of them" if n_with_trains else ""
    if row["verdict"] == "none":
        if row["n_visits"] < 2:
            return f"{basis}: at least two visits are needed"
        return f"{basis}: no change at any support has enough evidence"
    position = _position_words(row)
    if row["verdict"] == "unknown":
        since = _since_words(row)
        return (
            f"something has changed{position}{since and f', {since}'}, and no effect of a support explains it ({basis})"
        )
    names = " or ".join(_effect_words(n, row["change"]) for n in (row["term"], row["rival_term"]) if n)
    size = f"{_change_words(row)}{_beside_words(row)}{_parameter_words(row)}"
    words = f"{names}{position}: {size}, {_since_words(row)}; {basis}"
    if row.get("trains_visit") is None:
        return f"{words}; no train since then is recorded"
    return words + _train_words(row)


def _effect_words(term: str, change: float | None) -> str:
    """Name of an effect in words: what one support has less of is softer.

    Examples
    --------
    >>> _effect_words("local_ballast", -0.2), _effect_words("local_pad", 0.1), _effect_words("hanging_sleeper", -3.0)
    ('softer ballast', 'stiffer pad', 'hanging sleeper')
    """
    part = term.removeprefix("local_")
    if part == term or change is None:
        return term.replace("_", " ")
    return f"{'softer' if change < 0 else 'stiffer'} {part}"


def _position_words(row: Mapping[str, Any]) -> str:
    """Where the change is; of one of adjacent supports how far it reaches, where that is not certain."""
    if row.get("first_m") is None:
        return "" if row["position_m"] is None else f" at {row['position_m']:.1f} m"
    first, last = (f"{row[end]:.1f}" for end in ("first_m", "last_m"))
    words = f" at {first} m" if first == last else f" from {first} to {last} m"
    uncertain = _uncertain_ends(row)
    return f"{words} ({', '.join(uncertain)}, 95 %)" if uncertain else words


def _uncertain_ends(row: Mapping[str, Any]) -> list[str]:
    """In words, the ends of a change of adjacent supports that are not certain."""
    ends = (
        _end_words("first support", row.get("first_low_m"), row.get("first_high_m"), "before"),
        _end_words("last support", row.get("last_high_m"), row.get("last_low_m"), "beyond"),
    )
    return [end for end in ends if end]


def _end_words(end: str, outer: float | None, inner: float | None, farther: str) -> str:
    """Interval of one end, "" if it is certain or not known."""
    if inner is None or outer == inner:
        return ""
    if outer is None:
        return f"{end} at {inner:.1f} m or {farther}"
    return f"{end} at {min(outer, inner):.1f} to {max(outer, inner):.1f} m"


def _since_words(row: Mapping[str, Any]) -> str:
    if row.get("onset_by_utc") is None:
        return ""
    return f"since {row['onset_after_utc']:%Y-%m-%d} to {row['onset_by_utc']:%Y-%m-%d} (95 %)"


def _change_words(row: Mapping[str, Any]) -> str:
    """Size of the change under impacts, with its 95 % interval; of growth also what it has reached."""
    what = "change" if row["component"] is None else f"stiffness of the {row['component']} under impacts"
    words = f"{what} {_size_words(row, 'change')}"
    if not row["grows"]:
        return words
    so_far = "" if row.get("change_so_far") is None else f", {_size_words(row, 'change_so_far')} so far"
    return f"{words} a year{so_far}"


def _beside_words(row: Mapping[str, Any]) -> str:
    """What the size of a change of single supports takes for granted, where its ends are certain."""
    if row["component"] is None or row.get("first_m") is None or _uncertain_ends(row):
        return ""
    part = "pads" if row["component"] == "railpad" else "sleepers"
    return f", with the {part} beside {'it' if row['first_m'] == row['last_m'] else 'them'} unchanged"


def _size_words(row: Mapping[str, Any], name: str) -> str:
    """A size with its 95 % interval: of a stiffness in per cent, else in its unit."""
    value, half = row[name], Z95 * row[f"{name}_se"]
    low, high = value - half, value + half
    if row["component"] is None:
        return f"{value:+.3g} ({low:+.3g} to {high:+.3g}, 95 %) {row['change_unit']}"
    value, low, high = (100.0 * float(np.expm1(end)) for end in (value, low, high))
    return f"{value:+z.0f} % ({low:+z.0f} to {high:+z.0f}, 95 %)"


def _parameter_words(row: Mapping[str, Any]) -> str:
    """Size of the effect under trains with its 95 % interval, "" if they do not name it; a share by its meaning."""
    from turnout.stages.parameter_text import parameter_estimate, parameter_in_words

    words = ""
    for p in json.loads(row.get("parameters_json") or "[]"):
        value, limits = parameter_estimate(p["term"], p["name"], p["value"], p["se"], p["unit"])
        name = parameter_in_words(p["term"], p["name"]).rpartition(": ")[2] if p["unit"] == "-" else p["name"]
        words += f", {name} {value}" + (f" ({limits}, 95 %)" if limits else "")
    return words


def _train_words(row: Mapping[str, Any]) -> str:
    """What the trains decide, and the fit on those held out."""
    n = row["n_held_out"] or 0
    fit = ""
    if n and row["fit_before_pct"] is not None and row["fit_after_pct"] is not None:
        se = (
            ""
            if row["fit_gain_se_pct"] is None
            else f" (standard error of the difference {row['fit_gain_se_pct']:.1f})"
        )
        before, after = row["fit_before_pct"], row["fit_after_pct"]
        fit = f"; {n} held-out trains fit by {before:.1f} % without it, {after:.1f} % with it{se}"
    if row["trains_verdict"] == "named":
        return f"; trains of {row['trains_visit']} name {_effect_words(row['trains_term'], row['change'])}{fit}"
    if row["trains_verdict"] == "a_or_b":
        return f"; trains of {row['trains_visit']} agree with more than one effect{fit}"
    return f"; trains of {row['trains_visit']} alone do not decide{fit}"
