"""Simulate the vertical dynamics of train and turnout: hammer tests and passages as recordings like measured ones."""

from turnout.simulate.hammer import Hammer, hammer_sensors, prepare_hammer, simulate_hammer
from turnout.simulate.parameters import load_track, load_vehicle
from turnout.simulate.passage import PassageTruth, prepare_passage, simulate_passage
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import Track, uniform_track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Vehicle, car

__all__ = [
    "Hammer",
    "PassageTruth",
    "Sensor",
    "Track",
    "TurnoutTrack",
    "Vehicle",
    "car",
    "hammer_sensors",
    "load_track",
    "load_vehicle",
    "prepare_hammer",
    "prepare_passage",
    "simulate_hammer",
    "simulate_passage",
    "uniform_track",
]
