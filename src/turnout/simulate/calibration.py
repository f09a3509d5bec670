"""Fit pads, ballast and damping of a section to measured receptances, and report what the data do not determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from turnout.errors import SimulationError
from turnout.simulate.frequency_response import receptance_gradient
from turnout.simulate.hammer import resolve_location
from turnout.simulate.matrices import assemble
from turnout.simulate.modal_calibration import with_section
from turnout.simulate.turnout_track import TurnoutTrack, stretch_of_track
from turnout.units import PARAMETER_UNITS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

# Parameter -> (tag of the links, quantity of the links, relative sd of the prior, an estimate).
PARAMETERS = {
    "pad_stiffness": ("pad", "stiffness", 0.7),
    "pad_damping": ("pad", "damping", 1.0),
    "ballast_stiffness": ("ballast", "stiffness", 0.7),
    "ballast_damping": ("ballast", "damping", 1.0),
    "sleeper_mass": ("sleeper", "mass", 0.15),
}
PRINTED_UNITS = {
    "pad_stiffness": "MN/m",
    "pad_damping": "kN s/m",
    "ballast_stiffness": "MN/m",
    "ballast_damping": "kN s/m",
    "sleeper_mass": "kg",
}
BANDS = ((40.0, 100.0), (100.0, 200.0), (200.0, 400.0), (400.0, 600.0), (600.0, 800.0))
MAX_SD_RATIO = 0.5  # posterior sd over prior sd below which the data determine a parameter
MIN_CORRELATION = 0.95  # posterior correlation above which two parameters are determined only together
ERROR_BANDWIDTH = 1.0  # octaves over which the model error is the same


@dataclass(frozen=True)
class MeasuredReceptance:
    """A measured receptance: ``value`` (n,) complex [m/N] at ``frequency`` [Hz].

    It is from an impact at ``excited`` [m] to an accelerometer at ``measured`` [m]. ``sd`` (n,) is the standard
    deviation of the real and of the imaginary part [m/N].
    """

    frequency: np.ndarray
    value: np.ndarray
    sd: np.ndarray
    excited: float
    measured: float


MAX_CHI_SQUARED = 4.0  # chi-squared per degree of freedom: the residual is at most twice the errors of test and model


@dataclass(frozen=True)
class Calibration:
    """``values`` and ``sd`` (posterior, relative) by parameter; ``covariance`` of their logarithms, in order.

    ``informed`` says of each parameter whether the data reduced the sd of its prior to less than half. ``correlated``
    are the pairs whose posterior correlation exceeds 0.95. ``misfit`` maps a band to the relative rms misfit,
    ``misfit_before`` to that before the fit. ``reduced`` is chi-squared per degree of freedom.
    """

    section: str
    values: dict[str, float]
    sd: dict[str, float]
    covariance: np.ndarray
    informed: dict[str, bool]
    correlated: tuple[tuple[str, str], ...]
    misfit: dict[tuple[float, float], float]
    misfit_before: dict[tuple[float, float], float]
    reduced: float
    n: int
    turnout: TurnoutTrack

    @property
    def is_adequate(self) -> bool:
        """Whether the model with these values fits the tests."""
        return self.reduced <= MAX_CHI_SQUARED

    def is_determined(self, name: str) -> bool:
        """Whether the tests determine a parameter, alone or together with another one.

        Parameters
        ----------
        name : str
            Key of ``PARAMETERS``.

        Returns
        -------
        bool
            True also if only a combination with another parameter is determined.
        """
        return self.informed[name] or any(name in pair for pair in self.correlated)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per parameter: value with its relative standard deviation, and how well the section fits."""
        return [
            {
                "section": self.section, "parameter": name, "unit": PRINTED_UNITS[name],
                "value": float(value) / PARAMETER_UNITS[PRINTED_UNITS[name]][1], "relative_sd": float(self.sd[name]),
                "is_determined": self.is_determined(name), "chi_squared_reduced": float(self.reduced),
                "is_adequate": self.is_adequate, "n": self.n,
            }
            for name, value in self.values.items()
        ]  # fmt: skip

    def __str__(self) -> str:
        criterion = f"about 1: met within the errors; above {MAX_CHI_SQUARED:.0f}: not met"
        lines = [
            f"{self.section}: {self.n} numbers, chi-squared per degree of freedom {self.reduced:.2f} ({criterion})"
        ]
        for name, value in self.values.items():
            remark = (
                "" if self.informed[name] else "   hardly determined by these tests: about what the track file says"
            )
            unit = PRINTED_UNITS[name]
            size = value / PARAMETER_UNITS[unit][1]
            lines.append(f"  {name:<18} {size:12.5g} {unit:<8} ± {100 * self.sd[name]:.1f} %{remark}")
        lines.append("  ± is one standard deviation")
        lines += [f"  {a} and {b} are determined only together" for a, b in self.correlated]
        for (low, high), after in self.misfit.items():
            before = self.misfit_before[low, high]
            lines.append(f"  {low:.0f}-{high:.0f} Hz: misfit {100 * before:.1f} % before, {100 * after:.1f} % after")
        if not self.is_adequate:
            lines.append("  The track's model does not meet this test: neither values nor ± mean anything.")
        return "\n".join(lines)


def calibrate(
    turnout: TurnoutTrack,
    section: str,
    measured: Sequence[MeasuredReceptance],
    location: str | float | None = None,
    parameters: Sequence[str] = tuple(PARAMETERS),
    model_sd: float = 0.03,
    half_length: float = 24.0,
) -> Calibration:
    r"""Maximum a posteriori fit of the parameters of one section to receptances; all its supports are equal.

    .. math:: \min_q \sum_i \frac{|H_i(q) - \hat H_i|^2}{\sigma_i^2 + n_i (\epsilon |\hat H_i|)^2}
              + \sum_p \Bigl(\frac{\ln q_p - \ln q_{p0}}{s_p}\Bigr)^2

    Parameters
    ----------
    turnout : TurnoutTrack
        Its values are the centre of the priors and the start of the fit.
    section : str
        Section whose supports are changed.
    measured : sequence of MeasuredReceptance
        At least one.
    location : str or float
        Middle of the stretch that is modelled; by default the section's name.
    parameters : sequence of str
        Keys of ``PARAMETERS``.
    model_sd : float
        Relative error ε of the model. It is smooth in frequency: the :math:`n_i` lines within
        ``ERROR_BANDWIDTH`` octaves of a line share one error. So thousands of lines do not give certainty.
    half_length : float
        Half length of the stretch of track that is modelled. [m]

    Returns
    -------
    Calibration
        Gauss-Newton covariance at the optimum, in logarithms.

    Raises
    ------
    SimulationError
        Without a receptance, for a parameter that is not in ``PARAMETERS`` and for an unknown section or location.

    References
    ----------
    Gradient: dH/dp = -u_m^T (dZ/dp) u_e with the symmetric dynamic stiffness Z.
    """
    if not measured:
        raise SimulationError(f"calibration of {section!r}: no receptance given.")
    if unknown := [name for name in parameters if name not in PARAMETERS]:
        raise SimulationError(f"calibration cannot fit {unknown[0]!r}; it can fit {', '.join(PARAMETERS)}.")
    position, track = resolve_location(turnout, location if location is not None else section)
    j = track.nearest_support(position)
    centre = np.log([max(getattr(track, name)[j], 1.0) for name in parameters])
    spread = np.array([PARAMETERS[name][2] for name in parameters])

    def model(logs: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        changed = with_section(turnout, section, **dict(zip(parameters, np.exp(logs))))
        _, base = resolve_location(changed, location if location is not None else section)
        return _model_receptances(stretch_of_track(base, position, half_length), section, parameters, measured)

    residual = _residual(model, measured, model_sd, centre, spread)
    solution = least_squares(
        lambda q: residual(q)[0], centre, jac=lambda q: residual(q)[1], method="trf", x_scale=spread
    )
    before, after = ([h for h, _ in model(q)] for q in (centre, solution.x))
    n = sum(2 * m.value.size for m in measured)
    reduced = _chi_squared(measured, after, model_sd) / max(1, n - len(parameters))
    covariance = np.linalg.inv(solution.jac.T @ solution.jac) * max(1.0, reduced)
    sd = np.sqrt(np.diag(covariance))
    values = dict(zip(parameters, (float(v) for v in np.exp(solution.x))))
    return Calibration(
        section,
        values,
        dict(zip(parameters, (float(s) for s in sd))),
        covariance,
        {name: bool(s < MAX_SD_RATIO * p) for name, s, p in zip(parameters, sd, spread)},
        _correlated_pairs(parameters, covariance / np.outer(sd, sd)),
        _misfit(measured, after),
        _misfit(measured, before),
        reduced,
        n,
        with_section(turnout, section, **values),
    )


def _residual(
    model: Callable[[np.ndarray], list[tuple[np.ndarray, np.ndarray]]],
    measured: Sequence[MeasuredReceptance],
    model_sd: float,
    centre: np.ndarray,
    spread: np.ndarray,
) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Function of the logarithms: residuals in standard errors, those of the prior last, and the Jacobian."""
    weights = [
        1.0 / np.sqrt(m.sd**2 + _n_correlated_lines(m.frequency) * (model_sd * np.abs(m.value)) ** 2) for m in measured
    ]
    cache: dict[bytes, tuple] = {}

    def residual(logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = logs.tobytes()
        if key not in cache:
            cache.clear()
            modelled = model(logs)
            misfit = [w * (h - m.value) for w, (h, _), m in zip(weights, modelled, measured)]
            slope = [w[:, None] * g for w, (_, g) in zip(weights, modelled)]
            r = np.concatenate([_stack_real_imag(m) for m in misfit])
            jacobian = np.concatenate([_stack_real_imag(s) for s in slope])
            cache[key] = (
                np.concatenate([r, (logs - centre) / spread]),
                np.concatenate([jacobian, np.diag(1.0 / spread)]),
            )
        return cache[key]

    return residual


def _chi_squared(measured: Sequence[MeasuredReceptance], modelled: Sequence[np.ndarray], model_sd: float) -> float:
    """Sum of squared residuals in standard errors of each line alone."""
    return float(
        sum(
            np.sum(np.abs(h - m.value) ** 2 / (m.sd**2 + (model_sd * np.abs(m.value)) ** 2))
            for m, h in zip(measured, modelled)
        )
    )


def _n_correlated_lines(frequency: np.ndarray) -> np.ndarray:
    """(n,) number of lines that share the model error with each line, including itself."""
    octaves = np.log2(frequency)
    return np.sum(np.abs(octaves[:, None] - octaves) <= ERROR_BANDWIDTH / 2.0, axis=1)


def _correlated_pairs(parameters: Sequence[str], correlation: np.ndarray) -> tuple[tuple[str, str], ...]:
    """Pairs of parameters that the data do not separate."""
    return tuple(
        (parameters[a], parameters[b])
        for a in range(len(parameters))
        for b in range(a)
        if abs(correlation[a, b]) > MIN_CORRELATION
    )


def _stack_real_imag(value: np.ndarray) -> np.ndarray:
    return np.concatenate([value.real, value.imag])


def _model_receptances(
    track: Track, section: str, parameters: Sequence[str], measured: Sequence[MeasuredReceptance]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Modelled receptance and its derivatives by the logarithm of each parameter, for each measured receptance."""
    matrices = assemble(track)
    inside = {j for j, name in enumerate(track.section) if name == section}
    groups, values = [], []
    for name in parameters:
        tag, quantity, _ = PARAMETERS[name]
        links = [link for link in matrices.links if link.tag == tag and _support_of(link) in inside]
        groups.append((quantity, links))
        values.append(getattr(links[0], quantity) if links else 0.0)
    modelled = []
    for m in measured:
        h, gradient = receptance_gradient(matrices, m.frequency, m.excited, m.measured, groups)
        modelled.append((h, gradient * np.array(values)))
    return modelled


def _support_of(link: Link) -> int:
    return next(name[1] for name, _ in link.ends if name[0] != "rail") if len(link.ends) > 1 else link.ends[0][0][1]


def _misfit(measured: Sequence[MeasuredReceptance], modelled: Sequence[np.ndarray]) -> dict[tuple[float, float], float]:
    """Relative rms misfit in each band that has lines."""
    table = {}
    for low, high in BANDS:
        error = size = 0.0
        for m, h in zip(measured, modelled):
            inside = (m.frequency >= low) & (m.frequency < high)
            error += np.sum(np.abs(h - m.value)[inside] ** 2)
            size += np.sum(np.abs(m.value[inside]) ** 2)
        if size:
            table[low, high] = float(np.sqrt(error / size))
    return table
