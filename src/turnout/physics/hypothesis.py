"""Where a diagnosis tests an effect: the sites of a turnout, and what an effect assumes at one of them.

A diagnosis offers every site to every effect that lists its type in ``PhysicsTerm.site_types``. The effect answers with
hypotheses: itself at that site, with the parameter values from which a fit starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from turnout.physics.term import Parameter
    from turnout.simulate.rail import Rail


@dataclass(frozen=True)
class SupportSite:
    """One support of the track.

    Attributes
    ----------
    support : int
        Its number.
    place : float
        Its position [m].
    n_sites : int
        Number of supports that are tested.
    first, last : int
        First and last support of the zone that is modelled in detail.
    has_passages : bool
        Whether there are passages beside hammer tests.
    """

    support: int
    place: float
    n_sites: int
    first: int
    last: int
    has_passages: bool

    @property
    def where(self) -> dict[str, object]:
        """The site in the words of a candidate."""
        return {"sleeper": self.support, "place": self.place}

    def stretches(self, starts: tuple[tuple[float, ...], ...], half_lengths: Sequence[int]) -> Iterator[Hypothesis]:
        """An effect of all supports from ``first`` to ``last`` about this one; only trains show it.

        Parameters
        ----------
        starts : tuple of tuple of float
            Values of its parameters from which fits start.
        half_lengths : sequence of int
            Supports to either side.

        Yields
        ------
        Hypothesis
            One for each length inside the zone; none without passages.
        """
        for half in half_lengths if self.has_passages else ():
            first, last = self.support - half, self.support + half
            if self.first <= first and last <= self.last:
                where = {**self.where, "sleepers": 2 * half + 1}
                yield Hypothesis(starts, {"first": first, "last": last}, where, len(half_lengths) * self.n_sites)


@dataclass(frozen=True)
class BaySite:
    """Between a ``support`` and the next one, at ``place`` [m]; ``n_sites`` supports are tested.

    ``share`` of the bay from the support to the place. ``n_positions``: positions in each bay, of which this is one.
    """

    support: int
    place: float
    n_sites: int
    share: float = 0.5
    n_positions: int = 2

    @property
    def where(self) -> dict[str, object]:
        """The site in the words of a candidate."""
        return {"place": self.place}


@dataclass(frozen=True)
class TrackSite:
    """The whole track, with the ``rail`` of its file. ``has_passages``: whether there are passages."""

    rail: Rail
    has_passages: bool


@dataclass(frozen=True)
class ChannelSite:
    """One channel in use.

    Attributes
    ----------
    name : str
        Name of the channel.
    n_sites : int
        Number of channels that are tested.
    hammer_pairs : tuple of str
        Names of the receptances that it measured.
    has_passages : bool
        Whether there are passages beside hammer tests.
    band_peak : float
        Its largest value in the passages, within their band; 0 without one. [m/s²]
    lowest_limit : float
        The channel cannot be clipped below this value. [m/s²]
    material_amplitude : float
        Amplitude in the passages below which an error of the signal does not matter. [m/s²]
    """

    name: str
    n_sites: int
    hammer_pairs: tuple[str, ...]
    has_passages: bool
    band_peak: float
    lowest_limit: float
    material_amplitude: float

    @property
    def where(self) -> dict[str, object]:
        """The site in the words of a candidate."""
        return {"sensor": self.name}


@dataclass(frozen=True)
class SaturatedChannelSite:
    """A channel that is not used because its peaks stay at a limit.

    Attributes
    ----------
    name : str
        Name of the channel.
    limit, limit_sd : float
        The limit and its standard deviation, from the peaks. [m/s²]
    evidence : float
        Evidence of the peaks for a limit. [nats]
    """

    name: str
    limit: float
    limit_sd: float
    evidence: float

    @property
    def where(self) -> dict[str, object]:
        """The site in the words of a candidate."""
        return {"sensor": self.name}


@dataclass(frozen=True)
class ContactSite:
    """The contact of wheel and rail over the sensors; there is one if there are passages.

    ``sensor_positions`` are the positions of the sensors [m].
    """

    sensor_positions: tuple[float, ...]


@dataclass(frozen=True)
class TrainSite:
    """All wheelsets of one ``train``; ``n_sites`` is the number of trains."""

    train: str
    n_sites: int

    @property
    def where(self) -> dict[str, object]:
        """The site in the words of a candidate."""
        return {"train": self.train}


@dataclass(frozen=True)
class BladeSite:
    """The blade of a switch near the sensors; there is one if the track file has it.

    Attributes
    ----------
    slide_chairs : tuple of (int, float)
        Number and position [m] of the supports on which the blade only rests.
    heel_supports : tuple of (int, float)
        The same of those to which it is fastened, the one at the heel first.
    transfer : float or None
        Where the tops of stock rail and blade are level in the file [m]; None if no route changes to the blade.
    has_passages : bool
        Whether there are passages beside hammer tests.
    """

    slide_chairs: tuple[tuple[int, float], ...]
    heel_supports: tuple[tuple[int, float], ...]
    transfer: float | None
    has_passages: bool


Site = SupportSite | BaySite | TrackSite | ChannelSite | SaturatedChannelSite | ContactSite | TrainSite | BladeSite


@dataclass(frozen=True)
class Masking:
    """The nuisance parameter of the base model that can absorb an effect.

    Attributes
    ----------
    parameter : str
        Its name; "" without one.
    sd : float
        Prior standard deviation of that parameter if the effect is there.
    size : callable or None
        First parameter of the effect from the value of the nuisance parameter; None: its exponential.
    same_quantity : bool
        Whether effect and parameter change one quantity, so that recordings show their joint change alone: their
        product if the effect is 1 where there is none, their sum if it is 0.
    """

    parameter: str = ""
    sd: float = 0.7
    size: Callable[[float], float] | None = None
    same_quantity: bool = False


@dataclass(frozen=True)
class Hypothesis:
    """An effect at one site, as a diagnosis tests it.

    Attributes
    ----------
    starts : tuple of tuple of float
        Values of the parameters from which fits start.
    fixed : mapping
        The other fields of the effect.
    where : mapping
        The site: position, sensor, train, axle.
    n_scanned : float
        Number of sites at which the effect is tested.
    parameters : tuple of Parameter or None
        The parameters that are fitted, with their priors at this site; None: those of the effect.
    masking : Masking
        The nuisance parameter that can absorb the effect.
    smallest_reportable : float or None
        As ``PhysicsTerm.smallest_reportable``, if the site determines it.
    must_not_oppose : tuple of str
        Observations that together must not contradict the effect.
    promise : float or None
        Gain that a look at the residual promises. [nats]
    start_nuisances : mapping
        Nuisance parameters from which a fit starts, of such a look.
    external_evidence : float
        Evidence from data that are not among the observations. [nats]
    rival_axles : tuple of int
        Other axles of the train that these data hardly distinguish from that of ``where``.
    """

    starts: tuple[tuple[float, ...], ...]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    where: Mapping[str, object] = field(default_factory=dict)
    n_scanned: float = 1
    parameters: tuple[Parameter, ...] | None = None
    masking: Masking = Masking()
    smallest_reportable: float | None = None
    must_not_oppose: tuple[str, ...] = ()
    promise: float | None = None
    start_nuisances: Mapping[str, float] = field(default_factory=dict)
    external_evidence: float = 0.0
    rival_axles: tuple[int, ...] = ()


@dataclass(frozen=True)
class SupportMotion:
    """Motion of one support in the base simulation, from which the force of a small effect follows.

    Attributes
    ----------
    rail, sleeper : (n,) array of float
        Displacement of rail and sleeper, down positive. [m]
    rate : float
        Sampling rate. [Hz]
    pad_stiffness, ballast_stiffness : float
        Stiffness of pad and ballast in the base model. [N/m]
    """

    rail: np.ndarray
    sleeper: np.ndarray
    rate: float
    pad_stiffness: float
    ballast_stiffness: float
