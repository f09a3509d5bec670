"""Stored visits of a turnout together: which are complete, their parameters, and the information that counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.mismatch.calibrated import StateParameter, VisitInformation
from turnout.stages.stored_visits import USED_ANSWERS, read_visits
from turnout.stages.visit_time import years_of
from turnout.stages.visit_versions import by_content

if TYPE_CHECKING:
    from turnout.stages.mismatch_groups import Group
    from turnout.stages.stored_visits import StoredVisit


def is_stored(folder: Path, group: Group, about: Mapping[str, Any]) -> bool:
    """Whether a group of sections is stored at a visit, of these versions.

    Parameters
    ----------
    folder, group, about
        As ``store_visit``.

    Returns
    -------
    bool
    """
    turnout, visit = about["turnout"], about["visit"]
    stored = read_visits(folder, turnout.id, by_content({visit: about["version"]}))
    return any(s.neighbours == ", ".join(group.neighbours) for s in stored)


def complete_visits(stored: Iterable[StoredVisit]) -> set[str]:
    """Visits of which each group of sections is fitted: a diagnosis may have ended before its last group.

    Parameters
    ----------
    stored : iterable of StoredVisit

    Returns
    -------
    set of str
    """
    missing: dict[str, set[str]] = {}
    fitted: dict[str, set[str]] = {}
    for s in stored:
        missing.setdefault(s.visit, set()).update(s.every_group)
        fitted.setdefault(s.visit, set()).update([s.neighbours] if s.fitted else [])
    return {visit for visit, groups in missing.items() if groups <= fitted[visit]}


def visits_of(stored: Iterable[StoredVisit]) -> list[VisitInformation]:
    """One ``VisitInformation`` per visit, of all of its groups of sections.

    Parameters
    ----------
    stored : iterable of StoredVisit
        Groups of sections of all visits.

    Returns
    -------
    list of VisitInformation
        In the order in which the visits first appear, those of which no group could be fitted left out.
    """
    members: dict[str, list[StoredVisit]] = {}
    for s in stored:
        if not s.groups:
            continue
        members.setdefault(s.visit, []).append(s)
    visits_used = []
    for visit, parts in members.items():
        information = tuple(g for s in parts for g in s.groups)
        own_sds = {p.name: p.visit_sd for s in parts for p in s.parameters}
        visits_used.append(VisitInformation(visit, years_of(visit), information, own_sds))
    return visits_used


def with_information(stored: Iterable[StoredVisit], visits_used: Iterable[VisitInformation]) -> list[StoredVisit]:
    """Stored visits with the information of ``visits_used`` in place of their own.

    Parameters
    ----------
    stored : iterable of StoredVisit
    visits_used : iterable of VisitInformation
        Of all of these visits.

    Returns
    -------
    list of StoredVisit
    """
    by_group = {(v.visit, g.group): g for v in visits_used for g in v.groups}
    return [replace(s, groups=tuple(by_group.get((s.visit, g.group), g) for g in s.groups)) for s in stored]


def without_findings(stored: Iterable[StoredVisit]) -> list[StoredVisit]:
    """Stored visits without an open finding: only these change the belief.

    Parameters
    ----------
    stored : iterable of StoredVisit

    Returns
    -------
    list of StoredVisit
    """
    return [s for s in stored if s.answer in USED_ANSWERS]


def parameters_of(stored: Iterable[StoredVisit]) -> tuple[StateParameter, ...]:
    """All parameters of these visits, each once.

    A support that is an outer one at a visit with fewer sensors may change if it is none at another visit. What it
    absorbs at the first one is among the ``own_sds`` of that visit.

    Parameters
    ----------
    stored : iterable of StoredVisit

    Returns
    -------
    tuple of StateParameter
    """
    by_name: dict[str, StateParameter] = {}
    for s in stored:
        for p in s.parameters:
            known = by_name.setdefault(p.name, p)
            if (p.may_change, not p.is_beyond_sensors) > (known.may_change, not known.is_beyond_sensors):
                by_name[p.name] = p
    return tuple(by_name.values())
