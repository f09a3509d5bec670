"""Draw the figures of the simulation: receptances, a passage, two sensors in two bands, decay rates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import GRAVITY, KMH
from turnout.files import make_folder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from turnout.records import Recording
    from turnout.simulate.passage import PassageTruth

SPEED = 160.0 / KMH
SENSORS = (("A1", 0.6), ("A4", 9.0), ("A7", 24.6), ("nose", 26.7), ("A11", 36.0))
NOSE, NOSE_LENGTH, NOSE_SHARE, NOSE_REACH = 26.7, 1.2, 0.55, 4.0  # m, m, -, m: of the track file
NOSE_DEPTHS, NOSE_SPEEDS = (0.3e-3, 0.5e-3, 1.0e-3), (60.0, 80.0, 100.0, 120.0, 140.0, 160.0)  # m, km/h
WHEEL_MASS, WHEEL_LOAD = 775.0, 64e3  # kg, N: half a wheelset of an IC3
LOW_BAND, HIGH_BAND = (0.0, 40.0), (40.0, 1000.0)


def draw_all(folder: str | Path) -> Iterator[Path]:
    """Draw every figure as SVG.

    Parameters
    ----------
    folder : str or Path
        Folder of the figures, created where it does not exist.

    Yields
    ------
    Path
        File of each figure.
    """
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "turnout", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
    folder = Path(folder)
    make_folder(folder)
    recording, truth = _passage()
    yield _save(_receptances(), folder / "simulation_receptance.svg")
    yield _save(_passage_forces(recording, truth), folder / "simulation_passage.svg")
    yield _save(_two_sensors(recording), folder / "simulation_two_bands.svg")
    yield _save(_closed_form(), folder / "simulation_closed_form.svg")


def _save(figure: Figure, path: Path) -> Path:
    import matplotlib.pyplot as plt

    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
    return path


def _passage() -> tuple[Recording, PassageTruth]:
    from turnout.simulate import Sensor, load_track, load_vehicle, simulate_passage

    sensors = [Sensor(name, position, "rail web", noise=0.05) for name, position in SENSORS]
    return simulate_passage(load_track("tommerup"), load_vehicle("ic3", 0.5), SPEED, sensors, seed=1, truth=True)


def _receptances() -> Figure:
    """Receptance of the track, and its estimate from ten simulated impacts, at four sections."""
    import matplotlib.pyplot as plt

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.hammer_test import find_impacts, receptance_of
    from turnout.simulate import load_track, simulate_hammer
    from turnout.simulate.frequency_response import receptance
    from turnout.simulate.hammer import resolve_location
    from turnout.simulate.matrices import assemble

    turnout, settings = load_track("tommerup"), ReceptanceSettings()
    printed = {"OT": (154.6, 611.6), "CLP": (105.9, 407.6), "A7": (99.6, 616.4), "ASD": (131.3, 692.6)}
    figure, axes = plt.subplots(2, 2, figsize=(8.5, 6.0), sharex=True, layout="constrained")
    for axis, (name, modes) in zip(axes.flat, printed.items()):
        position, track = resolve_location(turnout, name)
        recordings = simulate_hammer(turnout, name, n_impacts=10, duration=0.3)
        measured = receptance_of(
            [i for i in find_impacts(recordings, "hammer", "acc_1", settings) if i.accepted], settings
        )
        inside = (measured.frequency > 30.0) & (measured.frequency < 900.0)
        exact = receptance(assemble(track), measured.frequency[inside], position, position)
        axis.semilogy(measured.frequency[inside], np.abs(exact), lw=2.5, color="0.75", label="track, frequency domain")
        axis.semilogy(
            measured.frequency[inside], np.abs(measured.h1[inside]), lw=0.9, color="C0", label="H1 of ten impacts"
        )
        for mode in modes:
            axis.axvline(mode, color="C3", lw=0.8, ls="--", label="paper, table 3" if mode == modes[0] else None)
        axis.set_title(name)
    axes[0, 0].legend()
    for axis in axes[:, 0]:
        axis.set_ylabel("|receptance| [m/N]")
    for axis in axes[1]:
        axis.set_xlabel("frequency [Hz]")
    return figure


def _passage_forces(recording: Recording, truth: PassageTruth) -> Figure:
    """Acceleration at the crossing, and the contact force of every wheel over its position."""
    import matplotlib.pyplot as plt

    figure, (top, bottom, losses) = plt.subplots(3, 1, figsize=(8.5, 9.0), layout="constrained")
    time = truth.time
    top.plot(time, recording.signal("nose"), lw=0.5)
    top.set(xlabel="time [s]", ylabel="acceleration [m/s²]", title="IC3 at 160 km/h, rail at the crossing nose")
    for wheel in range(truth.force.shape[0]):
        is_near = np.abs(truth.wheel_position[wheel] - 26.7) < 1.6
        bottom.plot(
            truth.wheel_position[wheel, is_near], truth.force[wheel, is_near] / 1e3, lw=0.8, label=f"wheel {wheel + 1}"
        )
    bottom.set(xlabel="position [m]", ylabel="contact force [kN]", title="every wheel at the crossing (nose at 26.7 m)")
    bottom.set_ylim(0.0, 1.3 * bottom.get_ylim()[1])  # room for the legend
    bottom.legend(ncol=4, loc="upper center")
    for depth in NOSE_DEPTHS:
        lost = [contact_loss(depth, speed / KMH) for speed in NOSE_SPEEDS]
        losses.plot(NOSE_SPEEDS, lost, "o-", lw=0.8, label=f"dip of {1e3 * depth:g} mm")
    title = "one wheel of 64 kN: rail without contact behind the nose"
    losses.set(xlabel="speed [km/h]", ylabel="length [m]", title=title)
    losses.legend()
    return figure


def contact_loss(depth: float, speed: float) -> float:
    """Length of rail behind the nose over which a single wheel has no contact, on a smooth rail.

    Parameters
    ----------
    depth : float
        Depth of the dip at the nose, with the length and the share of the track file. [m]
    speed : float
        Speed. [m/s]

    Returns
    -------
    float
        Length. [m]
    """
    from dataclasses import replace

    from turnout.simulate import Sensor, load_track, simulate_passage
    from turnout.simulate.vehicle import lone_wheels
    from turnout.simulate.wheel_path import Kink

    turnout, wheel = load_track("tommerup"), lone_wheels(WHEEL_MASS, pressing=WHEEL_LOAD - WHEEL_MASS * GRAVITY)
    turnout = replace(turnout, routes={"main": ((Kink(NOSE, depth, NOSE_LENGTH, NOSE_SHARE),),)}, roughness_level=None)
    around = NOSE_REACH / speed
    _, truth = simulate_passage(turnout, wheel, speed, [Sensor("nose", NOSE)], lead=around, tail=around, truth=True)
    is_behind = (truth.wheel_position[0] > NOSE - 1.2) & (truth.wheel_position[0] < NOSE + 1.8)
    return float(np.sum(truth.force[0, is_behind] <= 0.0) * speed * (truth.time[1] - truth.time[0]))


def _two_sensors(recording: Recording) -> Figure:
    """Sensors A1 and A4 in 0-40 and 40-1000 Hz, time series and power spectral density, as in the paper."""
    import matplotlib.pyplot as plt
    from scipy.signal import butter, sosfiltfilt, welch

    figure, axes = plt.subplots(2, 4, figsize=(13.0, 5.5), layout="constrained")
    time = np.arange(recording.n_sample) / recording.rate
    for row, name in enumerate(("A1", "A4")):
        signal = recording.signal(name)
        for column, (low, high) in enumerate((LOW_BAND, HIGH_BAND)):
            edges, filter_type = (high, "low") if low == 0.0 else ((low, high), "band")
            filtered = sosfiltfilt(butter(4, edges, filter_type, fs=recording.rate, output="sos"), signal)
            frequency, density = welch(filtered, recording.rate, nperseg=16384)
            inside = (frequency >= max(low, 1.0)) & (frequency <= high)
            time_axis, density_axis = axes[row, 2 * column], axes[row, 2 * column + 1]
            time_axis.plot(time, filtered, lw=0.4)
            time_axis.set(title=f"{name}, {low:.0f}-{high:.0f} Hz", xlabel="time [s]", ylabel="acceleration [m/s²]")
            density_axis.semilogy(frequency[inside], density[inside], lw=0.8)
            density_axis.set(xlabel="frequency [Hz]", ylabel="power density [(m/s²)²/Hz]")
    return figure


def _closed_form() -> Figure:
    """Receptance of the meshed track and of Floquet's solution, and the wave that propagates from an impact."""
    import matplotlib.pyplot as plt

    from turnout.simulate import uniform_track
    from turnout.simulate.frequency_response import receptance
    from turnout.simulate.infinite_track import floquet_receptance, propagation
    from turnout.simulate.matrices import assemble

    track, frequency = uniform_track(96.0), np.arange(20.0, 1301.0, 5.0)
    figure, (receptance_axis, wave_axis) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    for offset, name in ((0.0, "over a sleeper"), (0.3, "mid-span")):
        exact = np.abs(floquet_receptance(frequency, track, offset))
        meshed = np.abs(receptance(assemble(track), frequency, 48.0 + offset, 48.0 + offset))
        receptance_axis.semilogy(frequency, exact, lw=2.5, color="0.75")
        receptance_axis.semilogy(frequency, meshed, lw=0.9, label=f"{name}, 4 elements per bay")
    receptance_axis.set(xlabel="frequency [Hz]", ylabel="|receptance| [m/N]", title="grey: infinite track, Floquet")
    receptance_axis.legend()
    kappa = propagation(frequency, track)
    wave_axis.plot(frequency, np.abs(kappa[:, 0].real), label="wavenumber [rad/m]")
    wave_axis.plot(frequency, -8.686 * kappa[:, 0].imag, label="decay [dB/m]")
    wave_axis.set(xlabel="frequency [Hz]", ylabel="see key", title="less damped wave", ylim=(0.0, 25.0))
    wave_axis.legend()
    return figure
