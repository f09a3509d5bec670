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

from turnout.cli.option_types import finite_number, whole_number
from turnout.cli.options import (
    add_configuration,
    add_figure,
    add_former,
    add_raw,
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
    from turnout.files import write_text
    from turnout.report.comparison_page import comparison_page, spectra_csv
    from turnout.stages.compare import compare_passage

    check_output_files(args, "--figure", "--csv")
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
        "sensor       band [Hz]  rms recorded, simulated  peak recorded, simulated [m/s²]  level [dB]  fit [%]"
    )
    for b in comparison.bands:
        rms = [float((x**2).mean() ** 0.5) for x in (b.recorded, b.simulated)]
        peak = [float(abs(x).max()) for x in (b.recorded, b.simulated)]
        lines.append(
            f"{b.sensor:<10}{b.low:6.0f}-{b.high:<5.0f}{rms[0]:13.2f}{rms[1]:12.2f}{peak[0]:15.1f}{peak[1]:18.1f}"
            f"{b.level_difference:+z12.1f}{b.fit:9.1f}"
        )
    lines.append("level: power of the simulation over that of the recording")
    return lines
