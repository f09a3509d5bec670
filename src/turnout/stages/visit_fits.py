"""Fits of the visits of a turnout for its calibrated model, stored and made again where they are asked for."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import CaseError, SimulationError
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.further_passages import names_beyond
from turnout.stages.mismatch_groups import groups, neighbours_of
from turnout.stages.mismatch_inputs import gather_inputs, mismatch_context
from turnout.stages.stored_visits import MAX_FITTED_AXLES, fit_group, store_failure, store_visit
from turnout.stages.track_files import track_of
from turnout.stages.visit_notes import notes_in_words, summary_of_notes

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.records import Unit
    from turnout.stages.agreeing_visits import FittedGroup
    from turnout.stages.mismatch_groups import Group

MAX_FITS_IN_MEMORY = 12  # of the newest visits; others are fitted again where a visit seems to differ
MAX_PASSAGES_AND_AXLES = (60, 1000)  # of a group of sections at one visit


@dataclass
class VisitFits:
    """Fits of the visits of a turnout, made when they are asked for; the last ``MAX_FITS_IN_MEMORY`` are kept.

    ``units`` are the recordings of each visit, ``versions`` as ``version_of`` gives them, ``answers`` those of a
    diagnosis by (visit, neighbours). ``notes`` are reasons why visits could not be fitted.
    """

    turnout: TurnoutConfig
    folder: Path
    units: Mapping[str, Sequence[Unit]]
    versions: Mapping[str, Mapping[str, Any]]
    answers: Mapping[tuple[str, str], str]
    raw_root: str | Path
    work: str | Path
    track: str | None
    without: Collection[str]
    notes: list[str]
    _in_memory: dict[str, list[FittedGroup]] = field(default_factory=dict)

    def fit_all(self, labels: Iterable[str]) -> None:
        """Fit visits and store their information.

        Parameters
        ----------
        labels : iterable of str
        """
        for label in labels:
            self._in_memory[label] = self._fit(label, stores=True)
            if len(self._in_memory) > MAX_FITS_IN_MEMORY:
                del self._in_memory[next(iter(self._in_memory))]

    def of_visit(self, label: str) -> list[FittedGroup]:
        """Fits of the groups of a visit, from memory or made again.

        Parameters
        ----------
        label : str

        Returns
        -------
        list of FittedGroup
        """
        return self._in_memory.get(label) or self._fit(label)

    def from_belief(self, label: str, belief: Belief) -> list[FittedGroup]:
        """Fits of the groups of a visit that begin at the means of a belief, with their Jacobians. None is stored.

        Parameters
        ----------
        label : str
        belief : Belief

        Returns
        -------
        list of FittedGroup
        """
        return self._fit(label, belief)

    def _fit(self, label: str, start: Belief | None = None, stores: bool = False) -> list[FittedGroup]:
        about = {"turnout": self.turnout, "visit": label, "version": self.versions[label], "without": self.without}
        about["answers"] = {of: answer for (visit, of), answer in self.answers.items() if visit == label}
        again = " from the values that other visits predict" if start else ""
        print(f"{self.turnout.id}: fit of visit {label}{again}", file=sys.stderr, flush=True)
        paths = self.folder, self.raw_root, self.work, self.track
        fitted, reasons = _fit_visit(*paths, self.units[label], about, start, stores)
        if start is None:  # else the visit has been fitted already
            self.notes.extend(reason for reason in reasons if reason not in self.notes)
        return fitted


def _fit_visit(
    folder: Path,
    raw_root: str | Path,
    work: str | Path,
    track: str | None,
    units: Sequence[Unit],
    about: Mapping[str, Any],
    start: Belief | None,
    stores: bool,
) -> tuple[list[FittedGroup], list[str]]:
    """Fit the groups of a visit: fits, and reasons why there is none.

    ``about["answers"]`` are those of its diagnosis, by neighbours. A group with an answer is fitted as it was
    diagnosed. Fits begin at the values of the file where ``start`` is None. ``stores``: their information is stored.
    """
    turnout, answers = about["turnout"], about["answers"]
    fitted: list[FittedGroup] = []
    turnout_track, accepted = track_of(turnout, track)
    _, passage_tables = mismatch_context(turnout.id, work=work)
    inputs = gather_inputs(units, turnout, raw_root, turnout_track, passage_tables)
    usable: list[Group] = []
    for _, labels in neighbours_of(turnout):
        limits = None if ", ".join(labels) in answers else MAX_PASSAGES_AND_AXLES
        usable += groups(turnout, turnout_track, inputs, labels, limits)
    notes = notes_in_words(about["visit"], inputs.notes)  # ``groups`` adds some
    about = {**about, "every_group": [", ".join(group.neighbours) for group in usable]}
    for group in usable:
        answer = answers.get(", ".join(group.neighbours))
        campaign = group.campaign
        if answer is None:
            campaign = replace(campaign, reserved=names_beyond(campaign, MAX_FITTED_AXLES))
        try:
            on_route = tuple(a for a in accepted if a.is_on(group.route))
            case = TrackCase(campaign, turnout.settings["mismatch"], accepted=on_route)
            faults = [sentence for fault in case.data.layout_faults for sentence in fault.sentences()]
            of_group = {**about, "notes": [*notes, *((about["visit"], words, False) for words in faults)]}
            if stores:
                fitted.append(store_visit(folder, group, case, answer or "", of_group))
                continue
            fit = fit_group(group, case, turnout.settings["mismatch"], about["without"], start=start)
            fitted.append(fit if start else fit.without_jacobian())
        except (CaseError, SimulationError, np.linalg.LinAlgError) as error:
            if stores:
                store_failure(folder, group, str(error), answer or "", {**about, "notes": notes})
    return fitted, [] if usable else summary_of_notes(notes)
