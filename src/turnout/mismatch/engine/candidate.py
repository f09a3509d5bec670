"""Candidate effects: one effect at one site, with its starts and the rules by which it may be named.

A ``Candidate`` consists of four records. ``Effect``: what the effect is. ``EffectSite``: where it may act.
``RefitStarts``: where its refits start. ``NamingRules``: what it must show to be named.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.physics import Parameter


@dataclass(frozen=True)
class Effect:
    """What an effect is, wherever it acts.

    Attributes
    ----------
    family : str
        Its name, which a verdict may give.
    parameters : tuple of Parameter
        With name, unit, neutral, bounds and prior as ``turnout.physics.Parameter``. The first one is the size.
    make : callable
        Parameter values (dict) -> term.
    component : str
        Component that the effect changes. Where one effect of a component leads, all of them are refitted there.
    exact : bool
        The model of the effect is exact (a gain, a lag, a position): no residual is due to its shape.
    model_error_share : float
        Share by which an estimated size errs, since the model of the effect is only approximate.
    limit_form : str
        Family that looks the same at the lower bound of the first parameter.
    simpler_form : tuple
        (family, k): where the first parameter does not matter, the effect equals that family with parameter k as its
        size. () without such a family.
    unbounded_form : str
        Family that looks the same where only a lower limit of the first parameter is known.
    general_form : str
        Family of the same fault in recordings of all types.
    """

    family: str
    parameters: tuple[Parameter, ...]
    make: Callable[[Mapping[str, float]], Any]
    component: str = ""
    exact: bool = False
    model_error_share: float = 0.0
    limit_form: str = ""
    simpler_form: tuple[str, int] | tuple[()] = ()
    unbounded_form: str = ""
    general_form: str = ""

    def within(self, families: Collection[str]) -> Effect:
        """The effect in a library of some families alone: what is not in it is no form of the effect.

        Parameters
        ----------
        families : collection of str

        Returns
        -------
        Effect
        """
        return replace(
            self,
            limit_form=self.limit_form if self.limit_form in families else "",
            simpler_form=self.simpler_form if self.simpler_form and self.simpler_form[0] in families else (),
            unbounded_form=self.unbounded_form if self.unbounded_form in families else "",
            general_form=self.general_form if self.general_form in families else "",
        )


@dataclass(frozen=True)
class EffectSite:
    """Where an effect may act.

    Attributes
    ----------
    where : mapping
        Position, sensor, train, axle.
    frame : str
        What the effect is fixed to.
    n_scanned : float
        Number of sites at which this effect is tested.
    masking_parameter : str
        Nuisance parameter that can absorb the effect.
    masking_sd : float
        Its prior standard deviation if the effect is there.
    from_masking : callable or None
        Its value -> first parameter of the effect; None: the exponential.
    same_quantity : bool
        Whether effect and parameter change one quantity, so that recordings show their joint change alone.
    rival_axles : tuple of int
        Other axles of the train whose evidence is less than ``THRESHOLDS.position_margin`` smaller.
    """

    where: Mapping[str, Any] = field(default_factory=dict)
    frame: str = ""
    n_scanned: float = 1
    masking_parameter: str = ""
    masking_sd: float = THRESHOLDS.masking_sd
    from_masking: Callable[[float], float] | None = None
    same_quantity: bool = False
    rival_axles: tuple[int, ...] = ()


@dataclass(frozen=True)
class RefitStarts:
    """Where refits of a candidate start.

    Attributes
    ----------
    points : tuple of tuple of float
        Parameter sets. They do not depend on the base fit.
    from_base : bool
        False: refits start with the nuisance parameters at their priors, not at the base fit.
    prescreen_group : str
        Not empty: tried on the hammer tests at every site, whatever the residual promises. Families with the same
        word share these trials.
    promise : float or None
        Gain that a look at the residual promises [nats]. Such a candidate starts at its first point as it is, with the
        ``nuisances``.
    nuisances : mapping
        Nuisance parameter -> value.
    sign_ambiguous : bool
        The hammer tests hardly distinguish a value from its mirror image about neutral.
    nonlinear_in_size : bool
        The response changes its shape with the size. A start says nothing of larger or smaller sizes.
    """

    points: tuple[tuple[float, ...], ...]
    from_base: bool = True
    prescreen_group: str = ""
    promise: float | None = None
    nuisances: Mapping[str, float] = field(default_factory=dict)
    sign_ambiguous: bool = False
    nonlinear_in_size: bool = False


@dataclass(frozen=True)
class NamingRules:
    """What a candidate must show to be named.

    Attributes
    ----------
    smallest_reportable : float
        Distance of the first ``n_size_parameters`` parameters from neutral below which nobody would act.
    n_size_parameters : int
        Number of parameters that make up the size.
    min_significance : float
        Standard errors of the first parameter by which the size must exceed ``smallest_reportable``.
    must_reach_control_level : bool
        The effect can imitate many others. It is named only if the residual falls to the control level.
    external_evidence : float
        Evidence from data that are not among the observations [nats].
    evidence_suffices : bool
        The external evidence alone is enough: the effect need not explain the residual of the observations.
    required_data_type : str
        Data type of observations that must support the effect. To all others it looks like another effect.
    must_not_oppose : tuple of str
        Observations that together must not contradict the effect.
    """

    smallest_reportable: float = 0.0
    n_size_parameters: int = 1
    min_significance: float = 0.0
    must_reach_control_level: bool = False
    external_evidence: float = 0.0
    evidence_suffices: bool = False
    required_data_type: str = ""
    must_not_oppose: tuple[str, ...] = ()


@dataclass(frozen=True)
class Candidate:
    """One effect at one site. ``Candidate.of`` builds it from the fields of its four records."""

    effect: Effect
    refit: RefitStarts
    site: EffectSite = EffectSite()
    naming: NamingRules = NamingRules()

    @classmethod
    def of(
        cls,
        family: str,
        parameters: Sequence[Parameter],
        make: Callable[[Mapping[str, float]], Any],
        starts: Iterable[tuple[float, ...]],
        where: Mapping[str, Any] | None = None,
        frame: str = "",
        n_scanned: float = 1,
        **more: Any,
    ) -> Candidate:
        """A candidate from the fields of its records.

        Parameters
        ----------
        family : str
            Name of the effect.
        parameters : sequence of Parameter
            The first one is the size.
        make : callable
            Parameter values (dict) -> term, as ``Case.predict`` takes it.
        starts : iterable of tuple of float
            Parameter sets from which refits start.
        where : mapping or None
            The site: position, sensor, train, axle.
        frame : str
            What the effect is fixed to.
        n_scanned : float
            Number of sites at which this effect is tested.
        **more
            Further fields of ``Effect``, ``EffectSite``, ``RefitStarts`` and ``NamingRules``, by name.

        Returns
        -------
        Candidate

        Raises
        ------
        TypeError
            If none of the records has a field of this name.

        Examples
        --------
        >>> from turnout.physics import Parameter
        >>> size = Parameter("amount", "-", 0.0, (-1.0, 1.0), "share of the linear force", "chosen")
        >>> soft = Candidate.of("soft", (size,), dict, ((0.1,),), {"place": 4.2}, n_scanned=7, exact=True)
        >>> soft.key, soft.site.n_scanned, soft.effect.exact
        ('soft[place=4.2]', 7, True)
        """
        remaining = dict(more)

        def record(record_type: type) -> dict[str, Any]:
            return {f.name: remaining.pop(f.name) for f in fields(record_type) if f.name in remaining}

        effect = Effect(family, tuple(parameters), make, **record(Effect))
        site = EffectSite(where or {}, frame, n_scanned, **record(EffectSite))
        refit = RefitStarts(tuple(starts), **record(RefitStarts))
        naming = NamingRules(**record(NamingRules))
        if remaining:
            raise TypeError(f"no record of a candidate has a field {', '.join(map(repr, remaining))}")
        return cls(effect, refit, site, naming)

    @property
    def family(self) -> str:
        """Name of the effect."""
        return self.effect.family

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the effect; the first one is the size."""
        return self.effect.parameters

    @property
    def starts(self) -> tuple[tuple[float, ...], ...]:
        """Parameter sets from which refits start."""
        return self.refit.points

    @property
    def where(self) -> Mapping[str, Any]:
        """The site: position, sensor, train, axle."""
        return self.site.where

    @property
    def frame(self) -> str:
        """What the effect is fixed to."""
        return self.site.frame

    @property
    def key(self) -> str:
        """Family and site in one word."""
        position = ",".join(f"{k}={v}" for k, v in sorted(self.where.items()))
        return f"{self.family}[{position}]" if position else self.family

    @property
    def position(self) -> float | None:
        """Position of the effect. None if it has none, or one in words. [m]"""
        place = self.where.get("place")
        return place if isinstance(place, (int, float)) else None

    @property
    def in_words(self) -> str:
        """Family and site as text.

        >>> from turnout.physics import Parameter
        >>> amount = Parameter("amount", "-", 0.0, (0.0, 1.0), "share", "chosen")
        >>> sites = ({"place": 8.41}, {"sensor": "A8"}, {"train": "ic3", "axle": 3}, {})
        >>> [Candidate.of("soft_pad", (amount,), dict, (), site).in_words for site in sites]
        ['soft pad at 8.4 m', 'soft pad at sensor A8', 'soft pad at wheelset 3 of ic3', 'soft pad']
        """
        words, where = [self.family.replace("_", " ")], self.where
        if self.position is not None:
            words.append(f"at {self.position:.1f} m")
        if "sensor" in where:
            words.append(f"at sensor {where['sensor']}")
        if "axle" in where:
            words.append(f"at wheelset {' or '.join(map(str, (where['axle'], *self.site.rival_axles)))}")
        if "train" in where:
            words.append(f"of {where['train']}")
        return " ".join(words)

    @property
    def part(self) -> tuple[str, Any]:
        """(component, position or sensor) that the effect changes."""
        return self.effect.component, self.where.get("place", self.where.get("sensor"))

    @property
    def neutral(self) -> np.ndarray:
        """(n_parameter,) values at which the term vanishes."""
        return np.array([p.neutral for p in self.parameters])

    def scaled_start(self, k: int, share: float) -> np.ndarray:
        """A start with its first parameter at a share of the distance from neutral. The others define its shape.

        Parameters
        ----------
        k : int
            Number of the start.
        share : float

        Returns
        -------
        (n_term,) array of float
        """
        start = np.array(self.starts[k], dtype=float)
        start[0] = self.neutral[0] + share * (start[0] - self.neutral[0])
        return start

    def mirror_image(self, values: ArrayLike) -> np.ndarray:
        """Parameter values with the first one mirrored about neutral.

        Parameters
        ----------
        values : (n_parameter,) sequence of float

        Returns
        -------
        (n_parameter,) array of float
        """
        image = np.array(values, dtype=float)
        image[0] = 2.0 * self.parameters[0].neutral - image[0]
        return image

    def term(self, values: Iterable[float]) -> Any:
        """The term with these parameters.

        Parameters
        ----------
        values : (n_parameter,) iterable of float

        Returns
        -------
        term
            As ``Case.predict`` takes it.
        """
        return self.effect.make({p.name: float(v) for p, v in zip(self.parameters, values)})
