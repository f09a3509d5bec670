"""Fit pads and ballast of a section so that a simulated hammer test has given resonances and damping ratios."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares

from turnout.errors import SimulationError
from turnout.simulate.hammer import Hammer, prepare_hammer, resolve_location, simulate_hammer

if TYPE_CHECKING:
    from collections.abc import Callable

    from turnout.records import Recording
    from turnout.simulate.track import Track
    from turnout.simulate.turnout_track import TurnoutTrack

Modes = Mapping[str, tuple[float, float]]  # band: frequency [Hz], damping ratio
FREE_PARAMETERS = ("pad_stiffness", "pad_damping", "ballast_stiffness", "ballast_damping")
# Relative accuracy of the fit, far better than the printed uncertainties, and the weak prior on the logarithms.
FREQUENCY_SD, DAMPING_SD, PRIOR_SD = 0.002, 0.02, 3.0
BOUNDS = {
    "pad_stiffness": (20e6, 3e9),
    "pad_damping": (0.5e3, 300e3),
    "ballast_stiffness": (5e6, 1e9),
    "ballast_damping": (1e3, 600e3),
}
N_IMPACTS = 2  # of a simulated test
HALF_LENGTH = 20.0  # m of track on both sides of the impacts
MAX_EVALUATIONS = 14  # of the misfit in a fit; each has a gradient by differences
REPEATABLE_HAMMER = Hammer(velocity_spread=0.05, position_spread=0.0)


@dataclass(frozen=True)
class ModeFit:
    """``values`` of the section's parameters [SI]; ``fitted`` and ``targets`` map a band to (frequency, damping)."""

    section: str
    values: dict[str, float]
    targets: Modes
    fitted: Modes
    evaluations: int


def with_section(turnout: TurnoutTrack, label: str, **values: np.ndarray | float) -> TurnoutTrack:
    """The turnout with parameters of the supports of section ``label`` replaced, on every route that has it.

    Parameters
    ----------
    turnout : TurnoutTrack
        The turnout.
    label : str
        Label of the section.
    **values : float
        Value of each parameter for all supports of the section [SI], by its name in ``Track``.

    Returns
    -------
    TurnoutTrack
        A copy.

    Raises
    ------
    SimulationError
        For a label that no route has.
    """

    def replace_values(track: Track) -> Track:
        inside = np.array([name == label for name in track.section])
        if not inside.any():
            return track
        changed: dict[str, Any] = {k: np.where(inside, v, getattr(track, k)) for k, v in values.items()}
        return replace(track, **changed)

    if not any(label in track.section for track in (turnout.track, *turnout.tracks.values())):
        sections = sorted({*turnout.track.section} - {""})
        raise SimulationError(f"{turnout.name}: no section {label!r}; there are {', '.join(sections) or 'none'}.")
    tracks = {name: replace_values(track) for name, track in turnout.tracks.items()}
    return replace(turnout, track=replace_values(turnout.track), tracks=tracks)


def section_modes(
    turnout: TurnoutTrack,
    location: str | float,
    modes_of: Callable[[tuple[Recording, ...]], Modes],
) -> Modes:
    """Modes of a simulated test at ``location`` by ``modes_of``: band -> (frequency [Hz], damping).

    Parameters
    ----------
    turnout : TurnoutTrack
        The turnout.
    location : str or float
        Position of the impacts [m], or the name of a location.
    modes_of : callable
        Recordings -> modes by band.

    Returns
    -------
    mapping
        Modes by band; bands without a mode are missing.
    """
    prepared = prepare_hammer(turnout, location, half_length=HALF_LENGTH)
    recordings = simulate_hammer(
        turnout, location, REPEATABLE_HAMMER, n_impacts=N_IMPACTS, duration=0.15, prepared=prepared
    )
    return modes_of(recordings)


def fit_modes(
    turnout: TurnoutTrack,
    location: str,
    targets: Modes,
    modes_of: Callable[[tuple[Recording, ...]], Modes],
) -> ModeFit:
    """``ModeFit`` of one section; the rest of the turnout does not change.

    Parameters
    ----------
    turnout : TurnoutTrack
        Its values are the start of the fit.
    location : str
        Named location of the hammer test. The section of this name is changed.
    targets : dict
        "ballast" and, where known, "railpad" -> (frequency [Hz], damping ratio).
    modes_of : callable
        Recordings -> a dict like ``targets``; bands without a mode are missing.

    Returns
    -------
    ModeFit
        Fitted values, and the modes that the model has with them.
    """
    position, track = resolve_location(turnout, location)
    j = track.nearest_support(position)
    start = np.log([getattr(track, name)[j] for name in FREE_PARAMETERS])
    low, high = (np.log([BOUNDS[name][k] for name in FREE_PARAMETERS]) for k in (0, 1))

    def residual(logs: np.ndarray) -> np.ndarray:
        modes = section_modes(
            with_section(turnout, location, **dict(zip(FREE_PARAMETERS, np.exp(logs)))), location, modes_of
        )
        misfit = []
        for band, (frequency, damping) in targets.items():
            f, zeta = modes.get(band, (3.0 * frequency, 3.0 * damping))
            misfit += [np.log(f / frequency) / FREQUENCY_SD, np.log(zeta / damping) / DAMPING_SD]
        return np.concatenate([misfit, (logs - start) / PRIOR_SD])

    inside = np.clip(start, low + 1e-3, high - 1e-3)
    solution = least_squares(residual, inside, diff_step=0.01, bounds=(low, high), max_nfev=MAX_EVALUATIONS)
    values = dict(zip(FREE_PARAMETERS, (float(v) for v in np.exp(solution.x))))
    modes = section_modes(with_section(turnout, location, **values), location, modes_of)
    return ModeFit(location, values, targets, modes, int(solution.nfev))
