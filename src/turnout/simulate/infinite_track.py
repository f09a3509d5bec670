"""Closed forms of infinite tracks: beam on a Winkler foundation, and Floquet's solution on discrete supports."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm

from turnout.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.rail import Rail
    from turnout.simulate.track import Track


def winkler_receptance(
    frequency: np.ndarray | Sequence[float],
    bending_stiffness: float,
    mass: float,
    stiffness: float,
    damping: float = 0.0,
) -> np.ndarray:
    r"""Point receptance of an infinite Euler-Bernoulli beam on an elastic foundation [m/N].

    .. math:: H = \frac{1}{8 EI \beta^3}, \qquad \beta = \Bigl(\frac{k + i\omega c - m\omega^2}{4 EI}\Bigr)^{1/4}

    Parameters
    ----------
    frequency : (n,) array of float
        [Hz]
    bending_stiffness, mass, stiffness, damping : float
        EI [N m²], m [kg/m], k [N/m²], c [N s/m²].

    Returns
    -------
    (n,) array of complex
        Receptance. [m/N]

    References
    ----------
    Knothe and Grassie 1993, Vehicle System Dynamics 22, section 4.

    Examples
    --------
    The static deflection under a unit load, 1 / (2 sqrt(2) (EI)^(1/4) k^(3/4)):

    >>> h = winkler_receptance([0.0], 6.42e6, 60.21, 1e8)
    >>> f"{abs(h[0]):.4e} m/N, {1 / (2 * 2**0.5 * 6.42e6**0.25 * 1e8**0.75):.4e} m/N"
    '7.0238e-09 m/N, 7.0238e-09 m/N'
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
    net = stiffness + 1j * omega * damping - mass * omega**2
    beta = (net / (4.0 * bending_stiffness)) ** 0.25  # principal root: Re > 0, waves run outwards and decay
    return 1.0 / (8.0 * bending_stiffness * beta**3)


def support_stiffness(frequency: np.ndarray | Sequence[float], track: Track) -> np.ndarray:
    """(n,) complex dynamic stiffness under the rail of the first support of ``track`` [N/m].

    Parameters
    ----------
    frequency : (n,) array of float
        Frequencies. [Hz]
    track : Track
        The track.

    Returns
    -------
    (n,) array of complex
        Force per displacement of the rail at the support. [N/m]
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)

    def spring(name: str) -> np.ndarray:
        k, c = getattr(track, f"{name}_stiffness")[0], getattr(track, f"{name}_damping")[0]
        loss = getattr(track, f"{name}_loss_factor")[0] if name != "subgrade" else 0.0
        return k * (1.0 + 1j * loss) + 1j * omega * c

    pad = spring("pad")
    if track.layers == 1:
        return pad
    below = spring("ballast")
    if track.layers == 3:
        ground = spring("subgrade") - omega**2 * track.ballast_mass[0]
        below = below * ground / (below + ground)
    below = below - omega**2 * track.sleeper_mass[0]
    return pad * below / (pad + below)


def _beam_matrix(omega: float, rail: Rail) -> np.ndarray:
    """First-order system of the rail's state (w, rotation, moment, shear) along x."""
    shear = 0.0 if rail.beam == "euler" else 1.0 / rail.shear_stiffness
    rotary = 0.0 if rail.beam == "euler" else rail.rotary_inertia
    spin = -(omega**2) * rotary + 1j * omega * rail.damping / rail.mass * rotary
    push = -(omega**2) * rail.mass + 1j * omega * rail.damping
    return np.array([[0, 1, 0, shear], [0, 0, 1 / rail.bending_stiffness, 0], [0, spin, 0, -1], [push, 0, 0, 0]])


def _bay_transfer(omega: float, rail: Rail, spacing: float, support: complex) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers and vectors of the transfer from one support to the next, the decaying ones first."""
    across = expm(_beam_matrix(omega, rail) * spacing)
    jump = np.eye(4, dtype=complex)
    jump[3, 0] = support
    multiplier, vector = np.linalg.eig(jump @ across)
    order = np.argsort(np.abs(multiplier))
    return multiplier[order], vector[:, order]


def floquet_receptance(
    frequency: np.ndarray | Sequence[float], track: Track, offset: float = 0.0, distance: int = 0
) -> np.ndarray:
    """Receptance of the infinite periodic track of which ``track`` has one bay [m/N], (n,).

    Parameters
    ----------
    frequency : (n,) array of float
        Above 0; the track must have damping. [Hz]
    track : Track
        Its rail, first support and spacing are used.
    offset : float
        Distance of the force from the support before it [m], from 0 to below the spacing.
    distance : int
        Bays from the force to the response, which is at the same offset in its bay.

    Returns
    -------
    (n,) array of complex
        Receptance. [m/N]

    Raises
    ------
    SimulationError
        For an offset outside the bay.

    References
    ----------
    Mead 1970, Free wave propagation in periodically supported, infinite beams, J. Sound Vib. 11; Nordborg 2002.
    """
    spacing = float(track.support[1] - track.support[0])
    if not 0.0 <= offset < spacing:
        raise SimulationError(f"offset {offset!r} m is not within a bay of {spacing:.3f} m.")
    stiffness = support_stiffness(frequency, track)
    receptance = np.empty(len(frequency), dtype=complex)
    for line, f in enumerate(np.asarray(frequency, dtype=float)):
        omega = 2.0 * np.pi * f
        multiplier, vector = _bay_transfer(omega, track.rail, spacing, stiffness[line])
        to_force = expm(_beam_matrix(omega, track.rail) * offset)
        right_waves, left_waves = to_force @ vector[:, :2], to_force @ vector[:, 2:]
        amount = np.linalg.solve(np.column_stack([right_waves, -left_waves]), [0.0, 0.0, 0.0, -1.0])
        receptance[line] = right_waves[0] @ (amount[:2] * multiplier[:2] ** distance)
    return receptance


def propagation(frequency: np.ndarray | Sequence[float], track: Track) -> np.ndarray:
    r"""Wavenumbers of the two waves that propagate away from a force on the infinite periodic track.

    Floquet's multiplier of a bay is :math:`e^{-i\kappa L}`. The real part of κ is in the first Brillouin zone; the
    decay is -8.686 Im κ [dB/m].

    Parameters
    ----------
    frequency : (n,) array of float
        Above 0; the track must have damping. [Hz]
    track : Track
        Its rail, first support and spacing are used.

    Returns
    -------
    (n, 2) array of complex
        Wavenumber κ of both waves, the less damped one first. [rad/m]
    """
    spacing = float(track.support[1] - track.support[0])
    stiffness = support_stiffness(frequency, track)
    wavenumber = np.empty((len(frequency), 2), dtype=complex)
    for line, f in enumerate(np.asarray(frequency, dtype=float)):
        multiplier, _ = _bay_transfer(2.0 * np.pi * f, track.rail, spacing, stiffness[line])
        wavenumber[line] = 1j * np.log(multiplier[[1, 0]]) / spacing
    return wavenumber
