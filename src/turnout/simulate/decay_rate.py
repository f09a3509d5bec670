"""Compute the track decay rate in one-third octave bands from the receptance of a track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.frequency_response import responses

if TYPE_CHECKING:
    from turnout.simulate.matrices import TrackMatrices

# Distances of the impacts from the accelerometer [bays] after EN 15461:2008+A1, from memory, unverified. The sum is a
# quadrature over x, so another grid that is as fine near the accelerometer changes it little.
FAR_DISTANCES = [8, 10, 12, 16, 20, 24, 30, 36, 42, 48, 54, 66]
DISTANCES = np.concatenate([np.arange(0.0, 2.0, 0.25), np.arange(2.0, 4.0, 0.5), np.arange(4.0, 8.0), FAR_DISTANCES])
BANDS = np.array([100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600.0])


def track_decay_rate(
    matrices: TrackMatrices, sensor_position: float, spacing: float, bands: np.ndarray = BANDS, lines_per_band: int = 8
) -> np.ndarray:
    r"""Vertical decay rate [dB/m] in each one-third octave band, (n_band,).

    .. math:: DR = \frac{4.343}{\sum_n |A(x_n)|^2 \, \Delta x_n / |A(x_0)|^2}

    Parameters
    ----------
    matrices : TrackMatrices
        At least 66 bays beyond ``sensor_position`` in the direction of growing x.
    sensor_position : float
        Accelerometer, between two supports in the standard [m].
    spacing : float
        Bay [m].
    bands : (n_band,) array of float
        Centre frequencies [Hz].
    lines_per_band : int
        Frequencies whose squared responses are averaged in a band.

    Returns
    -------
    (n_band,) array of float
        Decay rate in each band, energy mean over its frequencies. [dB/m]

    Raises
    ------
    SimulationError
        Where the track ends before the farthest impact.

    References
    ----------
    EN 15461:2008+A1:2010; Jones, Thompson and Diehl 2006, J. Sound Vib. 293.
    """
    x = sensor_position + spacing * DISTANCES
    if x[-1] > matrices.node[-1]:
        raise SimulationError(f"the decay rate needs {x[-1]:.1f} m of track, it ends at {matrices.node[-1]:.1f} m.")
    weights = [matrices.rail_weights(position) for position in x]
    edge = 2.0 ** (1.0 / 6.0)
    rates = []
    for centre in bands:
        frequency = np.geomspace(centre / edge, centre * edge, lines_per_band)
        u = responses(matrices, frequency, [sensor_position], np.concatenate([rows for rows, _ in weights]))[:, 0]
        h = np.einsum("fnk,nk->nf", u.reshape(len(frequency), len(weights), 4), [w for _, w in weights])
        h += np.array([[matrices.compliance(sensor_position, position)] for position in x])
        energy = np.mean(np.abs(h * frequency**2) ** 2, axis=1)
        middle = 0.5 * (x[1:] + x[:-1])
        width = np.diff(np.concatenate([[x[0]], middle, [x[-1] + 0.5 * (x[-1] - x[-2])]]))
        rates.append(4.343 / np.sum(energy / energy[0] * width))
    return np.array(rates)
