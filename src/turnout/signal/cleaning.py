"""Remove artefacts from a recording, which are no vibration, before anything is computed from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.signal.hum import without_hum
from turnout.signal.spikes import without_spikes

if TYPE_CHECKING:
    from collections.abc import Container, Iterable
    from logging import Logger

    from turnout.records import Recording, Rejection

CLEANERS = (without_spikes, without_hum)


def without_artefacts(
    recording: Recording, names: Container[str] | None = None
) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording without spikes and hum, and what was removed as findings.

    Parameters
    ----------
    recording : Recording
        Any recording.
    names : container of str, optional
        Of the channels that are searched, by default all; others stay as they are.

    Returns
    -------
    recording : Recording
        The same object where nothing is removed.
    findings : tuple of Rejection
        What was removed.
    """
    findings: tuple[Rejection, ...] = ()
    for cleaner in CLEANERS:
        recording, removed = cleaner(recording, names)
        findings += removed
    return recording, findings


def is_notable(finding: Rejection) -> bool:
    """Whether a finding is worth a row: weak hum is none, as all recordings of an electrified line may have some.

    Parameters
    ----------
    finding : Rejection
        Of a recording.

    Returns
    -------
    bool
    """
    return finding.reason != "mains_hum" or (finding.value or 0.0) > (finding.limit or 0.0)


def clean_recordings(
    recordings: Iterable[Recording], log: Logger, names: Container[str] | None = None
) -> list[Recording]:
    """The recordings without spikes and hum; a warning for everything that was removed.

    Parameters
    ----------
    recordings : iterable of Recording
        Any recordings.
    log : Logger
        Takes the warnings.
    names : container of str, optional
        Of the channels that are searched, by default all.

    Returns
    -------
    list of Recording
        In the same order.
    """
    cleaned = []
    for recording in recordings:
        clean_recording, findings = without_artefacts(recording, names)
        cleaned.append(clean_recording)
        for finding in findings:
            log.warning("%s, record %d: %s", recording.source, recording.record + 1, finding.detail)
    return cleaned
