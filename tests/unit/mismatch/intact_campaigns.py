"""Simulated campaigns on intact track, each computed once for all tests that use it."""

from functools import cache

from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan


@cache
def intact_campaign(hammer_positions, seed):
    """Passages at 15 °C, and impacts at the positions [m]; recordings are not changed by a test."""
    campaign = measured_campaign(small_plan((15.0,), hammer_positions=hammer_positions), (), seed)
    for recording in [p.recording for p in campaign.passages]:
        recording.samples.flags.writeable = False
    return campaign
