"""Show the calibrated model of a turnout: its parameters from all visits, differences from the track file, and changes.

  turnout twin --turnout tommerup_s1
  turnout twin --turnout tommerup_s1 --each-visit

The fit of each visit is stored in the work folder. It is computed again if the code, the track file, the recordings or
their rows of campaigns.csv and trains.csv have changed. Visits with an open finding of turnout diagnose are not used.
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from turnout.cli.input_warnings import input_warnings
from turnout.cli.options import (
    add_configuration,
    add_raw,
    add_result,
    add_track,
    add_turnout,
    add_warnings,
    add_work,
    check_work_folder,
)
from turnout.counts import count_of
from turnout.number_text import evidence_in_words

if TYPE_CHECKING:
    from collections.abc import Iterator

    from turnout.mismatch.calibrated import Deviation, ModelAnswer, OnsetEvidence, StateParameter
    from turnout.stages.calibrated_model import CalibratedModel

GROUP = "Simulate and diagnose"
HELP = "show the calibrated model of a turnout, from all of its visits"
MIN_COMPARED_VISITS = 2  # used visits between which a change may lie
MAX_SD_RATIO = 0.95  # parameters that are hardly better known than before are counted, not listed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_turnout(parser, "id in config/turnouts.tsv")
    add_track(parser, help="file in config/tracks; default: the turnout's own, else its layout's")
    add_configuration(parser)
    add_raw(parser)
    add_work(parser, "folder of the fits of each visit (%(default)s)")
    parser.add_argument("--each-visit", action="store_true", help="show the result after each visit, too")
    parser.add_argument("--all", action="store_true", help="list parameters that recordings hardly determine, too")


def run(args: argparse.Namespace) -> int:
    """Compute and print the calibrated model.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.config import load_configuration
    from turnout.stages.calibrated_model import answer_rows, calibrate_turnout
    from turnout.stages.track_files import improbable_entries

    check_work_folder(args)
    configuration = load_configuration(args.configuration)
    turnout = configuration.turnout(args.turnout)
    add_warnings(args, input_warnings(configuration, turnout.id, args.raw))
    add_warnings(args, improbable_entries(turnout, args.track))
    model = calibrate_turnout(args.turnout, args.configuration, args.raw, args.work, args.track, args.each_visit)
    add_result(args, answer_rows(model))
    print("\n".join(model_text(args.turnout, model, args.all)))
    return 0


def model_text(turnout_id: str, model: CalibratedModel, show_all: bool = False) -> Iterator[str]:
    """The calibrated model in words and a table.

    Parameters
    ----------
    turnout_id : str
        Id of the turnout.
    model : CalibratedModel
        Its model.
    show_all : bool
        Whether parameters that the recordings hardly determine are listed.

    Yields
    ------
    str
        One line.
    """
    steps = model.history.used_steps
    used = f"{count_of(model.n_hammer_tests, 'hammer test')} and {count_of(model.n_passages, 'passage')}"
    fitted = f"{count_of(len(model.computed), 'visit')} fitted now"
    yield f"{turnout_id}: {used} of {count_of(len(steps), 'visit')} used; {fitted}"
    for step in model.history.steps:
        if not step.is_used:
            i = step.innovation
            yield (
                f"visit {step.visit} is not used: it differs from the track file and the used visits before, "
                f"most at {i.parameter} ({i.deviates:+z.1f} standard deviations); "
                f"turnout diagnose --turnout {turnout_id} --visit {step.visit} examines it alone, faults of loggers too"
            )
    for visit, answer in model.held.items():
        yield f"visit {visit} is not used: its diagnosis is {answer.replace('_', ' ')}, and not accepted"
    yield from (f"note: {note}" for note in model.notes)
    yield from _table(model, show_all)
    answers = list(_answers(model))
    yield from answers
    if any("±" in line for line in answers):
        yield "± is one standard deviation"
    if model.reservation:
        yield model.reservation


def _answers(model: CalibratedModel) -> Iterator[str]:
    """The answers to both questions, one line each."""
    yield "differences from the track file: " + ("; ".join(_differences(model)) or "none")
    changes = [a for a in model.answers if a.question == "change" and model.changes]
    if all(a.verdict == "none" for a in changes) and len(model.history.used_steps) < MIN_COMPARED_VISITS:
        yield "changes: cannot tell from fewer than two visits that are used"
        return
    for change in changes:
        yield f"changes up to {change.visit}: {_change(change)}"
    yield from _strongest(model)


def _table(model: CalibratedModel, show_all: bool) -> Iterator[str]:
    from turnout.mismatch.calibrated import track_sds

    belief, parameters = model.history.belief, model.history.parameters
    rows = list(zip(parameters, belief.mean, track_sds(belief, parameters)))
    waves = [row for row in rows if row[0].group == "wave" and not show_all]
    others = [row for row in rows if row[0].group != "wave" or show_all]
    listed = [row for row in others if show_all or row[2] < MAX_SD_RATIO * row[0].sd]
    yield f"{'parameter':32} {'position':>9} {'value':>11} {'sd':>10} {'prior sd':>10} unit"
    for p, value, sd in sorted(listed, key=lambda r: (r[0].group, r[0].position or 0.0, r[0].name)):
        position = "" if p.position is None else f"{p.position:.2f} m"
        yield f"{p.name:32} {position:>9} {value:11.4g} {sd:10.3g} {p.sd:10.3g} {_unit(p)}"
    if any(_unit(p) == "ln" for p, _, _ in listed):
        yield "ln: logarithm of the value divided by that of the track file; 0 is the file's value, -0.69 half of it"
    if any(p.group == "seat" for p, _, _ in listed):
        yield "seat: true position of a sensor less that of the layout"
    if waves:
        narrowed = sum(sd < MAX_SD_RATIO * p.sd for p, _, sd in waves)
        yield f"running surface: {narrowed} of {len(waves)} waves are determined by the recordings (--all lists them)"
    if len(listed) < len(others):
        yield f"{len(others) - len(listed)} more parameters are hardly determined by the recordings (--all lists them)"


def _unit(parameter: StateParameter | Deviation) -> str:
    """Unit of a parameter: "ln" for the logarithm of a factor on the value of the file."""
    from turnout.mismatch.calibrated.model_answer import stated_unit

    return stated_unit(parameter.unit, parameter.group)


def _differences(model: CalibratedModel) -> Iterator[str]:
    """The answer against the file in words, and all deviations of single values and runs."""
    for answer in [a for a in model.answers if a.question == "file" and a.verdict != "none"][-1:]:
        yield _effect(answer)
    for d in model.deviations:
        extent = d.names[0] if len(d.names) == 1 else f"{d.names[0]} to {d.names[-1]}"
        unit = _unit(d)
        factor = f", {math.exp(d.size):.2g} times the file's value" if unit == "ln" else ""
        yield f"{extent}: {d.size:+.3g} ± {d.sd:.2g} {unit}".removesuffix(" -") + factor


def _change(answer: ModelAnswer) -> str:
    """The change in words: effect, parameter, size and onset."""
    if answer.verdict == "none":
        return "none"
    assert answer.onset is not None
    from turnout.stages.visit_time import day_of

    start, end = (day_of(t) for t in answer.onset)
    evidence = "" if answer.gain is None else f" (evidence: {evidence_in_words(answer.gain)})"
    return f"{_effect(answer)}, appeared after {start}, at the latest at {end}{evidence}"


def _effect(answer: ModelAnswer) -> str:
    """Names, parameter and size of an answer."""
    if answer.verdict == "unknown":
        return f"unknown effect at {answer.parameter}, no single effect of the catalogue explains it"
    from turnout.mismatch.calibrated.model_answer import stated_unit

    assert answer.size is not None and answer.sd is not None
    unit = stated_unit(answer.unit, answer.group)
    names = " or ".join(answer.names).replace("_", " ")
    words = f"{names}, {answer.parameter} {answer.size:+.3g} ± {answer.sd:.2g} {unit}"
    reached = answer.size
    if answer.grows:
        assert answer.total is not None and answer.total_sd is not None
        words = f"{words} a year, {answer.total:+.3g} ± {answer.total_sd:.2g} {unit} so far"
        reached = answer.total
    return f"{words} ({math.exp(reached):.2g} times)" if unit == "ln" else words


def _strongest(model: CalibratedModel) -> Iterator[str]:
    """The change with the largest evidence, where none is stated."""
    if model.changes and all(a.verdict == "none" for a in model.answers if a.question == "change"):
        best, n = model.changes[0], len(model.changes)
        evidence = evidence_in_words(best.gain - math.log(n))  # all are equally probable before the data
        yield (
            f"the most likely of {count_of(n, 'possible change')} is {_change_in_words(best)}; "
            f"its evidence is too little for an answer: {evidence}"
        )


def _change_in_words(change: OnsetEvidence) -> str:
    """A possible change: its parameter, whether the damper changes with it, and whether it grows."""
    parameter, _, share = change.effect.name.partition(", dampers ")
    words = f"{parameter} with its damper" if share and float(share) else parameter
    return f"{words}, growing" if change.effect.grows else words
