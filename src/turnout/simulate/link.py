"""A link: one scalar deformation of the track with its spring, damper and mass."""

from dataclasses import dataclass

from turnout.errors import SimulationError


@dataclass(frozen=True)
class Link:
    r"""Adds :math:`k v v^T`, :math:`c v v^T` and :math:`m v v^T` to the track's matrices.

    ``ends`` is the sparse vector v: pairs of a degree of freedom and its weight. Degrees of freedom are
    named: ("rail", j) the rail over support j, ("rail", j, k) the k-th node from there, ("sleeper", j),
    ("ballast", j), or a further one of support j such as ("zener", j), which is created by naming it.
    ``stiffness`` k [N/m], ``damping`` c [N s/m], ``mass`` m [kg], ``loss_factor`` hysteretic, frequency domain
    only. A negative stiffness takes away what the base track has; the sum must stay positive definite.
    ``tag`` says what the link stands for ("pad", "ballast", ...) so that gradients find it.
    """

    ends: tuple
    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    loss_factor: float = 0.0
    tag: str = ""

    def __post_init__(self):
        if not self.ends:
            raise SimulationError(f"link {self.tag!r}: acts on no degree of freedom.")
        for value in (self.stiffness, self.damping, self.mass, self.loss_factor):
            if not abs(value) < float("inf"):
                raise SimulationError(f"link {self.tag!r} at {self.ends}: {value!r} is not a finite number.")
