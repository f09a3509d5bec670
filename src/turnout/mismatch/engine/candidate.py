"""One effect at one place, as the engine may try it: its term, parameters, starts, and what is known of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Candidate:
    """One effect at one place: ``make(psi)`` gives the term for parameter values ``psi`` (dict).

    ``family`` is the name that a verdict may give, ``where`` the place scanned, ``frame`` what it is fixed to,
    ``scanned`` how many places the family has; ``starts`` are parameter sets that do not depend on the base fit;
    with ``start_from_base`` off the nuisances, too, start from their priors; ``always``: tried on the cheap
    observations at every place, whatever the residual promises; families with the same word are alike there;
    ``least``: distance of the first ``sized`` parameters from neutral below which nobody would act, and which it has to
    exceed by ``sure`` standard errors of the first; ``even``: the cheap observations hardly tell a value from its
    mirror image about neutral; ``twin``: nuisance that hides it, which would have ``twin_sd`` with the effect;
    ``from_twin`` makes the first parameter of it, None: its exponential.
    ``parameters`` have name, unit, neutral, bounds and prior as ``turnout.physics.Parameter``.
    One found by a look at the residual has the gain it promises [nats] in ``promise``, starts as it is, from the
    nuisances ``begin``; ``aside`` is evidence from data that are no observations [nats], of a ``sounding`` one so much
    its own that it need not explain what the observations miss.
    ``kin``: laws of one part; where one leads at a place, all with that word are refitted there. ``limit`` is the
    family that it cannot be told from at the lower bound of its first parameter; ``plain`` is (family, k): where its
    first parameter does not matter it is that law, of the size of its k-th; ``open_as`` is the family that shows the
    same where its first parameter is only known from below. ``whole``: its response turns with its
    size, so that a start promises what it is and says nothing of a larger or smaller one.
    ``loose`` is the share by which the size of an effect errs since its law is not quite the one out there; an
    ``exact`` one is what it says (a gain, a lag, a place): nothing that it leaves is due to its shape. ``told_by`` is a
    kind of observations that must speak for it, too: to all others it is another law; ``unopposed`` names observations
    that together must not speak against it. ``leaves_nothing``: one that may bend what a channel shows into much else,
    and is therefore named only where it leaves no more than sound turnouts do.
    """

    family: str
    parameters: tuple
    make: Callable[[Mapping[str, float]], object]
    starts: tuple[tuple[float, ...], ...]
    where: Mapping[str, object] = field(default_factory=dict)
    frame: str = ""
    scanned: int = 1
    start_from_base: bool = True
    always: str = ""
    least: float = 0.0
    even: bool = False
    twin: str = ""
    twin_sd: float = 0.7
    from_twin: Callable[[float], float] | None = None
    promise: float | None = None
    begin: Mapping[str, float] = field(default_factory=dict)
    aside: float = 0.0
    sounding: bool = False
    loose: float = 0.0
    exact: bool = False
    told_by: str = ""
    unopposed: tuple[str, ...] = ()
    kin: str = ""
    limit: str = ""
    plain: tuple = ()
    open_as: str = ""
    whole: bool = False
    leaves_nothing: bool = False
    sized: int = 1
    sure: float = 0.0

    @property
    def key(self):
        """Family and place in one word."""
        place = ",".join(f"{k}={v}" for k, v in sorted(self.where.items()))
        return f"{self.family}[{place}]" if place else self.family

    @property
    def part(self):
        """(kin, place or sensor): what it is a law of."""
        return self.kin, self.where.get("place", self.where.get("sensor"))

    @property
    def neutral(self):
        """(n_parameter,) values at which the term vanishes."""
        return np.array([p.neutral for p in self.parameters])

    def mirrored(self, values):
        """``values`` (n_parameter,) with the first parameter on the other side of neutral."""
        found = np.array(values, dtype=float)
        found[0] = 2.0 * self.parameters[0].neutral - found[0]
        return found

    def term(self, values):
        """The term with parameters (n_parameter,)."""
        return self.make({p.name: float(v) for p, v in zip(self.parameters, values)})
