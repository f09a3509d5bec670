"""Cases built from the hammer tests and train passages of a turnout, compared with a simulation of track and train."""

from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput, PassageInput
from turnout.mismatch.turnout.case import TrackCase

__all__ = ["CampaignInput", "HammerInput", "PassageInput", "TrackCase"]
