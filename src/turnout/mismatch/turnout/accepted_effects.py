"""Effects that were accepted into a track's file, as terms of every prediction and as nuisances of a case.

An accepted effect is not reported again. Its parameters are estimated at every visit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.priors import ACCEPTED
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.track import Track


class AcceptedEffect(Protocol):
    """One accepted effect: ``turnout.stages.accepted_effects.AcceptedEffect``."""

    @property
    def key(self) -> str:
        """Name of the effect with its position, channel and train."""

    @property
    def values(self) -> Mapping[str, tuple[float, float | None]]:
        """Parameter -> (value, standard error or None), in its own unit."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Fitted parameters of its term."""

    def term(self, track: Track, values: Mapping[str, float] | None = None) -> Any:
        """The term on a track at these values, None if no part of it lies on that track.

        Parameters
        ----------
        track : Track
            A track; by default that of the case.
        values : mapping of str to float or None
            Values of the parameters by their name.

        Returns
        -------
        Any
        """

    def is_of(self, family: str, where: Mapping[str, Any]) -> bool:
        """Whether it is the effect ``family`` at the position, sensor or train in ``where``.

        Parameters
        ----------
        family : str
            Name of an effect.
        where : mapping
            Position, sensor or train of an effect.

        Returns
        -------
        bool
        """


@dataclass(frozen=True)
class AcceptedEffects:
    """Accepted ``effects`` on the ``track`` of a case.

    Their parameters are nuisances: the priors are centred on the accepted values and wide enough for growth. With
    ``fixed`` values of the parameters they are no nuisances.
    """

    effects: tuple[AcceptedEffect, ...] = ()
    track: Track | None = None
    fixed: Mapping[str, float] | None = None

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """One nuisance per parameter, () if these are fixed."""
        if self.fixed is not None:
            return ()
        return tuple(n for label, effect in zip(self._labels, self.effects) for n in _nuisances(label, effect))

    @cached_property
    def _labels(self) -> tuple[str, ...]:
        """Key of each effect; a key that came before has a number, as those of two flats of one train."""
        keys = [effect.key for effect in self.effects]
        repetitions = [keys[:k].count(key) for k, key in enumerate(keys)]
        return tuple(f"{key} ({n + 1})" if n else key for key, n in zip(keys, repetitions))

    def fixed_at(self, values: Mapping[str, float]) -> AcceptedEffects:
        """The same effects with their parameters fixed at ``values``.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        AcceptedEffects
        """
        return replace(self, fixed=values) if self.effects else self

    def terms(self, values: Mapping[str, float]) -> tuple[PhysicsTerm, ...]:
        """Terms of the effects at these values of their nuisances.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        tuple[PhysicsTerm, ...]
        """
        if not self.effects:
            return ()
        assert self.track is not None
        at = values if self.fixed is None else self.fixed
        return tuple(
            effect.term(self.track, {p.name: float(at[_name(label, p)]) for p in effect.parameters})
            for label, effect in zip(self._labels, self.effects)
        )

    def without(self, candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
        """Candidates that are not accepted already.

        Parameters
        ----------
        candidates : iterable of Candidate
            Candidate effects.

        Returns
        -------
        tuple[Candidate, ...]
        """
        return tuple(c for c in candidates if not any(effect.is_of(c.family, c.where) for effect in self.effects))

    def difference_columns(
        self,
        predict: Callable[[Mapping[str, float]], Sequence[np.ndarray]],
        values: Mapping[str, float],
        base: Sequence[np.ndarray],
    ) -> list[list[np.ndarray]]:
        """Difference quotients of ``predict(values)`` by every nuisance: lists of (n,) per observation.

        Parameters
        ----------
        predict : callable
            Values of all nuisances -> predictions, one (n,) array per observation.
        values : mapping
            Where the derivatives are taken.
        base : sequence of (n,) array
            Predictions there.

        Returns
        -------
        list of list of (n,) array
            One list per nuisance, one array per observation.
        """
        return [_difference_column(predict, values, base, n) for n in self.nuisances]

    def estimates(self, nuisances: Sequence[Nuisance], fit: Fit) -> list[dict[str, Any]]:
        """Estimates of all parameters in a fit: dicts with accepted, name, value, se and unit.

        Parameters
        ----------
        nuisances : sequence of Nuisance
            Nuisance parameters, one column each.
        fit : Fit
            A fit of the case.

        Returns
        -------
        list[dict[str, Any]]
        """
        index = {n.name: k for k, n in enumerate(nuisances)}
        estimates = []
        for label, effect in zip(self._labels, self.effects):
            for p in effect.parameters:
                name = _name(label, p)
                se = float(np.sqrt(max(fit.covariance[index[name], index[name]], 0.0)))
                estimates.append(
                    {
                        "accepted": effect,
                        "name": p.name,
                        "value": fit.values[name],
                        "se": se,
                        "unit": p.unit,
                    }
                )
        return estimates


NO_EFFECTS = AcceptedEffects()


def effects_on(track: Track, accepted: Iterable[AcceptedEffect]) -> AcceptedEffects:
    """Those accepted effects that lie on ``track`` and have a parameter.

    Parameters
    ----------
    track : Track
        The main track of the zone.
    accepted : iterable of AcceptedEffect
        Effects of the track's file.

    Returns
    -------
    AcceptedEffects
        ``NO_EFFECTS`` where there are none.
    """
    effects = tuple(effect for effect in accepted if effect.term(track) is not None and effect.values)
    return AcceptedEffects(effects, track) if effects else NO_EFFECTS


def _name(label: str, parameter: Parameter) -> str:
    return f"{label}.{parameter.name}"


def _nuisances(label: str, effect: AcceptedEffect) -> Iterator[Nuisance]:
    for p in effect.parameters:
        value, error = effect.values[p.name]
        sd = max(_prior_sd(p, value), ACCEPTED.min_errors * (error or 0.0))
        yield Nuisance(_name(label, p), p.unit, value, sd, bounds=p.bounds, meaning=p.meaning)


def _prior_sd(p: Parameter, value: float) -> float:
    """Prior sd of an accepted value: a share of its distance from neutral, or of itself if neutral means no limit."""
    if abs(p.neutral) > ACCEPTED.max_neutral_ratio * abs(value) > 0.0:
        return ACCEPTED.sd_share * abs(value)
    return max(ACCEPTED.sd_share * abs(value - p.neutral), ACCEPTED.min_sd_share * (p.bounds[1] - p.bounds[0]))


def _difference_column(
    predict: Callable[[Mapping[str, float]], Sequence[np.ndarray]],
    values: Mapping[str, float],
    base: Sequence[np.ndarray],
    nuisance: Nuisance,
) -> list[np.ndarray]:
    """Difference quotient by one nuisance, to the side that can be simulated."""
    step = ACCEPTED.derivative_step * nuisance.sd
    if values[nuisance.name] + step > nuisance.bounds[1]:
        step = -step
    try:
        shifted = predict({**values, nuisance.name: values[nuisance.name] + step})
    except SimulationError:  # step to the other side
        step = -step
        shifted = predict({**values, nuisance.name: values[nuisance.name] + step})
    return [(new - old) / step for new, old in zip(shifted, base)]
