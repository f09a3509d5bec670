"""Receptance curves of published track models, from the folder of shared data."""

import numpy as np
import pytest

from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.rail import Rail
from turnout.simulate.track import uniform_track

SLAB = {"layers": 1, "pad_loss_factor": 0.25}
BALLAST = {
    "sleeper_mass": 162.0,
    "ballast_stiffness": 50e6,
    "ballast_damping": 0.0,
    "ballast_loss_factor": 1.0,
    "pad_loss_factor": 0.25,
}


@pytest.mark.parametrize(("column", "values"), [("TSDiscr1LSupp", SLAB), ("TSDiscr2LSupp", BALLAST)])
def test_rolland_discrete_supports(shared_data, column, values):
    """Hysteretic track, 241 supports: 0.15 dB from 20 to 900 Hz; the rail's mass is known to 0.2 %."""
    path = shared_data / "reference_track_models" / "rolland_data_analytical_methods.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    rail = Rail(210e9 * 3038.3e-8, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3038.3e-8)
    track = uniform_track(144.0, rail=rail, pad_damping=0.0, elements_per_bay=8, **values)
    frequency = table["Frequency"][table["Frequency"] <= 900.0]
    mobility = 2.0 * np.pi * frequency * np.abs(receptance(assemble(track), frequency, 72.0, 72.0))
    assert np.max(np.abs(20.0 * np.log10(mobility / table[column][: frequency.size]))) < 0.15


def test_nordborg_within_the_error_of_reading_his_figure(shared_data):
    """Digitised to about 1 dB, his load moves at 60 m/s: 90 % of the points to 900 Hz within 2 dB."""
    path = shared_data / "reference_track_models" / "nordborg_data.csv"
    text = path.read_text().replace(",", ".").splitlines()
    frequency, level = np.array([[float(v) for v in line.split(";")] for line in text]).T
    rail = Rail(2.1e11 * 22.5e-6, 60.0, 1.0, beam="euler")
    ballast = {"ballast_stiffness": 150e6, "ballast_damping": 48e3}
    track = uniform_track(96.0, rail=rail, pad_stiffness=300e6, pad_damping=18e3, **ballast)
    inside = (frequency > 20.0) & (frequency < 900.0)
    found = 20.0 * np.log10(np.abs(receptance(assemble(track), frequency[inside], 48.3, 48.3)))
    assert np.quantile(np.abs(found - level[inside]), 0.9) < 2.0
