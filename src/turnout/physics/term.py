"""The interface of an omitted effect: matrix entries, ports, paths or a channel effect, never the march itself."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.errors import SimulationError

KINDS = ("matrix", "port", "path", "channel", "vehicle")


@dataclass(frozen=True)
class Parameter:
    """One number of a term. ``neutral`` is where the term vanishes; ``bounds`` where it makes sense, both in
    ``unit``; ``meaning`` in words; ``source`` whence its range. ``prior`` (mean, standard deviation) or None."""

    name: str
    unit: str
    neutral: float
    bounds: tuple[float, float]
    meaning: str
    source: str
    prior: tuple[float, float] | None = None


class PhysicsTerm:
    """Base of all terms. A term is a frozen dataclass with fields for its places and its parameters.

    Class attributes: ``name``; ``left_out``, a sentence with the term's fields in braces that says what the base
    model lacked; ``kind`` in ``KINDS``; ``parameters``, a tuple of ``Parameter`` whose names are fields. Override
    one of the methods below; each returns what is *added* to the base simulation.
    """

    name = ""
    left_out = ""
    kind = ""
    parameters: tuple[Parameter, ...] = ()
    scales = False  # whether its links are a multiple of the track's own springs, on which other terms then build

    @classmethod
    def example(cls):
        """A term with ordinary values on a track of at least 40 supports and sensors "A", "B": what tests run."""
        raise NotImplementedError(f"{cls.__name__} needs an example for its contract tests")

    def links(self, track):
        """Matrix entries: a list of ``turnout.simulate.links.Link``. Naming a new degree of freedom creates it."""
        return ()

    def ports(self, track):
        """Scalar forces that matrices cannot hold: a list of ``turnout.simulate.force_laws.Port``."""
        return ()

    @property
    def withheld(self):
        """Share of a sleeper's ballast that its ports take away."""
        return 0.0

    def paths(self, track, vehicle):
        """Parts of a wheel's path: callables (x, wheel) -> dip [m]. An attribute ``wheel`` restricts a part to
        one wheel, ``per_wheel = True`` has it evaluated for each wheel."""
        return ()

    def rail(self, track):
        """The track with other rails; its supports are the links' business."""
        return track

    def sensor(self, sensor):
        """The sensor as it really sits, where its description is wrong."""
        return sensor

    def under(self, conditions):
        """The same term under the conditions of one recording (rail temperature, axle load, train)."""
        return self

    def channel(self, signal, rate, sensor):
        """What the channel of ``sensor`` makes of the true ``signal`` (n,) at ``rate`` [Hz]."""
        return signal

    def vehicle(self, vehicle):
        """The vehicle with the effect in it."""
        return vehicle

    def force(self, state):
        """Extra force [N] on each sleeper, down positive, (n_sleeper,), of ports that act on sleepers alone.

        ``state`` has ``track``, ``sleeper_position`` (n_sleeper,) [m] and ``sleeper_velocity`` [m/s].
        """
        force = np.zeros(len(state.sleeper_position))
        for port in self.ports(state.track):
            ((kind, j), weight), *others = port.ends
            if kind != "sleeper" or others:
                raise SimulationError(f"{self.name}: port {port.label!r} does not act on one sleeper alone.")
            d = weight * state.sleeper_position[j] - port.gap
            force[j] -= weight * float(port.law.force(d, weight * state.sleeper_velocity[j]))
        return force

    def neutral(self):
        """The same term with every parameter at its neutral value: it must change nothing."""
        # Every term is a dataclass; only its class says so.
        return replace(self, **{p.name: p.neutral for p in self.parameters})  # type: ignore[type-var]

    def sentence(self):
        """What was left out, in words, with this term's numbers."""
        return self.left_out.format(**vars(self))

    def check(self):
        """Refuse parameters outside their bounds."""
        for p in self.parameters:
            value = getattr(self, p.name)
            low, high = p.bounds
            if not low <= value <= high:
                raise SimulationError(
                    f"{self.name}: {p.name} = {value!r} {p.unit} is outside {low} to {high} {p.unit}."
                )
