"""Compare the modes of a section between two tests: the shift, its significance and the smallest detectable shift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.records import ModalModel

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Shift:
    """Change of one parameter of one mode from a first test to a second.

    ``first`` and ``second`` are the means of the two tests. ``difference`` has the standard error ``se`` and the
    interval ``low`` to ``high``. All are in the unit of the parameter (Hz, or 1 for damping). ``probability`` is that
    of a difference as large without any change, and ``n`` are the impacts of both tests. ``detectable`` is the
    smallest shift that a test detects with ``power``. ``detected`` says whether ``probability`` is below ``level``.
    """

    band: str
    parameter: str
    first: float
    second: float
    difference: float
    se: float
    low: float
    high: float
    probability: float
    n: tuple[int, int]
    detectable: float
    power: float
    level: float

    @property
    def detected(self) -> bool:
        """Whether the difference is significant at its level."""
        return self.probability < self.level

    def __str__(self) -> str:
        unit = " Hz" if self.parameter == "frequency" else ""
        verdict = "moved" if self.detected else "no shift found"
        return (
            f"{self.band} {self.parameter}: {verdict}, {self.difference:+.4g} ± {self.se:.2g}{unit}"
            f" (p = {self.probability:.2g}, n = {self.n[0]} and {self.n[1]});"
            f" a shift of {self.detectable:.3g}{unit} would be found in {100 * self.power:.0f} % of tests"
        )


def welch_test(
    first: ArrayLike, second: ArrayLike, level: float = 0.01, power: float = 0.8
) -> tuple[float, float, float, float, float]:
    r"""Welch's t test of two samples, with the smallest shift that it would detect.

    .. math:: t = \frac{m_2 - m_1}{\sqrt{s_1^2/n_1 + s_2^2/n_2}}, \quad
              \nu = \frac{(s_1^2/n_1 + s_2^2/n_2)^2}{(s_1^2/n_1)^2/(n_1-1) + (s_2^2/n_2)^2/(n_2-1)}

    Parameters
    ----------
    first, second : (n,) arrays of float
        At least two values each, else ValueError.
    level, power : float
        Two-sided probability of a false alarm, and probability of detecting a shift of ``detectable``.

    Returns
    -------
    difference, se, freedom, probability, detectable : float

    Raises
    ------
    ValueError
        With less than two values in a sample.

    References
    ----------
    Welch 1947; Satterthwaite 1946.

    Examples
    --------
    Equal variances and sizes: the degrees of freedom of Student's test.

    >>> difference, se, freedom, _, _ = welch_test([1.0, 2.0, 3.0], [2.0, 3.0, 4.0])
    >>> print(f"{difference:.0f} ± {se:.3f}, {freedom:.0f}")
    1 ± 0.816, 4
    """
    first, second = np.asarray(first, float), np.asarray(second, float)
    if min(len(first), len(second)) < 2:
        raise ValueError(f"need two impacts in each test, got {len(first)} and {len(second)}")
    mean_variances = [sample.var(ddof=1) / len(sample) for sample in (first, second)]
    difference, se = float(second.mean() - first.mean()), float(np.sqrt(sum(mean_variances)))
    if se == 0.0:
        return difference, 0.0, np.inf, float(difference == 0.0), 0.0
    freedom = sum(mean_variances) ** 2 / sum(
        p**2 / (len(s) - 1) for p, s in zip(mean_variances, (first, second), strict=True)
    )
    probability = float(2.0 * scipy.stats.t.sf(abs(difference) / se, freedom))
    return difference, se, float(freedom), probability, se * detectable_shift(freedom, level, power)


def detectable_shift(freedom: float, level: float = 0.01, power: float = 0.8) -> float:
    """Shift over its standard error that a two-sided t test detects with ``power``.

    With many impacts it is the sum of two normal quantiles.

    Parameters
    ----------
    freedom : float
        Degrees of freedom of the test, above 0.
    level : float
        Two-sided probability of a false alarm.
    power : float
        Probability of detecting the shift.

    Returns
    -------
    float
        Shift over its standard error.

    Examples
    --------
    >>> print(f"{detectable_shift(1e6):.3f}")
    3.417
    """
    limit = scipy.stats.t.isf(level / 2.0, freedom)
    return float(
        scipy.optimize.brentq(lambda shift: scipy.stats.nct.sf(limit, freedom, shift) - power, 0.0, limit + 40.0)
    )


def compare_tests(
    first: ModalModel,
    second: ModalModel,
    band: str,
    parameter: str = "frequency",
    level: float = 0.01,
    power: float = 0.8,
) -> Shift | None:
    """Shift of ``parameter`` of the mode in ``band`` between two tests.

    The estimates of single impacts are compared, not the fit percentages: these hardly change with the parameter.

    Parameters
    ----------
    first : ModalModel
        Model of the first test.
    second : ModalModel
        Model of the second test.
    band : str
        Band of the mode.
    parameter : str
        "frequency" [Hz] or "damping".
    level : float
        Two-sided probability of a false alarm.
    power : float
        Probability at which ``detectable`` is detected.

    Returns
    -------
    Shift or None
        The shift, or None if a test has fewer than two impacts that show the mode.
    """
    samples = [
        np.array([row[parameter] for row in model.per_impact if row["band"] == band]) for model in (first, second)
    ]
    if min(len(s) for s in samples) < 2:
        return None
    difference, se, freedom, probability, detectable = welch_test(samples[0], samples[1], level, power)
    half = scipy.stats.t.isf(level / 2.0, freedom) * se if se > 0.0 else 0.0
    return Shift(
        band=band,
        parameter=parameter,
        first=float(samples[0].mean()),
        second=float(samples[1].mean()),
        difference=difference,
        se=se,
        low=difference - half,
        high=difference + half,
        probability=probability,
        n=(len(samples[0]), len(samples[1])),
        detectable=detectable,
        power=power,
        level=level,
    )
