"""The track of a turnout of the demonstration on one day. Impacts and trains of that day meet the same track."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.demo.scenario import gap_under, stiffness_factors
from turnout.simulate.parameters import load_track

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import date

    from turnout.demo.scenario import TurnoutScenario
    from turnout.simulate.track import Track
    from turnout.simulate.turnout_track import TurnoutTrack


@lru_cache(maxsize=4)
def track_on(scenario: TurnoutScenario, day: date, temperature: float) -> TurnoutTrack:
    """The turnout with the stiffness of every section on a day, on both routes. Its sleepers lie on their ballast.

    Parameters
    ----------
    scenario : TurnoutScenario
    day : date
    temperature : float
        Of the rail. [°C]

    Returns
    -------
    TurnoutTrack
    """

    def factors(section: str) -> tuple[float, float]:
        ballast, pad = stiffness_factors(scenario, section, day, temperature)
        return ballast * scenario.stiffness, pad * scenario.stiffness

    return with_stiffness(load_track("tommerup"), factors)


@lru_cache(maxsize=4)
def unloaded_track_on(scenario: TurnoutScenario, day: date, temperature: float) -> TurnoutTrack:
    """The turnout without trains: sleepers above a gap do not touch their ballast.

    Parameters
    ----------
    scenario : TurnoutScenario
    day : date
    temperature : float
        Of the rail. [°C]

    Returns
    -------
    TurnoutTrack
    """
    turnout = track_on(scenario, day, temperature)
    hanging = [s for s in sorted({g.section for g in scenario.gaps}) if gap_under(scenario, s, day) > 0.0]

    def lift(track: Track) -> Track:
        contact = np.ones(track.support.size)
        for position, route in (turnout.locations[section] for section in hanging):
            if turnout.track_of(route) is track:
                contact[track.nearest_support(position)] = 0.0
        return track.with_(
            ballast_stiffness=contact * track.ballast_stiffness, ballast_damping=contact * track.ballast_damping
        )

    return _for_all_routes(turnout, lift)


def with_stiffness(turnout: TurnoutTrack, factors: Callable[[str], tuple[float, float]]) -> TurnoutTrack:
    """The turnout with other ballast and pads.

    Parameters
    ----------
    turnout : TurnoutTrack
    factors : callable
        From the label of a section to the stiffness of its ballast and of its pads over that of ``turnout``.

    Returns
    -------
    TurnoutTrack
    """

    def scale(track: Track) -> Track:
        by_section = {section: factors(section) for section in set(track.section)}
        ballast, pad = np.array([by_section[section] for section in track.section]).T
        return track.with_(ballast_stiffness=ballast * track.ballast_stiffness, pad_stiffness=pad * track.pad_stiffness)

    return _for_all_routes(turnout, scale)


def _for_all_routes(turnout: TurnoutTrack, change: Callable[[Track], Track]) -> TurnoutTrack:
    tracks = {route: change(track) for route, track in turnout.tracks.items()}
    return replace(turnout, track=change(turnout.track), tracks=tracks)
