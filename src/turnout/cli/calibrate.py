"""Fit pads, ballast and damping of a section to its hammer tests, and state which values the data do not determine.

  turnout calibrate --turnout tommerup_s1 --section A7 raw/tommerup_s1/hammer/2024-01-23/A7_*.uff
  turnout calibrate --track tommerup --section A7 --modes ballast=99.6/0.292 railpad=616.4/0.066

The first form fits the measured receptance line by line. The second finds parameters whose simulated test has these
resonances [Hz] and damping ratios. No file is changed: the values are printed in the form of the track file. Without
--track the track file is that of the turnout.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_configuration, add_result, add_track, add_turnout, add_warnings

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

GROUP = "Simulate and diagnose"
HELP = "fit a section of a track file to hammer tests"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("files", nargs="*", help="hammer tests of the section")
    add_track(parser)
    parser.add_argument("--section", required=True, help="section of the track file")
    add_turnout(parser, "id in config/turnouts.tsv, for the track and the channels of the files", required=False)
    add_configuration(parser)
    parser.add_argument("--modes", nargs="+", metavar="BAND=HZ/ZETA", help="resonances to meet instead of files")


def run(args: argparse.Namespace) -> int:
    """Fit and print; exit code 1 if the fit does not meet the tests or resonances.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    SimulationError
        Both hammer tests and modes are given, or none, or a mode is not plausible.
    """
    from turnout.errors import SimulationError
    from turnout.stages.calibrate import calibrate_to_files, calibrate_to_modes, resolve_track
    from turnout.stages.parameter_ranges import improbable_in_files
    from turnout.stages.track_files import files_of_track

    if bool(args.files) == bool(args.modes):
        raise SimulationError("give either hammer tests or --modes.")
    targets = _target_modes(args.modes or ())
    track = resolve_track(args.track, args.turnout, args.configuration)
    add_warnings(args, improbable_in_files(files_of_track(track)))
    print(f"track: {track}" + ("" if args.track or args.turnout else " (no turnout and no track was named)"))
    if args.modes:
        fit = calibrate_to_modes(track, args.section, targets)
        for band, (frequency, damping) in fit.targets.items():
            fitted = fit.fitted.get(band)
            reached = f"{fitted[0]:.1f} Hz, {fitted[1]:.4f}" if fitted else "not found"
            print(f"{band}: wanted {frequency:.1f} Hz, {damping:.4f}; reached {reached}")
        missing = sorted(fit.targets.keys() - fit.fitted.keys())
        missed = f"has no resonance in the band {', '.join(missing)}" if missing else ""
        print(_track_entry(args.section, fit.values, {}, missed))
        return 1 if missed else 0
    calibration = calibrate_to_files(track, args.section, args.files, args.turnout, args.configuration)
    print(calibration)
    missed = (
        ""
        if calibration.is_adequate
        else f"does not meet these tests (chi-squared per degree of freedom {calibration.reduced:.0f})"
    )
    add_result(args, calibration.rows)
    values = {name: value for name, value in calibration.values.items() if missed or calibration.is_determined(name)}
    print(_track_entry(args.section, values, calibration.sd, missed))
    return 1 if missed else 0


def _track_entry(section: str, values: Mapping[str, float], sd: Mapping[str, float], missed: str) -> str:
    """The values as lines of the track file, or as comments if the fit ``missed`` the tests."""
    from turnout.simulate.calibration import PRINTED_UNITS
    from turnout.units import PARAMETER_UNITS

    if missed:
        head = f"# do not paste: section {section} with these values {missed}"
    elif values:
        head = f"# section {section}: paste into its entry in the track file"
    else:
        head = f"# section {section}: nothing to paste, the tests determine none of its values"
    mark, source = ("# ", "guess: fit that misses its test") if missed else ("", "estimate: fitted")
    lines = ["", f"  {head}"]
    for name, value in values.items():
        unit = PRINTED_UNITS[name]
        _, factor = PARAMETER_UNITS[unit]
        prior = f", prior: {sd[name]:.2g}" if name in sd and not missed else ""
        lines.append(f'    {mark}{name}: {{value: {value / factor:.4g}, unit: {unit}, source: "{source}"{prior}}}')
    return "\n".join(lines)


MAX_FREQUENCY = 5000.0  # Hz, above every resonance of a track that an impact excites


def _target_modes(modes: Iterable[str]) -> dict[str, tuple[float, float]]:
    from turnout.errors import SimulationError
    from turnout.modal.bands import MAIN_BANDS

    targets = {}
    for mode in modes:
        try:
            band, figures = mode.split("=")
            frequency, damping = (float(v) for v in figures.split("/"))
        except ValueError:
            raise SimulationError(f"--modes {mode!r} is not of the form ballast=99.6/0.292.") from None
        if not (0.0 < frequency <= MAX_FREQUENCY and 0.0 < damping < 1.0):
            problem = (
                f"--modes {mode!r}: no resonance has a frequency of {frequency:g} Hz and a damping ratio of {damping:g}"
            )
            remedy = f"Write a frequency above 0 Hz, up to {MAX_FREQUENCY:g} Hz, and a damping ratio between 0 and 1"
            raise SimulationError(f"{problem}. {remedy}.")
        if band not in MAIN_BANDS:
            raise SimulationError(f"--modes {mode!r}: no resonance {band!r}. Write {' or '.join(MAIN_BANDS)}.")
        if band in targets:
            raise SimulationError(f"--modes {mode!r}: {band} for the second time. Give each resonance once.")
        targets[band] = (frequency, damping)
    if {"ballast", "railpad"} <= targets.keys() and targets["ballast"][0] >= targets["railpad"][0]:
        raise SimulationError("--modes: the ballast resonance lies below the railpad resonance. Exchange the two.")
    return targets
