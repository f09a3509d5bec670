"""Simulate the vertical dynamics of train and turnout: hammer tests and passages as recordings like measured ones.

Each name is imported when it is first used: who only reads the text of an effect need not load the compiled kernels.
"""

TYPE_CHECKING = False  # as in typing
if TYPE_CHECKING:
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
_MODULES = {
    "Hammer": "hammer",
    "PassageTruth": "passage",
    "Sensor": "sensor",
    "Track": "track",
    "TurnoutTrack": "turnout_track",
    "Vehicle": "vehicle",
    "car": "vehicle",
    "hammer_sensors": "hammer",
    "load_track": "parameters",
    "load_vehicle": "parameters",
    "prepare_hammer": "hammer",
    "prepare_passage": "passage",
    "simulate_hammer": "hammer",
    "simulate_passage": "passage",
    "uniform_track": "track",
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    from importlib import import_module

    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _MODULES[name]
    value = getattr(import_module(f"turnout.simulate.{module}"), name)
    globals()[name] = value
    return value
