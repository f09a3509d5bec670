"""Hammer tests whose amplitudes differ from those of all other tests: impacts on a sleeper, sideways, or misread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import CHANNELS_CHECK

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.mismatch.turnout.campaign import CampaignInput
    from turnout.mismatch.turnout.channel_identity import Comparison


@dataclass(frozen=True)
class DeviatingTests:
    """Hammer tests that deviate, with the ``ratios`` of their amplitudes to those of the ``n`` other tests."""

    ratios: Mapping[str, float]
    n: int

    recording_type = "amplitudes of single hammer tests"

    def __bool__(self) -> bool:
        return bool(self.ratios)

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop.
        """
        names = ", ".join(self.ratios)
        low, high = min(self.ratios.values()), max(self.ratios.values())
        factor = f"{low:.2g}" if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {high:.2g}"
        return [
            f"In hammer tests {names} the accelerations over forces of all channels are {factor} times those of the "
            f"other {self.n} tests, compared with the simulation. They were not used. Check where and in which "
            "direction the impacts were made, and the sensitivity of the hammer"
        ]

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign without these tests.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
        return replace(
            campaign,
            hammer=tuple(t for t in campaign.hammer if t.name not in self.ratios),
            reserved=tuple(name for name in campaign.reserved if name not in self.ratios),
        )


def deviating_tests(names: Sequence[str], comparisons: Sequence[Comparison]) -> DeviatingTests:
    """Tests of which every channel is larger, or every one smaller, than in the other tests by a large factor.

    Amplitudes are those over the simulation, so that the distance of a sensor does not matter. A defect of the track or
    of a sensor changes some channels of a test, or some channel of all. More tests than not must agree with each other.

    Parameters
    ----------
    names : sequence of str
        Of the tests.
    comparisons : sequence of Comparison
        One per test, in this order.

    Returns
    -------
    DeviatingTests
        False if there are none.
    """
    if len(names) < CHANNELS_CHECK.min_tests:
        return DeviatingTests({}, 0)
    logs = {name: np.log(np.maximum(c.ratios, 1e-12)) for name, c in zip(names, comparisons) if len(c.channels) > 1}
    usual = float(np.median([np.median(x) for x in logs.values()])) if logs else 0.0
    least = np.log(CHANNELS_CHECK.min_test_scale)
    ratios = {
        name: float(np.exp(np.median(x) - usual))
        for name, x in logs.items()
        if np.min(x - usual) >= least or np.max(x - usual) <= -least
    }
    n = len(names) - len(ratios)
    return DeviatingTests(ratios if len(ratios) < n else {}, n)
