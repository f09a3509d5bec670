"""Stage mismatch: compare the hammer tests and passages of one visit with the simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config.merge import digest
from turnout.config.turnout import TurnoutConfig
from turnout.content import sha256_of
from turnout.errors import CaseError, ReadError, SimulationError, TurnoutError
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.turnout import TrackCase
from turnout.records import Unit
from turnout.stages import stored_visits
from turnout.stages.accepted_changes import changes_of
from turnout.stages.budget import Budget, BudgetSpentError, Watch
from turnout.stages.changed_effects import changed_effects
from turnout.stages.changed_visits import fit_changed_visits
from turnout.stages.checkpoint import Checkpoint, Replay
from turnout.stages.combined_visits import is_stored
from turnout.stages.mismatch_groups import Group, groups, members_of, visits
from turnout.stages.mismatch_inputs import Note, gather_inputs
from turnout.stages.mismatch_rows import finding_tables
from turnout.stages.raw_files import quarantine_row
from turnout.stages.renewals import since_renewal
from turnout.stages.state_rows import state_rows
from turnout.stages.track_files import digest_of_model, improbable_entries, track_of
from turnout.stages.visit_notes import notes_in_words
from turnout.stages.visit_time import years_of
from turnout.stages.visit_versions import version_of
from turnout.stages.work_days import work_days_of
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from turnout.stages.accepted_effects import AcceptedEffect

FITS_FOLDER = "work/mismatch-fits"
TABLES = ("mismatch_findings", "mismatch_parameters", "mismatch_curves", "twin_states", "quarantine")
REMEDY = (
    "A diagnosis needs a track file, and hammer tests or passages of the visit: correct what is named, or measure it"
)
BUDGET_REMEDY = "Run the same command again, with a larger --limit-minutes if need be"
BUDGET_SPENT = "the budget was used up with {} of {} groups done; the same command continues"
SEVERITY_ORDER = ("named", "a_or_b", "unknown", "numerics", "none")


@dataclass
class Options:
    """Options of a diagnosis: ``track`` file or None, ``sections`` or () for all, folder of ``fits`` and ``watch``.

    ``progress`` is a callable (group, number, count) -> callable(done, total, what).
    """

    track: str | None = None
    sections: Sequence[str] = ()
    fits: str = FITS_FOLDER
    watch: Watch = field(default_factory=Watch)
    progress: Callable | None = None


def mismatch_unit(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    context: Mapping[str, dict[str, Any]] | None = None,
    algo: str = "",
) -> dict[str, list[dict]]:
    """Rows by table (findings, parameters, curves, quarantine) for one visit, for the workflow.

    There is one finding per group of neighbouring sections. Sections that cannot be diagnosed are quarantine rows with
    the reason.

    Parameters
    ----------
    unit : Unit
        The files of a visit.
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : path
        Folder of all recordings.
    context : mapping or None
        Tables of the passage stage by unit.
    algo : str
        Fingerprint of the code.

    Returns
    -------
    dict
        Table -> rows.
    """
    try:
        return diagnose_visit(unit, turnout, raw_root, context or {}, algo)
    except ReadError:
        raise
    except TurnoutError as error:  # no track, or a wrong vehicle or configuration: a fault of this turnout only
        return {**{name: [] for name in TABLES}, "quarantine": [_undiagnosed_row(unit, turnout, str(error)[:1000])]}


def diagnose_visit(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    passage_tables: Mapping[str, dict[str, Any]],
    algo: str = "",
    options: Options | None = None,
) -> dict[str, list[dict]]:
    """Rows by table of one visit.

    Passages without a table of the passage stage are analysed here.

    Parameters
    ----------
    unit : Unit
        The files of a visit.
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : path
        Folder of all recordings.
    passage_tables : mapping
        Tables of the passage stage by unit.
    algo : str
        Fingerprint of the code.
    options : Options or None
        None: the defaults.

    Returns
    -------
    dict
        Table -> rows.

    Raises
    ------
    SimulationError
        The turnout has no track. BudgetSpentError, with the rows of the finished groups, if the time is spent
        before the last one.
    """
    options = options or Options()
    track, accepted = track_of(turnout, options.track)
    scanned = scan(turnout, Path(raw_root)).units
    units = members_of(unit, scanned)
    inputs = gather_inputs(units, turnout, raw_root, track, passage_tables)
    inputs.notes += [Note(entry) for entry in improbable_entries(turnout, options.track)]
    contents = [[path, _content_hash(Path(raw_root) / path)] for path, *_ in unit.files]
    identity = digest(
        [unit.config_hash, contents, inputs.digest_content(), digest_of_model(turnout, options.track), algo]
    )
    about = {"turnout": turnout, "visit": unit.label, "identity": identity, "notes": inputs.notes}
    about |= {"changes": changes_of(track.terms), "effects": accepted}
    about["version"] = version_of(units, turnout, raw_root, options.track, algo)
    rows: dict[str, list[dict]] = {name: [] for name in TABLES}
    members = list(groups(turnout, track, inputs, options.sections))
    # Sections that were chosen, or several visits in one case, are no visit of the calibrated model
    every = groups(turnout, track, replace(inputs, notes=[])) if options.sections else members
    is_visit = set(visits(units, work_days_of(turnout))) <= {unit.label}
    about["every_group"] = [", ".join(g.neighbours) for g in every] if is_visit else []
    about["earlier"] = _earlier_versions(unit, scanned, turnout, raw_root, options, algo) if is_visit else {}
    diagnosed: list[tuple[Group, dict[str, list[dict]]]] = []
    for k, group in enumerate(members):
        try:
            diagnosed.append((group, _diagnose_group(group, turnout, accepted, about, options, (k, len(members)))))
        except BudgetSpentError:
            reason = BUDGET_SPENT.format(k, len(members))
            unfinished = [_undiagnosed_row(unit, turnout, reason, g, BUDGET_REMEDY) for g in members[k:]]
            _add_rows(rows, diagnosed, about, options)
            raise BudgetSpentError(
                k, len(members), _sort_by_severity(rows | {"quarantine": rows["quarantine"] + unfinished})
            ) from None
    _add_rows(rows, diagnosed, about, options)
    if not members:
        reasons = "; ".join(map(str, inputs.notes)) or "neither a hammer test nor a passage"
        rows["quarantine"].append(_undiagnosed_row(unit, turnout, f"no section can be diagnosed: {reasons}"[:1000]))
    return _sort_by_severity(rows)


def _sort_by_severity(rows: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    rows["mismatch_findings"].sort(key=lambda r: (SEVERITY_ORDER.index(r["verdict"]), -(r["probability"] or 0.0)))
    return rows


def _content_hash(path: Path) -> str:
    try:
        return sha256_of(path)
    except OSError:  # deleted since it was planned: the notes say so
        return ""


def _diagnose_group(
    group: Group,
    turnout: TurnoutConfig,
    accepted: Iterable[AcceptedEffect],
    about: Mapping[str, Any],
    options: Options,
    number: tuple[int, int],
) -> dict[str, list[dict]]:
    """Rows of one group, read from the store if an earlier run computed them."""
    name = f"{turnout.id}-{about['visit']}-{'+'.join(group.labels)}"
    store = Checkpoint(Path(options.fits), name, (about["identity"],))
    folder = stored_visits.folder_of(options.fits)
    is_in_model = _is_in_model(group, about)
    if "rows" in store and (not is_in_model or is_stored(folder, group, about)):
        return store["rows"]
    replay = Replay(Path(options.fits), f"{name}-predictions", (about["identity"],))
    report_progress = options.progress(group, *number) if options.progress else None
    try:
        accepted = tuple(a for a in accepted if a.is_on(group.route))
        changed = _changed_effects(group, about)
        budget = Budget(options.watch, None if options.watch.deadline is None else replay)
        settings = turnout.settings["mismatch"]
        case = TrackCase(group.campaign, settings, accepted=(*accepted, *changed), cache=budget)
        diagnosis = diagnose(case, settings, report_progress, store)
        rows = finding_tables(diagnosis, case, group, about)
        answer = diagnosis.verdict.answer
        fits: Checkpoint | None = store
        if changed:  # the calibrated model has accepted changes as noise of its process, not as effects of a visit
            case, fits = TrackCase(group.campaign, settings, accepted=accepted, cache=budget), None
        stored_about = {**about, "notes": notes_in_words(about["visit"], about["notes"])}
        if is_in_model and answer in stored_visits.USED_ANSWERS:
            stored_visits.store_visit(folder, group, case, answer, stored_about, fits)
        elif is_in_model:  # such a visit does not change the belief
            stored_visits.store_answer(folder, group, case, answer, stored_about)
    except (CaseError, SimulationError, np.linalg.LinAlgError) as error:
        reasons = [f"sections {', '.join(group.labels)}: {error}", *map(str, about["notes"])]
        return {"quarantine": [_undiagnosed_row(None, turnout, "; ".join(reasons)[:1000], group)]}
    replay.discard()
    store.discard()
    store["rows"] = rows
    return rows


def _add_rows(
    rows: dict[str, list[dict]],
    diagnosed: Sequence[tuple[Group, dict[str, list[dict]]]],
    about: Mapping[str, Any],
    options: Options,
) -> None:
    """Add the rows of all groups, and those of the calibrated model: its state rests on all groups of the visit."""
    folder = stored_visits.folder_of(options.fits)
    for group, tables in diagnosed:
        for table, group_rows in tables.items():
            rows[table] += group_rows
        findings = tables.get("mismatch_findings", [])
        if not findings or not _is_in_model(group, about):
            continue
        try:
            rows["twin_states"] += state_rows(folder, about["turnout"], group, findings[0], about)
        except np.linalg.LinAlgError as error:
            reason = f"state of the calibrated model, sections {', '.join(group.labels)}: {error}"
            rows["quarantine"].append(_undiagnosed_row(None, about["turnout"], reason, group))


def _is_in_model(group: Group, about: Mapping[str, Any]) -> bool:
    """Whether the calibrated model has the group: not chosen sections, nor several visits in one case."""
    return ", ".join(group.neighbours) in about["every_group"]


def _earlier_versions(
    unit: Unit,
    scanned: Sequence[Unit],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    options: Options,
    code: str,
) -> dict[str, dict[str, str]]:
    """Versions of the stored visits before that of the unit, which are fitted again where they have changed."""
    before = {
        visit: units
        for visit, units in since_renewal(turnout, visits(scanned, work_days_of(turnout))).items()
        if visit != unit.label and years_of(visit) <= years_of(unit.label)
    }
    folder = stored_visits.folder_of(options.fits)
    return fit_changed_visits(turnout, folder, before, raw_root, options.track, code)


def _changed_effects(group: Group, about: Mapping[str, Any]) -> tuple[AcceptedEffect, ...]:
    """Effects of the changes that were accepted for the turnout before this visit."""
    if not about["changes"]:
        return ()
    supports = group.campaign.turnout.track_of(group.route).support
    sensors = {s.name: float(s.place) for s in group.campaign.sensors}
    return changed_effects(about["changes"], years_of(about["visit"]), supports, sensors)


def _undiagnosed_row(
    unit: Unit | None, turnout: TurnoutConfig, reason: str, group: Group | None = None, remedy: str = REMEDY
) -> dict[str, Any]:
    """Quarantine row with the reason why sections cannot be diagnosed, and what to do."""
    sections = f"sections {', '.join(group.labels)}" if group else "all sections"
    error = ReadError(turnout.raw, sections, reason, remedy, "simulation_failed")
    return quarantine_row(error, {"turnout_id": turnout.id}, "mismatch", "mismatch")
