"""A channel with a wrong sensitivity in the hammer tests alone."""

from turnout_blind.effects import gain

EFFECT = gain.EFFECT.in_recordings_of("hammer", "hammer_gain")
