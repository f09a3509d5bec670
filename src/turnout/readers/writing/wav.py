"""Writer of WAV: one continuous record; names, units and start time are JSON in the comment."""

import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from turnout.readers.writing.encode import RecordToWrite, iso_text, plain_conditions


def write_raw(
    records: Sequence[RecordToWrite], path: Path, subtype: str | None = None, full_scale: float = 1.0
) -> None:
    """Write one record.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    subtype : str or None
        PCM_16 or PCM_24 stores fractions of ``full_scale``; None stores the numbers as floats.
    full_scale : float
        Largest number that PCM can store, in the unit of the channels.

    Raises
    ------
    ValueError
        If there is more than one record, or a sample exceeds ``full_scale``.
    """
    if len(records) != 1:
        raise ValueError(f"a WAV file holds one record, not {len(records)}: write one file per record")
    (record,) = records
    samples = np.column_stack(record.samples)
    subtype = subtype or ("FLOAT" if samples.dtype == np.float32 else "DOUBLE")
    if subtype.startswith("PCM"):
        samples = samples / full_scale
        if (worst := float(np.abs(samples).max())) > 1.0:
            raise ValueError(f"a sample is {worst:.3g} of full scale: raise full_scale")
        bits = int(subtype.removeprefix("PCM_"))  # rounded here: libsndfile truncates
        steps = np.clip(np.rint(samples * 2.0 ** (bits - 1)), -(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1)
        samples = steps.astype("int32") << (32 - bits)
    rate = round(record.rate)
    notes: dict[str, Any] = {
        "channels": record.names,
        "started_at": iso_text(record.started_at),
        **plain_conditions(record.conditions),
    }
    notes["units"] = record.units if full_scale == 1.0 else ["count"] * len(record.names)
    if rate != record.rate:
        notes["rate"] = record.rate
    content = BytesIO()  # the library does not say what is wrong with a disk
    with soundfile.SoundFile(content, "w", rate, samples.shape[1], subtype, format="WAV") as file:
        file.comment = json.dumps(notes)
        file.write(samples)
    _clear_time_of_writing(content.getbuffer())
    path.write_bytes(content.getbuffer())


def _clear_time_of_writing(content: memoryview) -> None:
    """Set the time in the chunk of the peaks to 0: equal records give equal files."""
    position = 12  # behind RIFF, its size and WAVE
    while content[position : position + 4] not in (b"PEAK", b"data"):
        size = int.from_bytes(content[position + 4 : position + 8], "little")
        position += 8 + size + size % 2
    if content[position : position + 4] == b"PEAK":  # its size, its version, the time
        content[position + 12 : position + 16] = bytes(4)
