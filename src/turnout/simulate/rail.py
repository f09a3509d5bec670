"""Rail elements as Timoshenko or Euler-Bernoulli beams: matrices, shape functions, compliance within an element."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.number_checks import check_number

if TYPE_CHECKING:
    from collections.abc import Sequence

GAUSS_POINT, GAUSS_WEIGHT = (0.5 * v for v in np.polynomial.legendre.leggauss(6))
GAUSS_POINT = GAUSS_POINT + 0.5


@dataclass(frozen=True)
class Rail:
    """One rail profile; ``beam`` is "timoshenko" or "euler", ``mass_matrix`` "consistent" or "corrected".

    ``bending_stiffness`` EI [N m²], ``mass`` per length [kg/m], ``shear_stiffness`` κGA [N],
    ``rotary_inertia`` ρI [kg m], ``damping`` to ground per length [N s/m²].

    >>> Rail(6.42e6, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5).shear_ratio(0.15).round(3)
    np.float64(13.778)
    """

    bending_stiffness: float
    mass: float
    shear_stiffness: float
    rotary_inertia: float = 0.0
    damping: float = 0.0
    beam: str = "timoshenko"
    mass_matrix: str = "consistent"

    def __post_init__(self) -> None:
        if self.beam not in ("timoshenko", "euler"):
            raise SimulationError(f"rail: beam {self.beam!r} is neither 'timoshenko' nor 'euler'.")
        if self.mass_matrix not in ("consistent", "corrected"):
            raise SimulationError(f"rail: mass_matrix {self.mass_matrix!r} is neither 'consistent' nor 'corrected'.")
        for name in ("bending_stiffness", "mass", "shear_stiffness"):
            check_number(f"rail: {name}", getattr(self, name), above=0.0)
        for name in ("rotary_inertia", "damping"):
            check_number(f"rail: {name}", getattr(self, name), least=0.0)

    def shear_ratio(self, length: float | np.ndarray) -> np.ndarray:
        r"""Share of shear in an element, :math:`P = 12 EI / (\kappa G A h^2)`; 0 for Euler-Bernoulli.

        Parameters
        ----------
        length : float or (...) array
            Length of the element. [m]

        Returns
        -------
        (...) array
            Shear ratio P. [-]
        """
        if self.beam == "euler":
            return 0.0 * np.asarray(length, dtype=float)
        return 12.0 * self.bending_stiffness / (self.shear_stiffness * np.asarray(length, dtype=float) ** 2)

    def pinned_pinned_frequency(self, bay: float) -> float:
        r"""Frequency at which half a wave of the rail fits between two sleepers, its nodes on both.

        The lower root of :math:`m \rho I \omega^4 - (m (S + EI k^2) + \rho I S k^2) \omega^2 + S\,EI k^4 = 0` with
        :math:`S = \kappa G A,\ k = \pi / L` (Timoshenko 1921, eq. 5); without shear :math:`EI k^4 / (m + \rho I k^2)`.

        Parameters
        ----------
        bay : float
            Distance L of the sleepers. [m]

        Returns
        -------
        float
            Frequency. [Hz]

        Examples
        --------
        >>> round(Rail(6.42e6, 60.21, 2.485e8, 0.24).pinned_pinned_frequency(0.6))
        1070
        """
        wave_number = np.pi / bay
        bending = self.bending_stiffness * wave_number**2
        if self.beam == "euler":
            squared = bending * wave_number**2 / (self.mass + self.rotary_inertia * wave_number**2)
        else:
            shear = self.shear_stiffness
            linear = self.mass * (shear + bending) + self.rotary_inertia * shear * wave_number**2
            product = self.mass * self.rotary_inertia * shear * bending * wave_number**2
            squared = 2.0 * shear * bending * wave_number**2 / (linear + np.sqrt(linear**2 - 4.0 * product))
        return float(np.sqrt(squared) / (2.0 * np.pi))


def in_series(rails: Sequence[Rail], shares: Sequence[float] | np.ndarray) -> Rail:
    r"""One profile for an element with several ``rails`` in a row, each over its share of the length.

    Flexibilities and masses add up: :math:`1/EI = \sum p_k / EI_k`, the same for shear, :math:`m = \sum p_k m_k`.
    Rotation under a moment, shear deflection under a force and mass are exact.

    Parameters
    ----------
    rails : sequence of Rail
        Profiles in a row.
    shares : sequence of float
        Share of each in the length; their sum is 1.

    Returns
    -------
    Rail
        Euler-Bernoulli only if all rails are.

    Examples
    --------
    >>> soft, stiff = Rail(4e6, 50.0, 2e8), Rail(12e6, 150.0, 6e8)
    >>> half = in_series((soft, stiff), (0.5, 0.5))
    >>> round(half.bending_stiffness), half.mass
    (6000000, 100.0)
    """

    def mean(name: str) -> float:
        return sum(p * getattr(r, name) for r, p in zip(rails, shares))

    shear_compliance = sum(p / r.shear_stiffness for r, p in zip(rails, shares) if r.beam != "euler")
    return Rail(
        bending_stiffness=1.0 / sum(p / r.bending_stiffness for r, p in zip(rails, shares)),
        mass=mean("mass"),
        shear_stiffness=1.0 / shear_compliance if shear_compliance else mean("shear_stiffness"),
        rotary_inertia=mean("rotary_inertia"),
        damping=mean("damping"),
        beam="timoshenko" if shear_compliance else "euler",
        mass_matrix=rails[0].mass_matrix,
    )


def shape_functions(s: float | np.ndarray, length: float | np.ndarray, shear_ratio: float | np.ndarray) -> np.ndarray:
    r"""Deflection of the rail at ``s`` in 0..1 of an element from its nodes' deflections and rotations.

    .. math:: N = \frac{1}{1+P}\,[1-3s^2+2s^3+P(1-s),\; h(s-2s^2+s^3+P(s-s^2)/2),\; \ldots]

    Parameters
    ----------
    s : float or (...,) array of float
        Position in the element as a share of its length.
    length : float or (...) array
        Length h of the element, broadcast against ``s``. [m]
    shear_ratio : float or (...) array
        Shear ratio P, broadcast against ``s``. [-]

    Returns
    -------
    (..., 4) array of float
        Weights of deflection, rotation [m/rad], deflection and rotation [m/rad] of the two nodes.

    References
    ----------
    The exact static solution of Timoshenko's beam: Przemieniecki 1968, ch. 11.

    Examples
    --------
    >>> shape_functions(0.25, 0.6, 0.0).round(4)
    array([ 0.8438,  0.0844,  0.1562, -0.0281])
    """
    h, p = length, shear_ratio
    n = np.empty((*np.broadcast(s, h, p).shape, 4))  # one position at a time is frequent: arrays of one number are slow
    n[..., 0] = 1.0 - 3.0 * s**2 + 2.0 * s**3 + p * (1.0 - s)
    n[..., 1] = h * (s - 2.0 * s**2 + s**3 + p * (s - s**2) / 2.0)
    n[..., 2] = 3.0 * s**2 - 2.0 * s**3 + p * s
    n[..., 3] = h * (-(s**2) + s**3 - p * (s - s**2) / 2.0)
    return n / np.expand_dims(1.0 + p, -1)


def rotation_functions(
    s: float | np.ndarray, length: float | np.ndarray, shear_ratio: float | np.ndarray
) -> np.ndarray:
    """Rotation of the cross-section at ``s`` from the nodes' values; derivative of N where P = 0.

    Parameters
    ----------
    s : float or (...,) array of float
        Position in the element as a share of its length.
    length : float or (...) array
        Length of the element, broadcast against ``s``. [m]
    shear_ratio : float or (...) array
        Shear ratio P, broadcast against ``s``. [-]

    Returns
    -------
    (..., 4) array of float
        Weights of deflection [rad/m], rotation, deflection [rad/m] and rotation of the two nodes.
    """
    s, h, p = np.broadcast_arrays(np.asarray(s, dtype=float), length, shear_ratio)
    r = np.empty((*s.shape, 4))
    r[..., 0] = 6.0 * (s**2 - s) / h
    r[..., 1] = 1.0 - 4.0 * s + 3.0 * s**2 + p * (1.0 - s)
    r[..., 2] = -r[..., 0]
    r[..., 3] = 3.0 * s**2 - 2.0 * s + p * s
    return r / (1.0 + p)[..., None]


def element_stiffness(rail: Rail, length: float) -> np.ndarray:
    """Stiffness of a rail element for (w, rotation) at both ends, exact in statics.

    Parameters
    ----------
    rail : Rail
        Profile of the rail.
    length : float
        Length of the element. [m]

    Returns
    -------
    (4, 4) array of float
        Deflections and rotations alternate. [N/m, N, N m]
    """
    h, p = length, float(rail.shear_ratio(length))
    k = np.array(
        [
            [12.0, 6.0 * h, -12.0, 6.0 * h],
            [6.0 * h, (4.0 + p) * h**2, -6.0 * h, (2.0 - p) * h**2],
            [-12.0, -6.0 * h, 12.0, -6.0 * h],
            [6.0 * h, (2.0 - p) * h**2, -6.0 * h, (4.0 + p) * h**2],
        ]
    )
    return rail.bending_stiffness / ((1.0 + p) * h**3) * k


def element_mass(rail: Rail, length: float) -> np.ndarray:
    r"""Mass of a rail element: consistent, or corrected for what lies between the nodes of a Timoshenko beam.

    Between the nodes inertia shears the element by what static shape functions lack, an error of order :math:`h^2`:

    .. math:: \omega^4 m^2 h^2 w^2 / 12 \kappa G A \;=\; \omega^2 m h^2\, w' \gamma / 12

    per length, by :math:`\omega^2 m w = -Q'` of the free rail and one integration by parts, with the shear
    :math:`\gamma = P/(1+P)\,[(w_2 - w_1)/h - (\theta_1 + \theta_2)/2]` of the element. The right side is a mass.
    With it waves have an error of order :math:`h^4`, as those of Euler-Bernoulli elements have without it. It adds
    nothing to a rigid motion. For a rod in shear it is the mean of consistent and lumped mass (Goudreau and Taylor
    1972, Computer Methods in Applied Mechanics and Engineering 2).

    Parameters
    ----------
    rail : Rail
        Profile of the rail.
    length : float
        Length of the element. [m]

    Returns
    -------
    (4, 4) array of float
        Deflections and rotations alternate. [kg, kg m, kg m²]
    """
    p = float(rail.shear_ratio(length))
    n = shape_functions(GAUSS_POINT, length, p)
    r = rotation_functions(GAUSS_POINT, length, p)
    inertia = 0.0 if rail.beam == "euler" else rail.rotary_inertia
    weight = length * GAUSS_WEIGHT[:, None, None]
    consistent = (weight * (rail.mass * n[:, :, None] * n[:, None, :] + inertia * r[:, :, None] * r[:, None, :])).sum(0)
    if rail.mass_matrix == "consistent":
        return consistent
    slope = np.array([-1.0, 0.0, 1.0, 0.0])
    shear = p / (1.0 + p) * np.array([-1.0, -0.5 * length, 1.0, -0.5 * length])
    correction = np.outer(slope, shear)
    return consistent + rail.mass * length / 24.0 * (correction + correction.T)


def local_compliance(s1: float | np.ndarray, s2: float | np.ndarray, length: float, rail: Rail) -> np.ndarray:
    r"""Deflection at ``s1`` from a unit force at ``s2`` of one element with both ends clamped [m/N].

    .. math:: l(s,s) = \frac{q h}{\kappa G A}
              + \frac{h^3}{EI}\Bigl[\frac{q^3}{3} + \frac{P q^2 (1-2s)^2}{12(1+P)}\Bigr],\quad q = s(1-s)

    Without it a wheel rolls over nodes that are stiffer than the span between them, which writes a line
    at speed over element length into the contact force. Symmetric in ``s1`` and ``s2``.

    Parameters
    ----------
    s1 : float or (...) array
        Position of the deflection as a share of the length.
    s2 : float or (...) array
        Position of the force as a share of the length.
    length : float
        Length of the element. [m]
    rail : Rail
        Profile of the rail.

    Returns
    -------
    (...) array
        Deflection per force; the shape of ``s1`` and ``s2`` broadcast. [m/N]

    Examples
    --------
    >>> rail = Rail(6.0e6, 60.0, 2.4e8, beam="euler")
    >>> f"{local_compliance(0.5, 0.5, 0.6, rail):.4g} m/N, h^3/(192 EI) = {0.6**3 / (192 * 6.0e6):.4g}"
    '1.875e-10 m/N, h^3/(192 EI) = 1.875e-10'
    """
    low, high = np.minimum(s1, s2), np.maximum(s1, s2)
    bending = low**2 * (1.0 - high) ** 2 * (3.0 * high - low * (1.0 + 2.0 * high)) / 6.0
    if rail.beam == "euler":
        return length**3 / rail.bending_stiffness * bending
    p = rail.shear_ratio(length)
    q1, q2 = s1 * (1.0 - s1), s2 * (1.0 - s2)
    bending = bending + p * q1 * (1.0 - 2.0 * s1) * q2 * (1.0 - 2.0 * s2) / (12.0 * (1.0 + p))
    return length * low * (1.0 - high) / rail.shear_stiffness + length**3 / rail.bending_stiffness * bending
