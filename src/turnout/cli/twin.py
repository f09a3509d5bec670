"""The calibrated model of a turnout: its parameters from all visits, what differs from the file, and what has changed.

  turnout twin --turnout tommerup_s1

Each visit is fitted once and kept below the work folder; a visit of another code version, track file or set of
recordings is fitted again. Visits with an open finding of ``turnout diagnose`` are not used.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_configuration, add_raw, add_track, add_turnout, add_work

if TYPE_CHECKING:
    from collections.abc import Iterator

    from turnout.mismatch.calibrated import Deviation, StateParameter
    from turnout.stages.calibrated_model import CalibratedModel

GROUP = "Simulate and diagnose"
HELP = "show the calibrated model of a turnout, from all of its visits"
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
    add_work(parser, "where the information of each visit is kept (%(default)s)")
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
    from turnout.stages.calibrated_model import calibrate_turnout

    model = calibrate_turnout(args.turnout, args.configuration, args.raw, args.work, args.track)
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
    n = sum(s.n_recordings for s in steps)
    yield f"{turnout_id}: {n} recordings of {len(steps)} visits ({len(model.computed)} fitted now)"
    for step in model.history.steps:
        if not step.is_used:
            i = step.innovation
            yield (
                f"visit {step.visit} is not used: it differs from all before, "
                f"most at {i.parameter} ({i.deviates:+.1f} standard deviations)"
            )
    for visit, answer in model.held.items():
        yield f"visit {visit} is not used: its diagnosis is {answer.replace('_', ' ')}, and not accepted"
    yield from (f"note: {note}" for note in model.notes)
    yield from _table(model, show_all)
    yield "against the file: " + ("; ".join(_deviations(model)) or "nothing differs")
    yield "changes: " + _change(model)


def _table(model: CalibratedModel, show_all: bool) -> Iterator[str]:
    belief, parameters = model.history.belief, model.history.parameters
    rows = list(zip(parameters, belief.mean, belief.sd))
    waves = [row for row in rows if row[0].group == "wave" and not show_all]
    others = [row for row in rows if row[0].group != "wave" or show_all]
    listed = [row for row in others if show_all or row[2] < MAX_SD_RATIO * row[0].sd]
    yield f"{'parameter':32} {'position':>9} {'value':>11} {'sd':>10} {'prior sd':>10} unit"
    for p, value, sd in sorted(listed, key=lambda r: (r[0].group, r[0].position or 0.0, r[0].name)):
        position = "" if p.position is None else f"{p.position:.2f} m"
        yield f"{p.name:32} {position:>9} {value:11.4g} {sd:10.3g} {p.sd:10.3g} {_unit(p)}"
    if waves:
        narrowed = sum(sd < MAX_SD_RATIO * p.sd for p, _, sd in waves)
        yield f"running surface: {narrowed} of {len(waves)} waves are better known than by the file (--all lists them)"
    if len(listed) < len(others):
        yield f"{len(others) - len(listed)} more parameters are hardly better known than by the file (--all lists them)"


def _unit(parameter: StateParameter | Deviation) -> str:
    """Unit of a parameter: "ln" for the logarithm of a factor on the value of the file."""
    return "ln" if parameter.unit == "-" and parameter.group != "gain" else parameter.unit


def _deviations(model: CalibratedModel) -> Iterator[str]:
    for d in model.deviations:
        extent = d.names[0] if len(d.names) == 1 else f"{d.names[0]} to {d.names[-1]}"
        yield f"{extent}: {d.size:+.3g} ± {d.sd:.2g} {_unit(d)}".removesuffix(" -")


def _change(model: CalibratedModel) -> str:
    """The change with the most evidence, or why there is none."""
    from turnout.config.settings.mismatch import MismatchSettings

    settings = MismatchSettings()  # the evidence and the margin of a name
    if not model.changes:
        return "cannot tell from fewer than two visits"
    best, *others = model.changes
    if best.gain < settings.threshold:
        return f"none (the largest evidence is {best.gain:.1f} nats, {best.effect.name})"
    rival = others[0] if others and others[0].gain > best.gain - settings.margin else None
    name = best.effect.name if rival is None else f"{best.effect.name} or {rival.effect.name}"
    size, sd = best.size
    start, end = (_day(t) for t in best.interval())
    return f"{name}: {size:+.3g} ± {sd:.2g}, appeared after {start}, at the latest at {end} ({best.gain:.0f} nats)"


def _day(time: float) -> str:
    from datetime import date

    from turnout.stages.calibrated_model import DAYS_PER_YEAR

    return date.fromordinal(round(time * DAYS_PER_YEAR)).isoformat()
