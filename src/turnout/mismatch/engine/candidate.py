"""Candidate effects: one effect at one position, wheelset or sensor, with its term, parameters and starts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.physics import Parameter


@dataclass(frozen=True)
class Candidate:
    """One effect at one site. ``make(psi)`` gives the term for parameter values ``psi`` (dict).

    Attributes
    ----------
    family : str
        Name of the effect, which a verdict may give.
    parameters : tuple
        With name, unit, neutral, bounds and prior as ``turnout.physics.Parameter``. The first one is the size.
    make : callable
        Parameter values (dict) -> term.
    starts : tuple of tuple of float
        Parameter sets from which refits start. They do not depend on the base fit.
    where : mapping
        The site: position, sensor, train, axle.
    frame : str
        What the effect is fixed to.
    n_scanned : float
        Number of sites at which this effect is tested.
    start_from_base : bool
        False: refits start with the nuisance parameters at their priors, not at the base fit.
    prescreen_group : str
        Not empty: tried on the cheap observations at every site, whatever the residual promises. Families with the same
        word share these trials.
    smallest_reportable : float
        Distance of the first ``n_size_parameters`` parameters from neutral below which nobody would act.
    sign_ambiguous : bool
        The cheap observations hardly tell a value from its mirror image about neutral.
    masking_parameter : str
        Nuisance parameter that can absorb the effect. ``masking_sd`` is its prior standard deviation if the effect is
        there. ``from_masking`` computes the first parameter from it; None: the exponential.
    promise : float or None
        Gain that a look at the residual promises [nats]. Such a candidate starts at its first start as it is, with the
        nuisance parameters ``start_nuisances``.
    external_evidence : float
        Evidence from data that are not among the observations [nats].
    evidence_suffices : bool
        The external evidence alone is enough: the effect need not explain the residual of the observations.
    model_error_share : float
        Share by which an estimated size errs, since the model of the effect is only approximate.
    exact : bool
        The model of the effect is exact (a gain, a lag, a position): no residual is due to its shape.
    required_data_type : str
        Data type of observations that must support the effect. To all others it looks like another effect.
    must_not_oppose : tuple of str
        Observations that together must not contradict the effect.
    component : str
        Component that the effect changes. Where one effect of a component leads, all of them are refitted there.
    limit_form : str
        Family that looks the same at the lower bound of the first parameter.
    simpler_form : tuple
        (family, k): where the first parameter does not matter, the effect equals that family with parameter k as its
        size.
    unbounded_form : str
        Family that looks the same where only a lower limit of the first parameter is known.
    nonlinear_in_size : bool
        The response changes its shape with the size. A start says nothing of larger or smaller sizes.
    must_reach_control_level : bool
        The effect can imitate many others. It is named only if the residual falls to the control level.
    n_size_parameters : int
        Number of parameters that make up the size.
    min_significance : float
        Standard errors of the first parameter by which the size must exceed ``smallest_reportable``.
    """

    family: str
    parameters: tuple[Parameter, ...]
    make: Callable[[Mapping[str, float]], Any]
    starts: tuple[tuple[float, ...], ...]
    where: Mapping[str, Any] = field(default_factory=dict)
    frame: str = ""
    n_scanned: float = 1
    start_from_base: bool = True
    prescreen_group: str = ""
    smallest_reportable: float = 0.0
    sign_ambiguous: bool = False
    masking_parameter: str = ""
    masking_sd: float = THRESHOLDS.masking_sd
    from_masking: Callable[[float], float] | None = None
    promise: float | None = None
    start_nuisances: Mapping[str, float] = field(default_factory=dict)
    external_evidence: float = 0.0
    evidence_suffices: bool = False
    model_error_share: float = 0.0
    exact: bool = False
    required_data_type: str = ""
    must_not_oppose: tuple[str, ...] = ()
    component: str = ""
    limit_form: str = ""
    simpler_form: tuple = ()
    unbounded_form: str = ""
    nonlinear_in_size: bool = False
    must_reach_control_level: bool = False
    n_size_parameters: int = 1
    min_significance: float = 0.0

    @property
    def key(self) -> str:
        """Family and site in one word."""
        position = ",".join(f"{k}={v}" for k, v in sorted(self.where.items()))
        return f"{self.family}[{position}]" if position else self.family

    @property
    def part(self) -> tuple[str, Any]:
        """(component, position or sensor) that the effect changes."""
        return self.component, self.where.get("place", self.where.get("sensor"))

    @property
    def neutral(self) -> np.ndarray:
        """(n_parameter,) values at which the term vanishes."""
        return np.array([p.neutral for p in self.parameters])

    def mirror_image(self, values: ArrayLike) -> np.ndarray:
        """``values`` (n_parameter,) with the first parameter mirrored about neutral."""
        image = np.array(values, dtype=float)
        image[0] = 2.0 * self.parameters[0].neutral - image[0]
        return image

    def term(self, values: Iterable[float]) -> Any:
        """The term with parameters (n_parameter,)."""
        return self.make({p.name: float(v) for p, v in zip(self.parameters, values)})
