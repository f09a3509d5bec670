"""A small hammer test and two descriptions of its files."""

import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from turnout.records import Channel, RawChannel, RawDescription, Recording

sys.path.insert(0, str(Path(__file__).parent))  # so that tests can import the modules of this folder

RATE = 51200.0
EXTENSION = {
    "uff58": "uff",
    "uff58b": "uff",
    "hdf5": "h5",
    "mat73": "mat",
}  # other extensions equal the name of the format


@pytest.fixture
def hammer_test():
    """Four records of two channels, which differ from each other in scale, sign and content."""
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
    """Description of files that contain SI values under the names of the channels."""
    return RawDescription(
        (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=RATE
    )


@pytest.fixture
def in_volts():
    """Description of files that contain volts of the sensors of the paper, with reversed force and exchanged order."""
    rail = RawChannel("rail", "a1", "acceleration", unit="mV", sensitivity=35.3, sensitivity_unit="mV/g")
    force = RawChannel("force", "h", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N", sign=-1)
    return RawDescription((rail, force), rate=RATE, n_records=4, n_samples=301, time_zone="Europe/Copenhagen")


@pytest.fixture
def name_of():
    """File name of a format."""
    return lambda format: f"A7_1.{EXTENSION.get(format, format)}"
