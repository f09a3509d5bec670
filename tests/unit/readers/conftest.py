"""A small hammer test and the two ways in which its files are described."""

import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from turnout.records import Channel, RawChannel, RawDescription, Recording

sys.path.insert(0, str(Path(__file__).parent))  # for the modules beside the tests

RATE = 51200.0
EXTENSION = {"uff58": "uff", "uff58b": "uff", "hdf5": "h5", "mat73": "mat"}  # others are called like their format


@pytest.fixture
def hammer_test():
    """Four records of two channels that differ from each other in scale, sign and content."""
    rng = np.random.default_rng(20240513)
    channels = (Channel("force", "force"), Channel("rail", "acceleration"))
    return [
        Recording(
            rng.normal(size=(2, 301)) * [[2000.0], [30.0]] + [[100.0 * k], [-7.0]],
            RATE,
            channels,
            started_at=datetime(2024, 5, 13, 10, k, 1, 250_000),
            conditions={"rail_temperature": 12.5},
        )
        for k in range(4)
    ]


@pytest.fixture
def in_si():
    """The files hold SI under the channels' own names."""
    return RawDescription(
        (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=RATE
    )


@pytest.fixture
def in_volts():
    """The files hold volts of the paper's sensors, the hammer turned around, the order swapped."""
    rail = RawChannel("rail", "a1", "acceleration", unit="mV", sensitivity=35.3, sensitivity_unit="mV/g")
    force = RawChannel("force", "h", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N", sign=-1)
    return RawDescription((rail, force), rate=RATE, n_records=4, n_samples=301, time_zone="Europe/Copenhagen")


@pytest.fixture
def name_of():
    """File name of a format."""
    return lambda format: f"A7_1.{EXTENSION.get(format, format)}"
