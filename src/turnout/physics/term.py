"""The interface of an omitted effect: matrix entries, ports, paths or a channel effect, never the march itself."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.errors import SimulationError

EFFECT_TYPES = ("matrix", "port", "path", "channel", "vehicle")


@dataclass(frozen=True)
class Parameter:
    """One parameter of a term.

    At ``neutral`` the term vanishes; ``bounds`` limit the plausible range; both are in ``unit``. ``meaning`` is a short
    description, ``source`` the source of the range. ``prior`` is (mean, standard deviation) or None.
    """

    name: str
    unit: str
    neutral: float
    bounds: tuple[float, float]
    meaning: str
    source: str
    prior: tuple[float, float] | None = None


class PhysicsTerm:
    """Base class of all terms. A term is a frozen dataclass with fields for its positions and its parameters.

    Class attributes: ``name``; ``left_out``, a sentence with the term's fields in braces that states what the base
    model lacked; ``effect_type``, one of ``EFFECT_TYPES``; ``parameters``, a tuple of ``Parameter`` whose names are
    fields. Override one of the methods below; each returns what is *added* to the base simulation.
    """

    name = ""
    left_out = ""
    effect_type = ""
    parameters: tuple[Parameter, ...] = ()
    scales_track = False  # whether its links are a multiple of the track's springs; other terms then act on the result

    @classmethod
    def example(cls):
        """A term with ordinary values for the tests: on a track of at least 40 supports with sensors "A" and "B"."""
        raise NotImplementedError(f"{cls.__name__} needs an example for its contract tests")

    def links(self, track):
        """Matrix entries: a list of ``turnout.simulate.links.Link``. Naming a new degree of freedom creates it."""
        return ()

    def ports(self, track):
        """Scalar forces that matrices cannot describe: a list of ``turnout.simulate.force_laws.Port``."""
        return ()

    @property
    def withheld_share(self):
        """Share of the ballast of a sleeper that the ports of this term remove."""
        return 0.0

    def paths(self, track, vehicle):
        """Parts of a wheel's path: callables (x, wheel) -> dip [m].

        An attribute ``wheel`` restricts a part to one wheel; ``per_wheel = True`` has it evaluated for each wheel.
        """
        return ()

    def rail(self, track):
        """The track with changed rails; its supports are changed by links."""
        return track

    def sensor(self, sensor):
        """The sensor at its true position, if its description is wrong."""
        return sensor

    def under_conditions(self, conditions):
        """The same term under the conditions of one recording (rail temperature, axle load, train)."""
        return self

    def channel(self, signal, rate, sensor):
        """Signal that the channel of ``sensor`` records of the true ``signal`` (n,) at ``rate`` [Hz]."""
        return signal

    def vehicle(self, vehicle):
        """The vehicle with the effect."""
        return vehicle

    def force(self, state):
        """Additional force [N] on each sleeper, down positive, (n_sleeper,), of ports that act on sleepers only.

        ``state`` has ``track``, ``sleeper_position`` (n_sleeper,) [m] and ``sleeper_velocity`` [m/s].
        """
        force = np.zeros(len(state.sleeper_position))
        for port in self.ports(state.track):
            ((node_type, j), weight), *more_ends = port.ends
            if node_type != "sleeper" or more_ends:
                raise SimulationError(f"{self.name}: port {port.label!r} does not act on one sleeper alone.")
            d = weight * state.sleeper_position[j] - port.gap
            force[j] -= weight * float(port.law.force(d, weight * state.sleeper_velocity[j]))
        return force

    def neutral(self):
        """The same term with every parameter at its neutral value: it must have no effect."""
        # Every term is a dataclass; mypy does not know this of the base class.
        return replace(self, **{p.name: p.neutral for p in self.parameters})  # type: ignore[type-var]

    def sentence(self):
        """Sentence that states what was left out, with the numbers of this term."""
        return self.left_out.format(**vars(self))

    def check(self):
        """Raise SimulationError if a parameter is outside its bounds."""
        for p in self.parameters:
            value = getattr(self, p.name)
            low, high = p.bounds
            if not low <= value <= high:
                raise SimulationError(
                    f"{self.name}: {p.name} = {value!r} {p.unit} is outside {low} to {high} {p.unit}."
                )
