"""Where hammer tests have the supports, in sets of single visits with files that are right and files that are not.

    python -m benchmarks.support_positions SET [SET ...] [--off M ...]

Moves all supports of the track file by each distance, 0, 0.1 and 0.2 m by default, and prints per set and distance: the
number of cases, in how many the supports are found elsewhere, the range of the distances found, and their rms error.
The files of the sets are taken to be right, so no truth is needed. A case costs 3 to 6 CPU s for each distance.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.blind_bridge import campaigns_of
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.observed_tests import fit_hammer_start, observe_tests
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.site import site_of
from turnout.mismatch.turnout.support_positions import misplaced_supports


def offset_found(campaign, distance):
    """Offset that the hammer tests show with supports of the file ``distance`` too far along the track [m]."""
    campaign = replace(campaign, turnout=campaign.turnout.with_moved_supports(distance))
    tests = observe_tests(campaign, MismatchSettings().pair_tolerance)
    predictor = Predictor(site_of(campaign), Track1D()).with_recordings(tests.frf_pairs, {})
    start = fit_hammer_start(predictor, tests, campaign.reserved)
    return misplaced_supports(start, campaign.reserved).offset


def main():
    """Print a row per set and distance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path, nargs="+", help="folders of sets of single visits")
    parser.add_argument("--off", type=float, nargs="+", default=[0.0, 0.1, 0.2], metavar="M", help="distances [m]")
    args = parser.parse_args()
    print("| set | supports of the file off by [m] | cases | found elsewhere | offset found [m] | rms error [m] |")
    print("|---|---|---|---|---|---|", flush=True)
    for folder in args.sets:
        cases = sorted(path.name for path in (folder / "cases").iterdir())
        campaigns = [campaign for case in cases for campaign in campaigns_of(folder / "cases" / case, case)]
        for distance in args.off:
            offsets = [offset_found(campaign, distance) for campaign in campaigns]
            found = [offset for offset in offsets if offset]
            ends = f"{min(found):.2f} to {max(found):.2f}" if found else ""
            rms = f"{np.sqrt(np.mean(np.square(np.add(found, distance)))):.3f}" if found else ""
            print(f"| {folder.name} | {distance:g} | {len(offsets)} | {len(found)} | {ends} | {rms} |", flush=True)


if __name__ == "__main__":
    main()
