"""Remove from a passage what no train causes, before anything is computed from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.passage.electrical_pulses import without_pulses
from turnout.records import Recording, Rejection
from turnout.signal.cleaning import without_artefacts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.result import PassageSensor


def clean(recording: Recording, sensors: Sequence[PassageSensor]) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording without electrical pulses, spikes and hum, and what was removed as findings.

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
    recording, removed = without_artefacts(recording, {s.name for s in sensors})
    return recording, (*pulses, *removed)
