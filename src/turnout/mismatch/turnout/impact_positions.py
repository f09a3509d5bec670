"""Hammer tests that agree with impacts at another position than the one stated: their files are misnamed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.turnout.campaign import CampaignInput
from turnout.mismatch.turnout.observed_tests import ObservedTests, mean_correlation
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import CHANNELS_CHECK


@dataclass(frozen=True)
class MisplacedTests:
    """Hammer tests at other positions than stated: ``positions`` are (stated, agreeing) by name of the test. [m]"""

    positions: Mapping[str, tuple[float, float]]
    recording_type = "positions of impacts"

    def __bool__(self) -> bool:
        return bool(self.positions)

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop per pair of positions.
        """
        tests_of: dict[tuple[float, float], list[str]] = {}
        for name, positions in self.positions.items():
            tests_of.setdefault(positions, []).append(name)
        return [
            f"Hammer tests {', '.join(names)} agree with impacts at {agreeing:.2f} m and not with impacts at "
            f"{stated:.2f} m, as stated. The diagnosis takes them where they agree. Check the names of their files"
            for (stated, agreeing), names in tests_of.items()
        ]

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign with these tests at the positions where they agree with the simulation.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
        positions = {name: position for name, (_, position) in self.positions.items()}
        return replace(
            campaign, hammer=tuple(replace(t, place=positions.get(t.name, t.place)) for t in campaign.hammer)
        )


def misplaced_tests(predictor: Predictor, tests: ObservedTests, positions: Iterable[float]) -> MisplacedTests:
    """Tests that agree with impacts at another one of the ``positions``, and not at their own.

    Parameters
    ----------
    predictor : Predictor
        Of the site as filed.
    tests : ObservedTests
        Hammer tests of the campaign.
    positions : iterable of float
        Positions of all hammer tests of the campaign. [m]

    Returns
    -------
    MisplacedTests
        False if there are none.
    """
    stated_positions, misplaced = sorted(set(positions)), {}
    for test in {pair.test.name: pair.test for pair in tests.frf_pairs.values()}.values():
        stated_correlation = mean_correlation(predictor, tests, test, test.place)
        if stated_correlation >= CHANNELS_CHECK.same_sensor:
            continue
        trials = [(mean_correlation(predictor, tests, test, x), x) for x in stated_positions if x != test.place]
        best_correlation, best_position = max(trials, default=(-np.inf, test.place))
        if best_correlation >= max(CHANNELS_CHECK.same_sensor, stated_correlation + CHANNELS_CHECK.min_gain):
            misplaced[test.name] = test.place, best_position
    return MisplacedTests(misplaced)
