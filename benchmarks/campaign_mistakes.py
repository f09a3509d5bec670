"""How far right campaigns are from the limits of the rules on mistakes in campaigns, in sets of single visits.

    python -m benchmarks.campaign_mistakes SET [SET ...]

Prints per set: drop-outs in the channels of all recordings, passages with a common clipped value, the least and largest
amplitude of a hammer test over the median of its case, the largest of the least gains of all channels of a test that
has sensors on both sides, 0.15 m beside its position, and the largest of the least lags of the cases whose channels all
lag or all lead. The track of the file is simulated, so no truth is needed. A case costs 5 to 20 CPU s.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.blind_bridge import campaigns_of
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.common_delay import typical_lags
from turnout.mismatch.turnout.filed_tests import FiledTests
from turnout.mismatch.turnout.observed_tests import observe_tests
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import CHANNELS_CHECK
from turnout.mismatch.turnout.site import site_of
from turnout.passage.channel_checks import channel_states
from turnout.signal.drop_outs import drop_outs


def signal_figures(campaign):
    """(signals, signals with a drop-out, passages, passages with a clipped channel)."""
    passages = [p.recording for p in campaign.passages]
    recordings = [*passages, *(r for t in campaign.hammer for r in t.recordings)]
    signals = [s for r in recordings for s in r.samples]
    findings = [{f.reason for state in channel_states(r) for f in state.findings} for r in passages]
    return (
        len(signals),
        sum(drop_outs(s).size > 0 for s in signals),
        len(passages),
        sum("clipped" in f for f in findings),
    )


def test_figures(campaign):
    """(amplitudes of the tests over their median, least gains beside the positions, least lag in ms or None)."""
    tests = observe_tests(campaign, MismatchSettings().pair_tolerance)
    predictor = Predictor(site_of(campaign), Track1D()).with_recordings(tests.frf_pairs, {})
    filed = FiledTests(predictor, tests, tuple(test.place for test in campaign.hammer))
    amplitudes = np.array([np.median(c.ratios) for c in filed.comparisons])
    gains = []
    for pairs in filed.pairs_by_test.values():
        test = pairs[0].test
        distances = [p.sensor.place - test.place for p in pairs]
        if min(distances) < -CHANNELS_CHECK.min_side_distance and max(distances) > CHANNELS_CHECK.min_side_distance:
            stated = filed.correlations_at(test, test.place)
            beside = [test.place + side * CHANNELS_CHECK.first_position_step for side in (-1.0, 1.0)]
            gains += [float(np.min(filed.correlations_at(test, x) - stated)) for x in beside]
    lags = 1e3 * np.array([lag for group in typical_lags(filed) for lag in group.values()])
    is_one_sided = lags.size > 0 and abs(np.sign(lags).sum()) == lags.size
    return amplitudes / np.median(amplitudes), gains, float(np.min(np.abs(lags))) if is_one_sided else None


def main():
    """Print a row per set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path, nargs="+", help="folders of sets of single visits")
    args = parser.parse_args()
    print("| set | drop-outs | clipped passages | amplitude of a test | gain beside a position, most | lag, most |")
    print("|---|---|---|---|---|---|", flush=True)
    for folder in args.sets:
        counts, amplitudes, gains, lags = np.zeros(4, dtype=int), [], [], []
        for case in sorted(path.name for path in (folder / "cases").iterdir()):
            for campaign in campaigns_of(folder / "cases" / case, case):
                counts += signal_figures(campaign)
                tests_alone = replace(campaign, passages=(), reserved=())
                of_case, gains_of_case, lag = test_figures(tests_alone)
                amplitudes, gains = [*amplitudes, *of_case], [*gains, *gains_of_case]
                lags += [] if lag is None else [lag]
        print(
            f"| {folder.name} | {counts[1]} of {counts[0]} signals | {counts[3]} of {counts[2]} "
            f"| {min(amplitudes):.2f} to {max(amplitudes):.2f} | {max(gains):.3f} of {len(gains)} "
            f"| {max(lags, default=0.0):.2f} ms of {len(lags)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
