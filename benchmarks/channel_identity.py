"""How well channels agree with their own sensors and with others, in sets of single visits.

    python -m benchmarks.channel_identity SET [SET ...]

Prints per set, for hammer tests and for passages: the number of channels, the lowest correlation of a channel with the
simulation at its own sensor (median over its recordings), the largest with that at another sensor, and the largest gain
of an exchange of two channels. A channel is called exchanged from a gain of 0.5 on, and unrelated below a correlation
of 0.3. The track of the file is simulated, so no truth is needed. A case costs 5 to 20 CPU s.
"""

import argparse
from itertools import combinations
from pathlib import Path

from benchmarks.blind_bridge import campaigns_of
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.channel_identity import typical_correlations
from turnout.mismatch.turnout.filed_tests import FiledTests
from turnout.mismatch.turnout.observed_tests import observe_tests
from turnout.mismatch.turnout.passage_alignment import PassageAligner
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.site import site_of


def correlations_of(campaign):
    """Kind of recording -> {(channel, sensor): median correlation}."""
    site, tests = site_of(campaign), observe_tests(campaign, MismatchSettings().pair_tolerance)
    predictor = Predictor(site, Track1D()).with_recordings(tests.frf_pairs, {})
    aligner = PassageAligner(campaign, predictor)
    values = {n.name: 0.0 for n in site.nuisances()}
    for passage in campaign.passages:
        aligner.correlation(values, passage)
    passages = [c for c in map(aligner.comparison, campaign.passages) if c is not None]
    return {
        "hammer tests": typical_correlations(FiledTests(predictor, tests, ()).comparisons, {}),
        "passages": typical_correlations(passages, {}),
    }


def figures_of(correlations):
    """(correlations of channels with their own sensors, with others, gains of every exchange of two)."""
    own = {c: r for (c, s), r in correlations.items() if c == s}
    others = [r for (c, s), r in correlations.items() if c != s]
    gains = [
        min(correlations[a, b] - own[a], correlations[b, a] - own[b])
        for a, b in combinations(own, 2)
        if (a, b) in correlations and (b, a) in correlations
    ]
    return list(own.values()), others, gains


def main():
    """Print a row per set and kind of recording."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path, nargs="+", help="folders of sets of single visits")
    args = parser.parse_args()
    print("| set | recordings | channels | own sensor, least | another sensor, most | gain of an exchange, most |")
    print("|---|---|---|---|---|---|", flush=True)
    for folder in args.sets:
        found = {}
        for case in sorted(path.name for path in (folder / "cases").iterdir()):
            for campaign in campaigns_of(folder / "cases" / case, case):
                for kind, correlations in correlations_of(campaign).items():
                    for total, values in zip(found.setdefault(kind, ([], [], [])), figures_of(correlations)):
                        total += values
        for kind, (own, others, gains) in found.items():
            print(
                f"| {folder.name} | {kind} | {len(own)} | {min(own):.2f} | {max(others):.2f} | {max(gains):.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
