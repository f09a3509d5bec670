"""Impulse response of a section from the simulated track, with its stiffness changed by given factors."""

from functools import lru_cache

import numpy as np

from turnout.demo.hammer import N_SAMPLE, RATE
from turnout.simulate.frequency_response import receptance
from turnout.simulate.hammer import located
from turnout.simulate.matrices import assemble
from turnout.simulate.parameters import load_track
from turnout.simulate.turnout_track import stretch_of_track

SPREAD = 0.006
HALF_LENGTH = 18.0
# The hammer's pulse has nothing above; a smooth end keeps the impulse response short.
PASS, STOP = 2_500.0, 4_000.0


def simulated_response(section, ballast, railpad, hangs=False):
    """Function of a random generator giving (N_SAMPLE,) acceleration per unit impulse [m/s² per N s].

    The rail head is struck and measured at the section's place on the track of config/tracks/tommerup.yaml,
    whose ballast and pads are ``ballast`` and ``railpad`` times as stiff as there. From blow to blow the track
    answers 0.6 % faster or slower: hammer and sensor never stand in quite the same place. ``hangs``: the sleeper
    under the sensor hangs above its ballast, which an unloaded track never touches.
    """
    frequency, accelerance = _accelerance(section, round(ballast, 6), round(railpad, 6), hangs)

    def response(rng):
        stretched = np.interp(frequency * (1.0 + SPREAD * rng.standard_normal()), frequency, accelerance)
        return np.fft.irfft(stretched, N_SAMPLE) * RATE

    return response


@lru_cache(maxsize=8)
def _accelerance(section, ballast, railpad, hangs):
    """Frequencies [Hz] and accelerance [m/s²/N] up to the Nyquist frequency."""
    place, track = located(_turnout(), section)
    stretch = stretch_of_track(track, place, HALF_LENGTH)
    under = stretch.nearest_support(place)
    place = float(stretch.support[under])
    touched = np.ones(stretch.support.size)
    touched[under] = 0.0 if hangs else 1.0
    changed = stretch.with_(
        ballast_stiffness=ballast * touched * stretch.ballast_stiffness,
        ballast_damping=touched * stretch.ballast_damping,
        pad_stiffness=railpad * stretch.pad_stiffness,
    )
    frequency = np.fft.rfftfreq(N_SAMPLE, 1.0 / RATE)
    inside = (frequency > 0) & (frequency < STOP)
    h = receptance(assemble(changed), frequency[inside], place, place)
    taper = 0.5 * (1.0 + np.cos(np.pi * np.clip((frequency[inside] - PASS) / (STOP - PASS), 0.0, 1.0)))
    accelerance = np.zeros(frequency.size, complex)
    accelerance[inside] = -((2 * np.pi * frequency[inside]) ** 2) * h * taper
    return frequency, accelerance


@lru_cache(maxsize=1)
def _turnout():
    return load_track("tommerup")
