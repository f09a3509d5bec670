"""The nouns that the parts of the program exchange. SI units throughout; times are naive UTC."""

from turnout.records.channel import Channel
from turnout.records.impact import Impact
from turnout.records.long_recording import LongRecording
from turnout.records.modal import ModalModel, Mode
from turnout.records.raw import RawChannel, RawDescription
from turnout.records.receptance import Receptance
from turnout.records.recording import NOTHING, ReadResult, Recording
from turnout.records.rejection import Rejection
from turnout.records.unit import Unit

__all__ = [
    "NOTHING",
    "Channel",
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
