"""The calibrated model of a turnout: its parameters, estimated recursively from all visits, and what they say."""

from turnout.mismatch.calibrated.answers import answers_after_visits
from turnout.mismatch.calibrated.answers_of_change import change_answer, change_candidates, stretch_candidates
from turnout.mismatch.calibrated.belief import Belief, Innovation, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, compare_onsets, drift_since
from turnout.mismatch.calibrated.file_comparison import Deviation, deviations_from_file, track_sds
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation
from turnout.mismatch.calibrated.model_answer import ModelAnswer, StretchEnds

__all__ = [
    "Belief",
    "ChangeEffect",
    "Deviation",
    "Event",
    "GroupInformation",
    "History",
    "Innovation",
    "ModelAnswer",
    "OnsetEvidence",
    "StateParameter",
    "StretchEnds",
    "VisitInformation",
    "answers_after_visits",
    "change_answer",
    "change_candidates",
    "compare_onsets",
    "deviations_from_file",
    "drift_since",
    "estimate_history",
    "stretch_candidates",
    "track_sds",
]
