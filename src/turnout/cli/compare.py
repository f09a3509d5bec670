"""Compare a recorded passage with its simulation, sensor by sensor, in 0-40 and 40-1000 Hz.

  turnout compare raw/tommerup_s2/passages/20260724T091500Z.h5 --turnout tommerup_s2 --sensors A7 A8
  turnout compare FILE --turnout ID --figure comparison.html --csv comparison.csv

Train type, speed, direction and track are those found in the recording. The sections of the sensors are first fitted
to their latest hammer tests before the passage; --no-calibration takes the track file as it is. The figure shows the
time series and the power spectral density in both bands, as Figs. 11 to 13 of the paper.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.input_warnings import input_warnings
from turnout.cli.option_types import finite_number, whole_number
from turnout.cli.options import (
    add_configuration,
    add_figure,
    add_former,
    add_raw,
    add_result,
    add_track,
    add_turnout,
    add_warnings,
    check_output_files,
)

if TYPE_CHECKING:
    from turnout.stages.compare import PassageComparison

GROUP = "Simulate and diagnose"
HELP = "compare a recorded passage with its simulation"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The recording, its turnout, the sensors, and where the results go.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("file", help="passage recording, in any format that is read")
    add_turnout(parser, "id of the turnout")
    parser.add_argument("--sensors", nargs="+", default=(), metavar="NAME", help="sensors; default: all with the train")
    parser.add_argument("--vehicle", help="file in config/vehicles; default: that of the train's type")
    parser.add_argument("--load", type=finite_number, default=0.5, help="share of the payload, 0 to 1.5 (%(default)s)")
    parser.add_argument("--no-calibration", action="store_true", help="take the track file as it is")
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of the rail's roughness (%(default)s)")
    add_figure(parser, "draw time series and spectra into this HTML file")
    add_former(parser, "--out", "--figure")
    parser.add_argument("--csv", metavar="FILE", help="spectra as CSV: sensor, band, frequency, recorded, simulated")
    add_track(parser, help="track file; default: that of the turnout")
    add_configuration(parser)
    add_raw(parser)


def run(args: argparse.Namespace) -> int:
    """Compare, print, and write the figure and the spectra.

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
    ConfigError
        An output cannot be written.
    """
    from turnout.config import load_configuration
    from turnout.files import write_text
    from turnout.report.comparison_page import comparison_page, spectra_csv
    from turnout.stages.compare import compare_passage

    check_output_files(args, "--figure", "--csv")
    add_warnings(args, input_warnings(load_configuration(args.configuration), args.turnout, args.raw))
    comparison = compare_passage(
        args.file,
        args.turnout,
        args.configuration,
        args.raw,
        args.sensors,
        args.track,
        args.vehicle,
        args.load,
        not args.no_calibration,
        args.seed,
    )
    add_warnings(args, comparison.warnings)
    add_result(args, [b.row for b in comparison.bands])
    print("\n".join(comparison_lines(comparison)))
    for path, content in ((args.figure, comparison_page), (args.csv, spectra_csv)):
        if path:
            write_text(path, content(comparison))
    return 0


def comparison_lines(comparison: PassageComparison) -> list[str]:
    """The comparison as text.

    Parameters
    ----------
    comparison : PassageComparison
        Result of ``compare_passage``.

    Returns
    -------
    list of str
        Lines: train, notes, and a row per sensor and band.
    """
    lines = [comparison.train, *(f"  {note}" for note in comparison.notes)]
    lines.append(
        "sensor       band [Hz]  rms recorded, simulated  peak recorded, simulated [m/s²] level [dB] fit / chance [%]"
    )
    for b in comparison.bands:
        r, chance = b.row, "-" if b.fit_by_chance is None else f"{b.fit_by_chance:.1f}"
        lines.append(
            f"{b.sensor:<10}{b.low:6.0f}-{b.high:<5.0f}{r['rms_recorded_ms2']:13.2f}{r['rms_simulated_ms2']:12.2f}"
            f"{r['peak_recorded_ms2']:15.1f}{r['peak_simulated_ms2']:18.1f}"
            f"{r['level_db']:+z10.1f}{r['fit_pct']:9.1f} / {chance:>5}"
        )
    lines.append("level: power of the simulation over that of the recording")
    lines.append("chance: 95 % of shifts of the simulation in time fit worse; a fit below it or below 0 says nothing")
    return lines
