"""Estimate the numerical error of a simulated passage: repeat it with half the time step and half the element size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.simulate.links import shift_supports
from turnout.simulate.passage import simulate_passage
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import PER_SUPPORT, Track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Vehicle

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

BANDS = ((5.0, 40.0), (40.0, 120.0), (120.0, 300.0), (300.0, 600.0), (600.0, 1000.0))
# Convergence orders of the waveform. Order three of Radau is measured (2.9 to 3) where its error is above 0.1 %. Below
# that, and where contacts open and close quickly, all schemes have about two. Timoshenko elements have two.
STEP_ORDER, MESH_ORDER = {"radau": 3, "gauss": 2, "midpoint": 2}, 2


@dataclass(frozen=True)
class NumericalError:
    r"""Per sensor (rows) and band (columns): relative error of the waveform and change of the level by halving.

    With an error :math:`e = C h^p` the finer run has :math:`e / 2^p`, so the two runs differ by
    :math:`d = (1 - 2^{-p}) e`. ``step`` and ``mesh`` are the errors of the coarser run,
    :math:`d \, 2^p / (2^p - 1)`, relative to the norm of the finer run. ``level_step`` and ``level_mesh`` [dB] are the
    changes of the band's power by halving.
    """

    bands: tuple[tuple[float, float], ...]
    sensors: tuple[str, ...]
    step: np.ndarray
    mesh: np.ndarray
    level_step: np.ndarray
    level_mesh: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """(n_sensor, n_band) sum of both errors."""
        return self.step + self.mesh

    def __str__(self) -> str:
        lines = ["sensor      " + "".join(f"{a:>8.0f}-{b:<6.0f}" for a, b in self.bands) + " Hz"]
        for name, step, mesh in zip(self.sensors, self.step, self.mesh):
            lines.append(f"{name:<12}" + "".join(f"{100 * s:>6.2f}+{100 * m:<6.2f}% " for s, m in zip(step, mesh)))
        return "\n".join(lines)


@dataclass(frozen=True)
class PassageCase:
    """A passage to be assessed: the arguments of ``simulate_passage``; the noise of the sensors is ignored."""

    track: Track | TurnoutTrack
    vehicle: Vehicle
    speed: float
    sensors: tuple[Sensor, ...]
    options: dict[str, Any]


def numerical_error(case: PassageCase) -> NumericalError:
    """``NumericalError`` of a ``PassageCase``: three runs, the last two with dt/2 and with twice the elements.

    Each run prepares its track again. The finer runs have the same sampling rate: two steps are averaged per sample.

    Parameters
    ----------
    case : PassageCase
        The passage.

    Returns
    -------
    NumericalError
        Errors by step and by mesh of the run as given.
    """
    options = _without_prepared(case.options)
    rate, substeps = options.get("rate", 20e3), options.pop("substeps", 1)
    options["rate"] = rate
    sensors = _without_instruments(case.sensors)

    def samples(track: Track | TurnoutTrack, substeps: int) -> np.ndarray:
        return simulate_passage(track, case.vehicle, case.speed, sensors, **options, substeps=substeps).samples

    base, finer_step = samples(case.track, substeps), samples(case.track, 2 * substeps)
    elements = 2 * _base_track(case.track).elements_per_bay
    finer_mesh = samples(_with_elements(case.track, elements), substeps)
    step, level_step = compare_recordings(base, finer_step, rate)
    mesh, level_mesh = compare_recordings(base, finer_mesh, rate)
    step, mesh = (
        _extrapolate_error(step, STEP_ORDER[options.get("scheme", "radau")]),
        _extrapolate_error(mesh, MESH_ORDER),
    )
    return NumericalError(tuple(BANDS), tuple(s.name for s in sensors), step, mesh, level_step, level_mesh)


def _extrapolate_error(difference: np.ndarray, order: int) -> np.ndarray:
    """Error of the coarser of two runs from their difference; the finer one has half the step."""
    return difference * 2.0**order / (2.0**order - 1.0)


def compare_recordings(coarse: np.ndarray, fine: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Relative waveform difference and level difference [dB] of two (n_sensor, n) recordings in each of ``BANDS``.

    Parameters
    ----------
    coarse : (n_sensor, n_sample) array of float
        Signals of the coarser run.
    fine : (n_sensor, n_sample) array of float
        Signals of the finer run; the longer of the two is cut.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    two (n_sensor, n_band) arrays of float
        Waveform difference relative to ``fine`` and level of ``coarse`` over ``fine`` [dB].
    """
    n = min(coarse.shape[1], fine.shape[1])
    window = np.hanning(n)
    a, b = (np.fft.rfft(window * signal[:, :n]) for signal in (coarse, fine))
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    waveform, level = np.zeros((coarse.shape[0], len(BANDS))), np.zeros((coarse.shape[0], len(BANDS)))
    for k, (low, high) in enumerate(BANDS):
        inside = (frequency >= low) & (frequency < high)
        power = np.sum(np.abs(b[:, inside]) ** 2, axis=1)
        waveform[:, k] = np.sqrt(np.sum(np.abs(a - b)[:, inside] ** 2, axis=1) / power)
        level[:, k] = 10.0 * np.log10(np.sum(np.abs(a[:, inside]) ** 2, axis=1) / power)
    return waveform, level


def end_error(case: PassageCase, extra: float = 30.0) -> np.ndarray:
    """Relative waveform difference to the same track, longer by ``extra`` [m] of its last supports at both ends.

    Parameters
    ----------
    case : PassageCase
        The passage.
    extra : float
        Length added at each end. [m]

    Returns
    -------
    (n_sensor, n_band) array of float
        Difference relative to the longer track; roughness is left out.
    """
    smooth = replace(case.track, roughness_level=None) if isinstance(case.track, TurnoutTrack) else case.track
    options = {name: value for name, value in _without_prepared(case.options).items() if name != "roughness"}
    rate = options.get("rate", 20e3)
    sensors = _without_instruments(case.sensors)
    count = _n_supports_in(_base_track(smooth), extra)
    shifted_options = options | {"terms": tuple(shift_supports(term, count) for term in options.get("terms", ()))}
    base = simulate_passage(smooth, case.vehicle, case.speed, sensors, **options)
    longer = simulate_passage(_lengthen(smooth, extra), case.vehicle, case.speed, sensors, **shifted_options)
    return compare_recordings(base.samples, longer.samples, rate)[0]


def _without_prepared(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options for another track or step: those of the prepared track become terms and scheme."""
    remaining = {name: value for name, value in options.items() if name != "prepared"}
    prepared = options.get("prepared")
    return remaining if prepared is None else remaining | {"terms": prepared.terms, "scheme": prepared.scheme_name}


def _without_instruments(sensors: Iterable[Sensor]) -> tuple[Sensor, ...]:
    """The sensors without noise, clipping, resolution and filter: only the track is compared."""
    return tuple(replace(s, noise=0.0, limit=None, resolution=None, cutoff=None) for s in sensors)


def _base_track(track: Track | TurnoutTrack) -> Track:
    return track.track if isinstance(track, TurnoutTrack) else track


def _with_elements(track: Track | TurnoutTrack, elements: int) -> Track | TurnoutTrack:
    if isinstance(track, TurnoutTrack):
        return track.with_track(elements_per_bay=elements)
    return replace(track, elements_per_bay=elements)


def _lengthen(track: Track | TurnoutTrack, extra: float) -> Track | TurnoutTrack:
    if isinstance(track, TurnoutTrack):
        tracks = {name: _lengthen_track(route_track, extra) for name, route_track in track.tracks.items()}
        return replace(track, track=_lengthen_track(track.track, extra), tracks=tracks)
    return _lengthen_track(track, extra)


def _lengthen_track(track: Track, extra: float) -> Track:
    spacing, count = track.support[1] - track.support[0], _n_supports_in(track, extra)
    added_distance = spacing * np.arange(1, count + 1)
    support = np.concatenate([track.start - added_distance[::-1], track.support, track.end + added_distance])
    values: dict[str, Any] = {name: np.pad(getattr(track, name), count, mode="edge") for name in PER_SUPPORT}
    return replace(track, support=support, section=(), **values)


def _n_supports_in(track: Track, extra: float) -> int:
    """Number of supports of ``extra`` [m] of track."""
    return round(extra / float(track.support[1] - track.support[0]))
