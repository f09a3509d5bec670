"""Numeric constants of the calibrated model in one place, each with its unit, its reason and its source."""

from dataclasses import dataclass, fields
from typing import Any

from turnout.mismatch.engine.thresholds import threshold

PAGE = "decisions/calibrated-model.md"


@dataclass(frozen=True)
class CalibrationConstants:
    """Constants of the recursive estimate. ``CALIBRATION`` is the only instance in use."""

    repeated_error_share: float = threshold(
        0.9, "share of the tolerated variance", "that repeats in all recordings of a group; not yet measured", PAGE
    )
    max_chance: float = threshold(1e-4, "probability", "that an innovation of an intact visit is larger", PAGE)
    relinearization_step: float = threshold(
        0.5, "prior sd", "by which the mean may move from where derivatives were computed", PAGE
    )
    finding_sds: float = threshold(3.0, "standard deviations", "beyond which a value differs from the file", PAGE)
    min_prior_share: float = threshold(
        1e-9, "share of the prior variance", "of a mean over components, below which data say nothing", "numerical"
    )
    interval_probability: float = threshold(0.95, "probability", "of the interval of an onset", "convention")


CALIBRATION = CalibrationConstants()


def calibration_rows() -> list[tuple[str, Any, str, str, str]]:
    """(name, value, unit, reason, source) of every constant, in the order of the code."""
    return [
        (f.name, f.default, f.metadata["unit"], f.metadata["reason"], f.metadata["source"])
        for f in fields(CalibrationConstants)
    ]
