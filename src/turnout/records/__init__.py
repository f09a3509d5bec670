"""Records that the packages of the program exchange. All values are in SI units; times are naive UTC."""

from turnout.records.modal import FittedReceptance, Impact, ModalModel, Mode, Receptance
from turnout.records.raw import MID_SPAN, RawChannel, RawDescription
from turnout.records.recording import EMPTY_MAPPING, Channel, LongRecording, ReadResult, Recording
from turnout.records.unit import Rejection, Unit

__all__ = [
    "EMPTY_MAPPING",
    "MID_SPAN",
    "Channel",
    "FittedReceptance",
    "Impact",
    "LongRecording",
    "ModalModel",
    "Mode",
    "RawChannel",
    "RawDescription",
    "ReadResult",
    "Receptance",
    "Recording",
    "Rejection",
    "Unit",
]
