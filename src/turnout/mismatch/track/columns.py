"""Linear columns from pseudo-forces: what a small force at a support does to a passage's sensors.

The free track carries the force to the sensors; the wheels' share in that is left out, which an inexact Jacobian and
a score test forgive.
"""

import numpy as np

from turnout.mismatch.track import rolling
from turnout.mismatch.track.base_model import track_with
from turnout.simulate.frequency import responses
from turnout.simulate.matrices import assemble


def support_forces(case, values, terms, made):
    """Histories at the zone's supports on the fine clock: rail and sleeper displacement (n_support, n) [m]."""
    probes = case.probes()
    signals = case._clean(values, terms, made, probes)[len(made.sensors) :]
    return signals[0::2], signals[1::2]


def green(case, values, terms, made):
    """(frequency (m,), G (m, n_sensor, n_support, 2)) acceleration per force on rail seat and sleeper [m/s²/N]."""
    key = "green", made.passage.route, tuple(s.name for s in made.sensors), repr(terms)
    if key not in case._rolls:
        track = track_with(case.track(made.passage.route), case.zone, values)
        matrices = assemble(track, [t.under(case._said(made)) for t in terms if t.kind == "matrix"])
        frequency = np.arange(2.0, 1.3 * rolling.HIGH, 2.0)
        places = [s.probe(track).place for s in made.sensors]
        rows = [matrices.index[kind, j] for j in case.zone.supports for kind in ("rail", "sleeper")]
        h = responses(matrices, frequency, places, rows)
        omega2 = (2.0 * np.pi * frequency) ** 2
        case._rolls[key] = frequency, -omega2[:, None, None, None] * h.reshape(*h.shape[:2], -1, 2)
    return case._rolls[key]


def carried(case, values, terms, made, forces):
    """Sensors' response to force histories, dict key -> (support, kind 0 rail 1 sleeper 2 pad, (n,) force).

    Returns key -> (n_sensor * n_time,) on the observation's clock. A pad force presses the rail and lifts the sleeper.
    """
    rate = 4.0 * case.solver.rate
    frequency, g = green(case, values, terms, made)
    n = next(iter(forces.values()))[2].size
    size = 1 << int(np.ceil(np.log2(n + rate * 0.4)))
    grid = np.fft.rfftfreq(size, 1.0 / rate)
    inside = grid <= frequency[-1]
    where = np.interp(grid[inside], frequency, np.arange(frequency.size))
    low = np.minimum(where.astype(int), frequency.size - 2)
    part = (where - low)[:, None]
    time = made.time - made.reference - values[f"time@{made.name}"] + rolling.LEAD
    found = {}
    for key, (j, kind, force) in forces.items():
        k = j - case.zone.first
        column = g[:, :, k, 0] - g[:, :, k, 1] if kind == 2 else g[:, :, k, kind]
        transfer = (1.0 - part) * column[low] + part * column[low + 1]
        spectrum = np.zeros((grid.size, transfer.shape[1]), dtype=complex)
        spectrum[inside] = transfer * np.fft.rfft(force - force[0], size)[inside, None]
        signal = np.fft.irfft(spectrum.T, size)[:, :n]
        found[key] = rolling.read_at(made.limited(signal, rate), rate, time).ravel()
    return found


def columns_of(case, values, terms, made, histories):
    """Derivatives of a passage by the logarithm of each support's own pad and ballast stiffness."""
    rail, sleeper = histories
    track = track_with(case.track(made.passage.route), case.zone, values)
    forces = {}
    for k, j in enumerate(case.zone.supports):
        forces[f"pad_{j}"] = j, 2, -track.pad_stiffness[j] * (rail[k] - sleeper[k])
        forces[f"ballast_{j}"] = j, 1, -track.ballast_stiffness[j] * sleeper[k]
    return carried(case, values, terms, made, forces)
