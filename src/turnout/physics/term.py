"""The interface of an effect: how it changes the simulation, how a diagnosis tests it and what a finding says of it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.effect import Effect

if TYPE_CHECKING:
    from turnout.physics.hypothesis import Hypothesis, SupportMotion
    from turnout.physics.requirement import Requirement
    from turnout.simulate.track import Track

COLUMN_TYPES = ("support", "track", "path", "channel", "link", "")
FORCE_TARGETS = ("rail", "sleeper", "pad")  # the force of a pad acts on the rail and reversed on the sleeper
# What an effect is fixed to, and how the page of effects describes it.
FRAMES = {
    "place": "a position", "amplitude": "a position, and the deflection there", "frequency": "a frequency band",
    "condition": "the whole track", "sensor": "a sensor", "clock": "the clock of a channel",
    "wheel": "a wheel", "train": "a train", "wavelength": "a stretch of rail",
}  # fmt: skip
APPROXIMATE = 0.15  # error of an effect's size by its form; nine of another simulator: median 0.12
ACCURATE = 0.03  # the same of gains and delays; ten of another simulator: median 0.01


@dataclass(frozen=True)
class Parameter:
    """One parameter of a term.

    At ``neutral`` the term vanishes; ``bounds`` limit the plausible range; both are in ``unit``. ``meaning`` is a short
    description, ``source`` the source of the range. ``prior`` is (mean, standard deviation) or None. ``has_open_ends``:
    a fit that ends at a bound asks for a value beyond it, which is another effect. ``model_error_share``: share by
    which an estimate errs, since the shape of the true effect is another; the size has that of its effect.
    """

    name: str
    unit: str
    neutral: float
    bounds: tuple[float, float]
    meaning: str
    source: str
    prior: tuple[float, float] | None = None
    has_open_ends: bool = False
    model_error_share: float = 0.0


class SleeperState(Protocol):
    """Motion of the sleepers of a ``track``, each (n_sleeper,) [m, m/s]."""

    track: Track
    sleeper_position: np.ndarray
    sleeper_velocity: np.ndarray


class PhysicsTerm(Effect):
    """Base class of all effects. An effect is a frozen dataclass with fields for its positions and its parameters.

    Everything that is known of an effect is a class attribute or a method of its class. Fields named ``sleeper``,
    ``support``, ``first`` and ``last`` are numbers of supports, ``channel_name`` is a channel and ``train`` a train.
    The first parameter is the size of the effect.

    Attributes
    ----------
    parameters : tuple of Parameter
        What a fit estimates; their names are fields.
    frame : str
        What it is fixed to, one of ``FRAMES``.
    left_out : str
        Sentence that states what the base model lacked, with the fields in braces.
    left_out_negative : str
        The same if the first parameter is negative, with absolute values as ``<name>_size``; "" if it is the same.
    message : str
        Sentence of a finding to the person who inspects the track, without a full stop. In braces: ``place``,
        ``channel``, ``train``, ``wheel``, every parameter with its unit, and its absolute value as ``<name>_size``.
    message_negative : str
        The same if the first parameter is negative; "" if the sentence is the same.
    message_unbounded : str
        The same if of the first parameter only a lower limit is known; "" if the sentence is the same.
    site_check : str
        What to do on site.
    separating_test : str
        Measurement that separates it from its rivals; "" if none is known to do so better than more recordings.
    asked : bool
        Whether a diagnosis tests it. Others are known to the simulation and to track files only.
    site_types : tuple of type
        Classes of ``turnout.physics.hypothesis`` at which it is tested; () if only a residual suggests where.
    column_type : str
        How its first-order change of a prediction is computed. "support": a force at supports (``pseudo_force``) and a
        change of links in receptances. "track": exactly in receptances, in passages as ``nuisance_change``. "path": a
        path that all wheels follow. "channel": a change of the known signal. "link": a change of links in receptances,
        in passages by a simulation. "": by a simulation.
    smallest_reportable : float
        Distance of the first ``n_size_parameters`` parameters from neutral below which nobody would act; 0 if the site
        or the scan that suggests it determines it.
    n_size_parameters : int
        Number of parameters that make up the size.
    min_significance : float
        Standard errors of the first parameter by which the size must exceed ``smallest_reportable``.
    model_error_share : float
        Share by which an estimated size errs, since the model of the effect is only approximate.
    exact : bool
        The model of the effect is exact (a gain, a lag, a position): no residual is due to its shape.
    component : str
        Component that it changes. Where one effect of a component leads, all of them are refitted there.
    limit_form : str
        Effect that looks the same at the lower bound of the first parameter.
    simpler_form : tuple
        (effect, k): where the first parameter does not matter, it equals that effect with parameter k as its size.
    general_form : str
        The same fault in recordings of all types: it is named where the recordings cannot tell the two.
    unbounded_form : str
        Effect that looks the same where only a lower limit of the first parameter is known.
    prescreen_group : str
        Not empty: tried on hammer tests at every site, whatever the residual promises. Effects with the same word share
        these trials.
    start_from_base : bool
        False: refits start with the nuisance parameters at their priors, not at the base fit.
    sign_ambiguous : bool
        Hammer tests hardly tell a value from its mirror image about neutral.
    nonlinear_in_size : bool
        The response changes its shape with the size. A start says nothing of larger or smaller sizes.
    required_data_type : str
        Data type of observations that must support it. To all others it looks like another effect.
    requirements : tuple of Requirement
        What the recordings must have for it to be examined. An answer states what they lack.
    evidence_suffices : bool
        Evidence beside the observations is enough: it need not explain their residual.
    must_reach_control_level : bool
        It can imitate many others. It is named only if the residual falls to the control level.
    distant_starts : tuple of float
        Values of the first parameter that are simulated although no derivative of the base model extends that far.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    frame: ClassVar[str] = ""

    left_out: ClassVar[str] = ""
    left_out_negative: ClassVar[str] = ""
    message: ClassVar[str] = ""
    message_negative: ClassVar[str] = ""
    message_unbounded: ClassVar[str] = ""
    site_check: ClassVar[str] = ""
    separating_test: ClassVar[str] = ""

    asked: ClassVar[bool] = True
    site_types: ClassVar[tuple[type, ...]] = ()
    column_type: ClassVar[str] = ""
    smallest_reportable: ClassVar[float] = 0.0
    n_size_parameters: ClassVar[int] = 1
    min_significance: ClassVar[float] = 0.0
    model_error_share: ClassVar[float] = APPROXIMATE
    exact: ClassVar[bool] = False
    component: ClassVar[str] = ""
    limit_form: ClassVar[str] = ""
    simpler_form: ClassVar[tuple[str, int] | tuple[()]] = ()
    general_form: ClassVar[str] = ""
    unbounded_form: ClassVar[str] = ""
    prescreen_group: ClassVar[str] = ""
    start_from_base: ClassVar[bool] = True
    sign_ambiguous: ClassVar[bool] = False
    nonlinear_in_size: ClassVar[bool] = False
    required_data_type: ClassVar[str] = ""
    requirements: ClassVar[tuple[Requirement, ...]] = ()
    evidence_suffices: ClassVar[bool] = False
    must_reach_control_level: ClassVar[bool] = False
    distant_starts: ClassVar[tuple[float, ...]] = ()

    @classmethod
    def example(cls) -> Self:
        """A term with ordinary values for the tests: on a track of at least 40 supports with sensors "A" and "B"."""
        raise NotImplementedError(f"{cls.__name__} needs an example for its contract tests")

    @classmethod
    def title(cls) -> str:
        """What it is, in words: the first sentence of its module, without a full stop."""
        lines = (sys.modules[cls.__module__].__doc__ or cls.name.replace("_", " ")).strip().splitlines()
        return lines[0].split(": ")[0].removesuffix(".")

    @classmethod
    def hypotheses(cls, site: Any) -> Iterable[Hypothesis]:
        """What a diagnosis tests at a site.

        Parameters
        ----------
        site : SupportSite, BaySite, TrackSite, ChannelSite, SaturatedChannelSite, ContactSite or TrainSite
            A site of one of the classes in ``site_types``.

        Returns
        -------
        iterable of Hypothesis
            In the order of the test; none if the effect cannot be seen there.
        """
        return ()

    # Its force in a state of the track

    def force(self, state: SleeperState) -> np.ndarray:
        """Additional force on each sleeper, of ports that act on sleepers only.

        Parameters
        ----------
        state : SleeperState
            Motion of the sleepers of a track.

        Returns
        -------
        (n_sleeper,) array of float
            Force, down positive. [N]

        Raises
        ------
        SimulationError
            A port acts on something else than one sleeper.
        """
        force = np.zeros(len(state.sleeper_position))
        for port in self.ports(state.track):
            ((node_type, j), weight), *more_ends = port.ends
            if node_type != "sleeper" or more_ends:
                raise SimulationError(f"{self.name}: port {port.label!r} does not act on one sleeper alone.")
            d = weight * state.sleeper_position[j] - port.gap
            force[j] -= weight * float(port.law.force(d, weight * state.sleeper_velocity[j]))
        return force

    # First-order changes of predictions, for the order in which a diagnosis refits

    @property
    def supports(self) -> range:
        """Numbers of the supports at which it acts, by its fields; empty without one."""
        first = next((getattr(self, name) for name in ("sleeper", "support", "first") if hasattr(self, name)), None)
        return range(0) if first is None else range(first, getattr(self, "last", first) + 1)

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """Force that has the same effect on the base model, to first order, at one of its ``supports``.

        Parameters
        ----------
        motion : SupportMotion
            Motion of the support in the base simulation.

        Returns
        -------
        target : str
            What the force acts on, one of ``FORCE_TARGETS``.
        force : (n,) array of float
            Force, down positive. [N]
        """
        raise NotImplementedError(f"{self.name} is not of column type 'support'")

    def condensed_links(self, track: Track, frequency: np.ndarray) -> list[tuple[tuple, np.ndarray]] | None:
        """Dynamic stiffness between the degrees of freedom of the base model, for links that create their own.

        Parameters
        ----------
        track : Track
            The track without them.
        frequency : (n,) array of complex
            Frequencies. [Hz]

        Returns
        -------
        list of (ends, stiffness) or None
            ``ends`` as those of a ``Link`` and (n,) complex stiffness [N/m]; None: ``links`` create none.
        """
        return None

    def nuisance_change(self, conditions: Mapping[str, Any]) -> tuple[str, float] | None:
        """Change of a nuisance parameter of the base model that acts like the effect in one passage, to first order.

        Parameters
        ----------
        conditions : mapping
            As in ``under_conditions``.

        Returns
        -------
        (name, change) or None
            None without an effect in that passage.
        """
        return None

    # Values and sentences

    def neutral(self) -> Self:
        """The same term with every parameter at its neutral value: it must have no effect."""
        # Every term is a dataclass; mypy does not know this of the base class.
        return replace(self, **{p.name: p.neutral for p in self.parameters})  # type: ignore[type-var]

    def sentence(self) -> str:
        """Sentence that states what was left out, with the numbers of this term."""
        return self._sentence_with()

    def _sentence_with(self, **fields: Any) -> str:
        """The sentence for the sign of the first parameter, with these ``fields`` in place of those of the term."""
        sizes = {f"{p.name}_size": abs(getattr(self, p.name)) for p in self.parameters}
        is_negative = bool(self.parameters) and getattr(self, self.parameters[0].name) < 0.0
        template = self.left_out_negative if self.left_out_negative and is_negative else self.left_out
        return template.format(**{**vars(self), **sizes, **fields})

    def check(self) -> None:
        """Raise SimulationError if a parameter is outside its bounds."""
        for p in self.parameters:
            value = getattr(self, p.name)
            low, high = p.bounds
            if not low <= value <= high:
                raise SimulationError(
                    f"{self.name}: {p.name} = {value!r} {p.unit} is outside {low} to {high} {p.unit}."
                )
