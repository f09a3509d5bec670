"""Convert finding rows into answers of one form, whichever program wrote the rows."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from typing import Any


@dataclass(frozen=True)
class Answer:
    """One row of findings: one of ``names`` for "named", two for "a_or_b"; ``parameters`` {name: (value, se)}."""

    verdict: str
    names: tuple = ()
    lock: str | None = None
    position: float | None = None
    sensor: str | None = None
    train: str | None = None
    axle: int | None = None
    probability: float | None = None
    before: float | None = None
    after: float | None = None
    gain_error: float | None = None
    parameters: dict = field(default_factory=dict)

    @property
    def says_none(self) -> bool:
        """Whether the answer is that nothing is wrong."""
        return self.verdict == "none"


def answers_of(rows: Iterable[Mapping[str, Any]] | None) -> list[Answer] | None:
    """Answers of a case, in the order of the rows; None where the tool gave no rows.

    Parameters
    ----------
    rows : iterable of mapping or None
        Finding rows of the case.

    Returns
    -------
    list of Answer or None
        Answers; a row with several terms gives several.

    Examples
    --------
    >>> rows = [{"verdict": "named", "term": "wheel_flat", "sentence": "a flat on railcar, axle 3",
    ...          "parameters_json": '[{"name": "length", "value": 0.05, "se": 0.01}]'}]
    >>> answer = answers_of(rows)[0]
    >>> answer.names, answer.axle, answer.parameters
    (('wheel_flat',), 3, {'length': (0.05, 0.01)})
    """
    return None if rows is None else [answer for row in rows for answer in _answers_of_row(row)]


def _answers_of_row(row: Mapping[str, Any]) -> Iterator[Answer]:
    """The answer of a row, and one for each further term in it.

    Further terms are read from ``term_json``. Without that column they are the terms named by the parameters.
    """
    json_terms = json.loads(row.get("term_json") or "[]")
    first = _first_answer(row)
    yield replace(first, parameters=_values(json_terms[0])) if json_terms and row["verdict"] == "named" else first
    if json_terms:
        yield from (_further_answer(term) for term in json_terms[1:])
    elif row["verdict"] == "named":
        terms = [entry.get("term") for entry in _entries(row.get("parameters_json"))[1]]
        for term in dict.fromkeys(t for t in terms if t and t != row.get("term")):
            yield Answer("named", (term,), parameters=_parameters(row["parameters_json"], term)[1])


def _further_answer(term: Mapping[str, Any]) -> Answer:
    """The answer of a further term: its name or two, its position and its parameters.

    >>> dip = {"term": "surface_dip", "or": "wheel_flat", "fixed": {"place": 21.0},
    ...        "parameters": {"shift": {"value": 0.4}}}
    >>> answer = _further_answer(dip)
    >>> answer.verdict, answer.names, answer.position
    ('a_or_b', ('surface_dip', 'wheel_flat'), 21.4)
    """
    fixed, values = term.get("fixed", {}), _values(term)
    names = tuple(n for n in (term["term"], term.get("or")) if n)
    positions = [fixed[k] for k in ("place", "position", "sleeper", "support") if k in fixed]
    ends = [fixed[k] for k in ("first", "last", "start", "end") if k in fixed]
    shift = values.get("shift", (0.0,))[0] if "place" in fixed else 0.0
    position = float(positions[0]) + shift if positions else sum(ends) / 2.0 if len(ends) == 2 else None
    axle = fixed["wheel"] + 1 if "wheel" in fixed else None
    return Answer(
        "named" if len(names) == 1 else "a_or_b", names, None, position, fixed.get("channel_name"), fixed.get("train"),
        axle, parameters=values,
    )  # fmt: skip


def _values(term: Mapping[str, Any]) -> dict[str, Any]:
    return {name: (p.get("value"), p.get("se")) for name, p in term.get("parameters", {}).items()}


def _first_answer(row: Mapping[str, Any]) -> Answer:
    where, parameters = _parameters(row.get("parameters_json"), row.get("term"))
    sentence = row.get("sentence") or ""
    train, axle = _train_and_axle(row.get("train"))
    axle, train = where.get("axle", axle), where.get("train", train)
    if axle is None and (match := re.search(r"(?:axle|wheel)\s+(\d+)(?: of (?!every)(\w+))?", sentence)):
        axle, train = int(match.group(1)), train or match.group(2)
    names = tuple(n for n in (row.get("term"), row.get("rival_term") if row["verdict"] == "a_or_b" else None) if n)
    return Answer(
        row["verdict"], names if row["verdict"] in ("named", "a_or_b") else (), row.get("locked_to"),
        row.get("position_m"), row.get("channel") or where.get("sensor"), train,
        None if axle is None else int(axle), row.get("probability"), row.get("fit_before_pct"),
        row.get("fit_after_pct"), row.get("fit_gain_se_pct"), parameters,
    )  # fmt: skip


def _train_and_axle(text: str | None) -> tuple[str | None, int | None]:
    """(train, axle) of "loaded, axle 3"; either is None if it is missing."""
    train, _, axle = (text or "").partition(", axle ")
    return train or None, int(axle) if axle.isdecimal() else None


def _parameters(text: Any, term: str | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
    """(where, {name: (value, se)}) of the column, for one term if the entries name their term."""
    where, entries = _entries(text)
    term_entries = [r for r in entries if r.get("term") in (None, term)]
    return where, {r["name"]: (r.get("value"), r.get("se", r.get("standard_error"))) for r in term_entries}


def _entries(text: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """(where, entries) of the column: a list of objects, or an object of objects or numbers."""
    content = json.loads(text) if isinstance(text, str) and text else text or {}
    where = content.pop("where", {}) if isinstance(content, dict) else {}
    return where, content if isinstance(content, list) else [{"name": k, **_as_entry(v)} for k, v in content.items()]


def _as_entry(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {"value": value}
