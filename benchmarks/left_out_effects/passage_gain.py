"""A channel with a wrong sensitivity in the passages alone."""

from turnout_blind.effects import gain

EFFECT = gain.EFFECT.in_recordings_of("passage", "passage_gain")
