"""Hammer tests that agree with impacts at another position than the stated one: misnamed files, or a wrong mark."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput
from turnout.mismatch.turnout.filed_tests import FiledTests
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
            f"{stated:.2f} m, as stated. The diagnosis takes them where they agree. Check the names of their files, "
            "and where the impacts were made"
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


def misplaced_tests(filed: FiledTests) -> MisplacedTests:
    """Tests that agree with impacts at the position of another test, or beside their own, and not at their own.

    Parameters
    ----------
    filed : FiledTests
        Hammer tests of the campaign.

    Returns
    -------
    MisplacedTests
        False if there are none.
    """
    misplaced = {}
    for test in (pairs[0].test for pairs in filed.pairs_by_test.values()):
        stated_correlation = _mean_correlation(filed, test, test.place)
        if stated_correlation >= CHANNELS_CHECK.same_sensor:
            if (nearby := _position_nearby(filed, test)) is not None:
                misplaced[test.name] = test.place, nearby
            continue
        trials = [(_mean_correlation(filed, test, x), x) for x in sorted(set(filed.positions) - {test.place})]
        best_correlation, best_position = max(trials, default=(-np.inf, test.place))
        if best_correlation >= max(CHANNELS_CHECK.same_sensor, stated_correlation + CHANNELS_CHECK.min_gain):
            misplaced[test.name] = test.place, best_position
    return MisplacedTests(misplaced)


def _mean_correlation(filed: FiledTests, test: HammerInput, position: float) -> float:
    return float(np.mean(filed.correlations_at(test, position)))


def _position_nearby(filed: FiledTests, test: HammerInput) -> float | None:
    """Position beside the stated one where *every* channel of a test agrees better [m], None if there is none.

    Sensors on both sides are needed. A track that is stiffer or softer than in its file, or a sensor elsewhere, moves
    the best position of a channel towards its sensor or away from it, and that of one on the other side oppositely.
    """
    distances = [p.sensor.place - test.place for p in filed.pairs_by_test[test.name]]
    far = CHANNELS_CHECK.min_side_distance
    if not min(distances) <= -far < far <= max(distances):
        return None
    stated = filed.correlations_at(test, test.place)
    for side in (-1.0, 1.0):
        position, agreeing, step = None, stated, CHANNELS_CHECK.first_position_step
        while step <= CHANNELS_CHECK.max_position_step:
            trial = filed.correlations_at(test, test.place + side * step)
            if np.any(trial <= stated) or trial.mean() <= agreeing.mean():
                break
            position, agreeing = test.place + side * step, trial
            step += CHANNELS_CHECK.position_step
        if position is not None and agreeing.mean() - stated.mean() >= CHANNELS_CHECK.min_position_gain:
            return round(position, 2)
    return None
