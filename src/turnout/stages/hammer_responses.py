"""Rows of a section of which only averaged frequency responses were filed, as analysers export them.

Modes come from ``modes_of_frf``, with errors from the spread between the responses. No impact can be judged: there is
no force, no coherence gate and no decay, and the model has no state space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from turnout.config.settings.identify import IdentifySettings
from turnout.content import sha256_of
from turnout.errors import ReadError
from turnout.modal.bands import failure_of_mode
from turnout.modal.frf import FrfMode, FrfModes, modes_of_frf
from turnout.readers.frequency_responses import FrequencyResponses, check_evaluable, find_responses
from turnout.records import ModalModel, Mode, Rejection
from turnout.records.modal import value_with_error
from turnout.stages.raw_files import quarantine_row

METHOD = "frf"
NO_IMPACTS = "from averaged frequency responses: no impact could be judged"


def responses_of(
    files: Sequence[tuple[str, int]], raw_root: Path, base: dict[str, Any], quarantine: list[dict[str, Any]]
) -> tuple[FrequencyResponses | None, list[dict[str, Any]]]:
    """The frequency responses of some files together, and a row of ``recordings`` for each file.

    A file of responses no longer stands in ``quarantine``, unless they cannot be evaluated or have other frequencies.

    Parameters
    ----------
    files : sequence of (str, int)
        Path from ``raw_root`` and size [byte] of each file.
    raw_root : Path
        Raw folder.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    quarantine : list of dict of str to any
        Rows of the files that are no recordings; it is changed.

    Returns
    -------
    tuple of (FrequencyResponses or None, list of dict)
        None without responses.
    """
    joint: FrequencyResponses | None = None
    rows = []
    for path, size in files:
        try:
            responses = find_responses(path, raw_root)
            if responses is None:
                continue
            check_evaluable(responses, path)
            if joint is not None and not _has_axis(responses, joint.frequency):
                problem = "its frequencies are not those of the other files of this test"
                raise ReadError(
                    path, "the frequency responses", problem, "Export all with the same lines", "wrong_rate"
                )
        except ReadError as error:
            quarantine[:] = [row for row in quarantine if row["path"] != path]
            quarantine.append(quarantine_row(error, base, "hammer", "read"))
            continue
        quarantine[:] = [row for row in quarantine if row["path"] != path]
        rows.append(_recording_row(responses, path, size, Path(raw_root), base))
        joint = responses if joint is None else _with_responses(joint, responses)
    return joint, rows


def _has_axis(responses: FrequencyResponses, frequency: np.ndarray) -> bool:
    return len(responses.frequency) == len(frequency) and np.allclose(responses.frequency, frequency, rtol=1e-6)


def _with_responses(first: FrequencyResponses, second: FrequencyResponses) -> FrequencyResponses:
    return replace(
        first,
        frf=np.vstack([first.frf, second.frf]),
        names=first.names + second.names,
        units=first.units + second.units,
    )


def _recording_row(
    responses: FrequencyResponses, path: str, size: int, raw_root: Path, base: dict[str, Any]
) -> dict[str, Any]:
    return {
        "recording_id": sha256_of(raw_root / path)[:32],
        "turnout_id": base["turnout_id"],
        "section_id": base["section_id"],
        "campaign_id": base["campaign_id"],
        "kind": "hammer",
        "path": path,
        "file_format": path.rsplit(".", 1)[-1].lower(),
        "file_bytes": size,
        "sampling_rate_hz": None,
        "n_channels": len(responses.frf),
        "n_records": 0,
        "n_samples": len(responses.frequency),
        "expected_n_samples": None,
    }


def response_model(responses: FrequencyResponses, settings: IdentifySettings) -> tuple[ModalModel, str]:
    """Modes of the bands, and in words what no impact could show and which further modes there are.

    Parameters
    ----------
    responses : FrequencyResponses
        Responses of one section.
    settings : IdentifySettings
        Bands of the resonances.

    Returns
    -------
    tuple of (ModalModel, str)
        The model has no matrices. Its status is that of the two resonances.
    """
    identified = modes_of_frf(responses.frequency, responses.frf)
    modes, further, failures = [], list(identified.modes), []
    for band, low, high in settings.bands():
        inside = [m for m in identified.modes if low <= m.frequency.mean < high]
        if inside:
            strongest = max(inside, key=lambda m: m.contrast)
            further.remove(strongest)
            mode = _mode(band, strongest)
            failure = failure_of_mode(mode, settings)
            if failure is None:
                modes.append(mode)
            else:
                failures.append(failure)
    n_main = sum(mode.band in ("ballast", "railpad") for mode in modes)
    status = ("rejected", "second_order_only", "accepted")[n_main]
    rejections = list(failures)
    if not n_main:
        rejections.append(Rejection("not_identified", detail="no mode in the bands of the two resonances"))
    empty = np.zeros(0)
    model = ModalModel(np.zeros((0, 0)), empty, empty, float("nan"), tuple(modes), METHOD, status, tuple(rejections))
    failure_words = [str(failure.detail) for failure in failures]
    return model, "; ".join([NO_IMPACTS, *_single_words(model), *failure_words, *_other_words(further, identified)])


def _single_words(model: ModalModel) -> list[str]:
    """The errors of a single response, which are those of its fit and too small."""
    return [
        f"{mode.band} ± {mode.frequency_se:.2g} Hz by the fit of a single response alone, its true error is larger"
        for mode in model.modes
        if mode.n == 1
    ]


def _mode(band: str, mode: FrfMode) -> Mode:
    f, zeta = mode.frequency, mode.damping
    return Mode(
        band, f.mean, zeta.mean, f.se, zeta.se, f.spread, zeta.spread, f.low, f.high, zeta.low, zeta.high, n=f.n
    )


def _other_words(further: Sequence[FrfMode], identified: FrfModes) -> list[str]:
    """Further modes and rejected peaks in words."""
    listed = [
        f"{value_with_error(m.frequency.mean, 0.5 * (m.frequency.high - m.frequency.low))} Hz "
        f"({100.0 * m.damping.mean:.3g} %)"
        for m in further
    ]
    words = [f"further modes {', '.join(listed)}"] if listed else []
    return words + [f"{peak['frequency']:.0f} Hz not used: {peak['reason']}" for peak in identified.rejected]
