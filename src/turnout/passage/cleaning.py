"""Remove from a passage what no train causes, before anything is computed from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.passage.electrical_pulses import without_pulses
from turnout.records import Recording, Rejection
from turnout.signal.spikes import without_spikes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.result import PassageSensor


def clean(recording: Recording, sensors: Sequence[PassageSensor]) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording without electrical pulses and spikes, and what was removed as findings.

    Parameters
    ----------
    recording : Recording
        Recording of the passage.
    sensors : sequence of PassageSensor
        What the channels are.

    Returns
    -------
    recording : Recording
        The same object where nothing is removed.
    findings : tuple of Rejection
        What was removed.
    """
    recording, pulses = without_pulses(recording, sensors)
    recording, spikes = without_spikes(recording, {s.name for s in sensors})
    return recording, (*pulses, *spikes)
