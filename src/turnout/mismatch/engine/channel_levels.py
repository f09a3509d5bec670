"""Mean squares of single channels of recordings: against the level of intact turnouts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation


def worst_channel_excess(case: Case, fit: Fit) -> float:
    """Largest mean square of one channel in one recording over that of controls.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    float
        0 if no data type has such a control level.
    """
    return max(_recording_excesses(case, fit).values(), default=0.0)


def loud_recording(case: Case, fit: Fit) -> int | None:
    """The recording that alone has a channel above the level of controls.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    int or None
        Its number. None if no recording is above the level, or several are, or fewer than
        ``min_confirming_recordings`` others could show it.
    """
    excesses = _recording_excesses(case, fit)
    above = [k for k, excess in excesses.items() if excess > 1.0]
    return above[0] if len(above) == 1 and len(excesses) > THRESHOLDS.min_confirming_recordings else None


def _recording_excesses(case: Case, fit: Fit) -> dict[int, float]:
    """Largest mean square of a channel over that of controls, by the number of each recording with such a level."""
    return {
        k: float(np.max(channel_mean_squares(o, white), initial=0.0)) / case.cell_level[o.data_type]
        for k, (o, white) in enumerate(zip(case.observations, fit.white))
        if o.data_type in case.cell_level
    }


def channel_mean_squares(observation: Observation, white: np.ndarray) -> np.ndarray:
    """Mean square of each channel of an observation.

    Parameters
    ----------
    observation : Observation
    white : (n,) array of float
        Whitened samples; those outside all cells are left out.

    Returns
    -------
    (n_channel,) array of float
        Empty if the observation has no cells, or no channels.
    """
    if observation.cells is None or "sensor" not in observation.labels:
        return np.zeros(0)
    inside = observation.cells >= 0
    sensors, code = np.unique(observation.labels["sensor"].astype(str), return_inverse=True)
    channel = code[observation.cells[inside]]
    count = np.maximum(np.bincount(channel, minlength=sensors.size), 1)
    return np.bincount(channel, np.asarray(white)[inside] ** 2, minlength=sensors.size) / count


def is_lone_excess(case: Case, fit: Fit) -> bool:
    """Whether one channel of one recording alone is above the level of intact turnouts, and other recordings are not.

    An effect of track or sensor shows in that channel whenever a train passes, one of a wheel in all channels that it
    passes. What one channel of one recording has alone belongs to that recording.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    bool
        False if fewer than ``min_confirming_recordings`` other recordings of the same type could show it.
    """
    n_above, n_within = 0, 0
    for o, white in zip(case.observations, fit.white):
        if o.data_type not in case.cell_level:
            continue
        above = int(np.sum(channel_mean_squares(o, white) > case.cell_level[o.data_type]))
        n_above, n_within = n_above + above, n_within + (above == 0)
    return n_above == 1 and n_within >= THRESHOLDS.min_confirming_recordings
