"""Force laws of ports: a scalar force from a scalar deformation and its rate."""

from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.number_checks import check_number

POWER, GAP, TABLE, LINEAR, FRICTION, LIFT = range(6)


@dataclass(frozen=True)
class PowerLaw:
    r"""Unilateral :math:`F = k d^p (1 + \chi \dot d)`, 0 where d <= 0: Hertz's contact (p = 3/2), a hammer's tip.

    ``stiffness`` k [N/m^p], ``exponent`` p, ``damping`` χ of Hunt and Crossley 1975 [s/m]; never negative.

    >>> hertz = PowerLaw(93e9)
    >>> f"{hertz.force(66.1e-6, 0.0) / 1e3:.1f} kN at an approach of 66.1 µm"
    '50.0 kN at an approach of 66.1 µm'
    """

    stiffness: float
    exponent: float = 1.5
    damping: float = 0.0
    law_code = POWER

    def __post_init__(self) -> None:
        if not (
            np.all(np.isfinite(self.numbers)) and self.stiffness > 0.0 and self.exponent >= 1.0 and self.damping >= 0.0
        ):
            raise SimulationError(
                f"power law: stiffness {self.stiffness!r}, exponent {self.exponent!r}, "
                f"damping {self.damping!r} are not those of a contact."
            )

    @property
    def numbers(self) -> tuple[float, float, float]:
        """The three numbers of the law in the order in which the compiled march takes them."""
        return self.stiffness, self.exponent, self.damping

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Force [N] at deformation ``d`` [m] and ``rate`` [m/s].

        Parameters
        ----------
        d : float or (...) array
            Deformation, pressing positive. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force, never negative. [N]
        """
        d = np.maximum(d, 0.0)
        return np.maximum(0.0, self.stiffness * d**self.exponent * (1.0 + self.damping * rate))

    def tangent(self, load: float) -> float:
        r"""Stiffness at a static ``load`` W, :math:`p\,k^{1/p} W^{1-1/p}` [N/m].

        Parameters
        ----------
        load : float
            Static load. [N]

        Returns
        -------
        float
            Stiffness. [N/m]
        """
        return self.exponent * self.stiffness ** (1 / self.exponent) * load ** (1 - 1 / self.exponent)

    def approach(self, load: float) -> float:
        """Deformation under a static load [m].

        Parameters
        ----------
        load : float
            Static load. [N]

        Returns
        -------
        float
            Deformation. [m]
        """
        return (load / self.stiffness) ** (1 / self.exponent)


@dataclass(frozen=True)
class GapLaw:
    r"""Support that cannot pull: :math:`R = \max(0, k d + c\dot d \min(1, d/d_r))`, 0 where d <= 0."""

    stiffness: float
    damping: float = 0.0
    onset: float = 1e-5
    law_code = GAP

    def __post_init__(self) -> None:
        check_number("gap law: stiffness", self.stiffness, "N/m", least=0.0)
        check_number("gap law: damping", self.damping, "N s/m", least=0.0)
        check_number("gap law: onset", self.onset, "m", above=0.0)

    @property
    def numbers(self) -> tuple[float, float, float]:
        """The three numbers of the law in the order in which the compiled march takes them."""
        return self.stiffness, self.damping, self.onset

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Force of the support.

        Parameters
        ----------
        d : float or (...) array
            Deformation, pressing positive. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force, never negative. [N]
        """
        d = np.asarray(d, dtype=float)
        onset = np.clip(d / self.onset, 0.0, 1.0)
        return np.where(d > 0.0, np.maximum(0.0, self.stiffness * d + self.damping * rate * onset), 0.0)


@dataclass(frozen=True)
class TableLaw:
    r"""Any law :math:`F = \varphi(d) + \psi(d)\,\dot d` with φ and ψ piecewise linear in ``deformation``.

    ``deformation`` increasing (n,) [m], ``elastic`` φ [N], ``viscous`` ψ [N s/m]. Outside, φ continues with the slope
    of its last piece and ψ is constant.
    """

    deformation: tuple
    elastic: tuple
    viscous: tuple
    law_code = TABLE
    numbers = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if len(self.deformation) < 2 or np.any(np.diff(self.deformation) <= 0.0):
            raise SimulationError(f"table law: deformations must rise, got {self.deformation!r}.")
        if not len(self.deformation) == len(self.elastic) == len(self.viscous):
            raise SimulationError("table law: deformation, elastic and viscous differ in length.")
        if not all(np.all(np.isfinite(column)) for column in (self.deformation, self.elastic, self.viscous)):
            raise SimulationError(f"table law: not all values are numbers, got {self.elastic!r} and {self.viscous!r}.")

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Force interpolated in the table.

        Parameters
        ----------
        d : float or (...) array
            Deformation, pressing positive. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force. [N]
        """
        x, f = np.asarray(self.deformation), np.asarray(self.elastic)
        d = np.asarray(d, dtype=float)
        k = np.clip(np.searchsorted(x, d, side="right") - 1, 0, x.size - 2)
        elastic = f[k] + (f[k + 1] - f[k]) / (x[k + 1] - x[k]) * (d - x[k])
        return elastic + np.interp(d, x, self.viscous) * rate


@dataclass(frozen=True)
class LinearLaw:
    r""":math:`F = W + k d + c \dot d` in both directions: a linearised contact about a static load W."""

    stiffness: float
    damping: float = 0.0
    preload: float = 0.0
    law_code = LINEAR

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "preload"):
            check_number(f"linear law: {name}", getattr(self, name))

    @property
    def numbers(self) -> tuple[float, float, float]:
        """The three numbers of the law in the order in which the compiled march takes them."""
        return self.stiffness, self.damping, self.preload

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Force of spring, damper and static load.

        Parameters
        ----------
        d : float or (...) array
            Deformation, pressing positive. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force, including the static load. [N]
        """
        return self.preload + self.stiffness * np.asarray(d) + self.damping * np.asarray(rate)


@dataclass(frozen=True)
class FrictionLaw:
    r"""Dry friction smoothed over a slip rate: :math:`F = F_0 \tanh(\dot d / v_0)`."""

    limit: float
    slip_rate: float = 1e-3
    law_code = FRICTION

    def __post_init__(self) -> None:
        check_number("friction law: limit", self.limit, "N", least=0.0)
        check_number("friction law: slip_rate", self.slip_rate, "m/s", above=0.0)

    @property
    def numbers(self) -> tuple[float, float, float]:
        """The three numbers of the law in the order in which the compiled march takes them."""
        return self.limit, self.slip_rate, 0.0

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Friction force.

        Parameters
        ----------
        d : float or (...) array
            Only its shape matters. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force against the motion, at most ``limit``. [N]
        """
        return self.limit * np.tanh(np.asarray(rate) / self.slip_rate) + 0.0 * np.asarray(d)


@dataclass(frozen=True)
class LiftLaw:
    r"""Tensile force of a spring and damper under a ``load`` W, :math:`F = \max(0, -(W + k d + c\dot d))`.

    Together with that spring and damper it gives :math:`\max(0, W + k d + c\dot d) - W`: contact without tension.
    """

    stiffness: float
    damping: float
    load: float
    law_code = LIFT

    def __post_init__(self) -> None:
        check_number("lift law: stiffness", self.stiffness, "N/m", least=0.0)
        check_number("lift law: damping", self.damping, "N s/m", least=0.0)
        check_number("lift law: load", self.load, "N")

    @property
    def numbers(self) -> tuple[float, float, float]:
        """The three numbers of the law in the order in which the compiled march takes them."""
        return self.stiffness, self.damping, self.load

    def force(self, d: float | np.ndarray, rate: float | np.ndarray = 0.0) -> np.ndarray:
        """Tensile force that the lifted support does not transmit.

        Parameters
        ----------
        d : float or (...) array
            Deformation from the static state, pressing positive. [m]
        rate : float or (...) array
            Rate of deformation. [m/s]

        Returns
        -------
        (...) array
            Force, 0 while the support presses. [N]
        """
        return np.maximum(0.0, -(self.load + self.stiffness * np.asarray(d) + self.damping * np.asarray(rate)))


ForceLaw = PowerLaw | GapLaw | TableLaw | LinearLaw | FrictionLaw | LiftLaw


@dataclass(frozen=True)
class Port:
    """One scalar force of the track on itself or on the ground, for an effect that linear matrices cannot describe.

    ``ends`` as in ``Link``: the deformation is d = v·u - ``gap`` and the force on the track -v F(d, rate).
    ``label`` names it in errors and outputs. The term removes what it replaces by a link of negative stiffness.
    """

    ends: tuple
    law: ForceLaw
    gap: float = 0.0
    label: str = "port"
