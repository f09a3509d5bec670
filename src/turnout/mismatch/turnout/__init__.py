"""The case of a turnout: hammer tests and passages against the simulation of track and train."""

from turnout.mismatch.turnout.campaign import Campaign, HammerTest, Passage
from turnout.mismatch.turnout.case import TrackCase

__all__ = ["Campaign", "HammerTest", "Passage", "TrackCase"]
