"""Position of the toe of a blade as a nuisance of hammer tests.

A blade overhangs its first slide chair. The vibration of this free end depends on its length: 5 cm change receptances
beside the toe, and what chairs that open change in them, by as much as that change itself. Drawings, creep and
temperature leave a few centimetres open. Wheels pass the free end on the stock rail, so passages keep the toe of the
file. The derivative of receptances follows from that of the matrices (``ReceptanceSensitivity.toe_gradients``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.priors import RECEPTANCE, TRACK

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.mismatch.turnout.predictions import Values
    from turnout.simulate.track import Track

TOE = "toe_position"


def toe_nuisances(tracks: Iterable[Track]) -> list[Nuisance]:
    """Shift of the toe; [] without a blade, or with a toe on a bearer, where it has no free end.

    Parameters
    ----------
    tracks : iterable of Track
        Those of all routes.

    Returns
    -------
    list of Nuisance
        It stays between the bearers beside it; [] as well within a step of the derivative from one.
    """
    shifts = [limits for track in tracks if track.blade is not None and (limits := track.blade.toe_limits(track))]
    if not shifts:
        return []
    most, step = TRACK.bound_sds * TRACK.toe_sd, RECEPTANCE.toe_step  # the derivative needs a step to either side
    low, high = max(-most, *(s[0] + step for s in shifts)), min(most, *(s[1] - step for s in shifts))
    if not low < 0.0 < high:
        return []
    return [Nuisance(TOE, "m", 0.0, TRACK.toe_sd, None, (low, high), "shift of the toe", group="track")]


def with_toe(track: Track, values: Values) -> Track:
    """The track with the toe shifted.

    Parameters
    ----------
    track : Track
        The track.
    values : mapping
        Nuisances by name.

    Returns
    -------
    Track
        The same one where the toe is that of the file.
    """
    shift = float(values.get(TOE, 0.0))
    if track.blade is None or shift == 0.0:
        return track
    return track.with_(blade=replace(track.blade, toe=track.blade.toe + shift))
