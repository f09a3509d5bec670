"""Run the workflow on published recordings of others, and compare the results with what their authors state.

Downloads three source distributions by package name, checks their SHA-256, and extracts the recordings:
a hammer test of five impacts (impact 0 overloaded, impact 2 double, according to its authors), the frequency responses
of two beams with published modes, and UFF files of vendors. Everything is below real/.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_cores

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from turnout.demo.published_modes import Beam

GROUP = "Examples"
HELP = "run the workflow on published recordings of others"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("--folder", default="real", help="folder of all output (default real)")
    add_cores(parser, "processors to use (default 2)", default=2)


def run(args: argparse.Namespace) -> int:
    """Fetch, run, compare.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from pathlib import Path

    from turnout.demo.fleet import run_pipeline
    from turnout.demo.others import fetch_all
    from turnout.demo.published_modes import beam_modes
    from turnout.installation import shipped_path
    from turnout.report.beams import write_beams

    folder = Path(args.folder)
    fetch_all(folder / "raw")
    examples = shipped_path("examples/recordings_of_others")
    code = run_pipeline(args.cores, "--directory", str(folder), "--config", f"configuration={examples}")
    if code:
        return code
    _print_impacts(folder)
    beams = list(beam_modes(folder / "raw"))
    _print_modes(beams)
    page = write_beams(beams, folder / "results" / "pages")
    _print_uff(folder)
    print(f"\nPages: {folder}/results/pages/index.html")
    print(f"Modes of the beams, drawn: {page}; as a table: {page.with_suffix('.csv')}")
    return 0


def _print_impacts(folder: Path) -> None:
    from turnout.demo.published_modes import HITS
    from turnout.registry.database import open_registry

    print("\nHammer test of five impacts of pyFRF 1.1.4")
    print(f"{'impact':>6}  {'its authors say':<24} {'found':<10} why")
    with open_registry(folder / "results" / "registry") as connection:
        rows = connection.execute("select record, status, detail from impacts_current order by record").fetchall()
    for record, status, detail in rows:
        print(f"{record:>6}  {HITS[record]:<24} {status:<10} {detail or ''}")


def _print_modes(beams: Iterable[Beam]) -> None:
    from turnout.report.formatting import with_half_width

    for beam in beams:
        print(f"\nModes of the {beam.name} ({beam.origin}): found without prior knowledge of their number or frequency")
        print(f"{'published [Hz]':>15} {'found [Hz]':>22} {'published damping':>19} {'found damping [%]':>20} {'n':>4}")
        for f, damping, mode in beam.rows:
            published = "not published" if f is None else f"{f:.1f}"
            zeta = "" if damping is None else f"{damping:.2f} %"
            if mode is None:
                print(f"{published:>15} {'not found':>22} {zeta:>19}")
                continue
            estimate, damping_estimate = mode.frequency, mode.damping
            frequency = with_half_width(estimate.mean, (estimate.high - estimate.low) / 2, 2)
            ratio = with_half_width(100 * damping_estimate.mean, 50 * (damping_estimate.high - damping_estimate.low), 3)
            print(f"{published:>15} {frequency:>22} {zeta:>19} {ratio:>20} {estimate.n:>4}")
    print("± is the 95 % t interval of the mean over n responses, as if independent; those of one sensor are not.")


def _print_uff(folder: Path) -> None:
    from turnout.demo.published_modes import uff_contents

    print("\nVendors' UFF files")
    for path in sorted((folder / "raw" / "uff").glob("*.uff")):
        print(f"   {path.name:<48} {uff_contents(path)}")
