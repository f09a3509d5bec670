"""Rows of the table twin_states: the calibrated model after a visit, from this visit and the stored ones before it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.mismatch.calibrated import estimate_history, track_sds
from turnout.mismatch.turnout.calibration import dip_directions, file_errors
from turnout.stages.combined_visits import parameters_of, visits_of, without_findings
from turnout.stages.recorded_work import events_of
from turnout.stages.stored_visits import read_visits
from turnout.stages.visit_versions import by_content

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.stages.mismatch_groups import Group


def state_rows(
    folder: Path, turnout: TurnoutConfig, group: Group, finding: Mapping[str, Any], about: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Rows of ``twin_states`` after a visit, of the parameters of one group of sections.

    They depend on the stored visits and the recorded work as they are now, so that a withdrawn one leaves no trace.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    turnout : TurnoutConfig
    group : Group
        Its sections.
    finding : mapping
        Row of ``mismatch_findings``.
    about : mapping
        visit, version (as ``version_of``), changes (as ``changes_of``), effects (as ``effects_of``) and earlier (as
        ``present_versions``, of the visits before).

    Returns
    -------
    list of dict
    """
    visit = about["visit"]
    stored = read_visits(folder, turnout.id, {**about["earlier"], **by_content({visit: about["version"]})})
    parameters = parameters_of(stored)
    visits_used = visits_of(without_findings(stored))
    events = events_of(turnout, parameters, about["changes"], visits_used, about["effects"])
    events += file_errors(parameters, dip_directions(parameters))
    history = estimate_history(parameters, visits_used, events)
    belief, n = history.belief, sum(s.n_recordings for s in history.used_steps)
    sds = track_sds(belief, parameters)
    number = {p.name: k for k, p in enumerate(parameters)}
    key = {k: finding[k] for k in ("finding_id", "turnout_id", "found_at_utc")}
    neighbours = ", ".join(group.neighbours)
    own = [p for s in stored if (s.visit, s.neighbours) == (visit, neighbours) for p in s.parameters]
    return [
        {
            **key, "parameter_no": k, "visit": visit, "parameter": p.name, "position_m": p.position,
            "value": float(belief.mean[number[p.name]]), "sd": float(sds[number[p.name]]),
            "prior_sd": p.sd, "unit": p.unit, "n_visits": len(history.used_steps), "n_recordings": n,
            "code_version": about["version"]["code"],
        }
        for k, p in enumerate(own)
    ]  # fmt: skip
