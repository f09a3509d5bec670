r"""Slide chairs that open under the impacts of a hammer test.

A blade rests on its chairs by its weight, some 300 N a bay. Under an impact of 10 kN a bearer moves down faster than
the blade falls, and the chair opens. Receptances are linear: their chairs are closed. What the opening chairs change is
simulated in time, once with chairs that press and once with chairs that also pull, under the measured force of a
typical impact:

.. math:: \Delta H = -\frac{A_\mathrm{press} - A_\mathrm{pull}}{\omega^2 F}

The change errs with gaps and weights of chairs that nobody measures. A chair that is open anyway has neither force.

References
----------
Chairs that press and do not pull: Bruni et al. 2009, Vehicle System Dynamics 47.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.priors import RECEPTANCE, SIMULATION
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.mismatch.turnout.receptance_observation import SHIFTED_LINES
from turnout.physics.slide_chair_gap import SlideChairGap
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Probe, run

if TYPE_CHECKING:
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.physics.term import PhysicsTerm
    from turnout.records import Impact
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.track import Track


@dataclass(frozen=True)
class ChairTest:
    """Hammer test over chairs: a typical ``impact`` at ``position`` [m], and ``probes`` by the names of its pairs."""

    impact: Impact
    position: float
    probes: dict[str, Probe]


@dataclass(frozen=True)
class LiftingChairs:
    """Changes of receptances by chairs that open, on one ``track`` with a blade, for all ``tests``.

    ``changes`` caches them: supports of chairs without contact -> name of a pair -> change.
    """

    track: Track
    tests: tuple[ChairTest, ...]
    changes: dict[tuple[int, ...], dict[str, np.ndarray]] = field(default_factory=dict, compare=False)

    def change(self, pair: FrfPair, terms: Iterable[PhysicsTerm]) -> np.ndarray:
        """Change of the receptance of a pair.

        Parameters
        ----------
        pair : FrfPair
            Response channel of a hammer test.
        terms : iterable of PhysicsTerm
            Effects; a chair with a gap of at least the smallest reportable one has no contact under an impact.

        Returns
        -------
        (n_line,) array of complex
            On the lines of hammer tests. [m/N]

        Raises
        ------
        SimulationError
            If an impact cannot be simulated.
        """
        gaps = [t for t in terms if isinstance(t, SlideChairGap) and t.gap >= SlideChairGap.smallest_reportable]
        free = tuple(sorted({t.support for t in gaps}))
        if free not in self.changes:
            self.changes[free] = self._simulate(free)
        return self.changes[free][pair.name]

    def difference(self, pair: FrfPair, terms: Sequence[PhysicsTerm], added: PhysicsTerm) -> np.ndarray | float:
        """How a further term alters ``change``.

        Parameters
        ----------
        pair : FrfPair
            Response channel of a hammer test.
        terms : sequence of PhysicsTerm
            Effects without it.
        added : PhysicsTerm
            The further one.

        Returns
        -------
        (n_line,) array of complex, or float
            0 unless it takes the contact of a chair. [m/N]

        Raises
        ------
        SimulationError
            If an impact cannot be simulated.
        """
        if not isinstance(added, SlideChairGap):
            return 0.0
        return self.change(pair, (*terms, added)) - self.change(pair, terms)

    def _simulate(self, free: tuple[int, ...]) -> dict[str, np.ndarray]:
        """Changes of all pairs, with chairs without contact on the supports ``free``."""
        terms = tuple(SlideChairGap(j, SlideChairGap.parameters[0].bounds[1]) for j in free)
        pressing = _prepare_chairs(self.track, terms, linear=False)
        pulling = _prepare_chairs(self.track, terms, linear=True)
        changes: dict[str, np.ndarray] = {}
        for test in self.tests:
            change = receptance_change(pressing, pulling, test.impact, test.position, list(test.probes.values()))
            changes |= dict(zip(test.probes, change))
        return changes


def _prepare_chairs(track: Track, terms: Sequence[PhysicsTerm], linear: bool) -> Prepared:
    """The track with chairs that press, or with all chairs linear, as receptances have them."""
    matrices = linear_matrices(track, terms) if linear else matrices_of(track, tuple(terms))
    prepared = prepare(track, 1.0 / RECEPTANCE.lifting_rate, "radau", terms, SIMULATION.decay_exponent, matrices)
    return replace(prepared, track=track.with_(blade=None), terms=()) if linear else prepared


def lifting_chairs(track: Track, pairs: Iterable[FrfPair]) -> LiftingChairs | None:
    """Chairs of a track under the impacts of its hammer tests.

    Parameters
    ----------
    track : Track
        The track, with a blade or without.
    pairs : iterable of FrfPair
        Response channels of the hammer tests.

    Returns
    -------
    LiftingChairs or None
        None without a slide chair.
    """
    if track.blade is None or not track.blade.slide_chairs(track):
        return None
    by_test: dict[str, list[FrfPair]] = {}
    for pair in pairs:
        by_test.setdefault(pair.test.name, []).append(pair)
    tests = [
        ChairTest(group[0].typical_impact, group[0].test.place, {p.name: p.sensor.probe(track) for p in group})
        for group in by_test.values()
    ]
    return LiftingChairs(track, tuple(tests))


def receptance_change(
    pressing: Prepared, pulling: Prepared, impact: Impact, position: float, probes: Sequence[Probe]
) -> np.ndarray:
    """Change of receptances by chairs that open.

    Parameters
    ----------
    pressing, pulling : Prepared
        The track with chairs that only press, and with linear ones.
    impact : Impact
        Its force is applied as measured.
    position : float
        Of the impact. [m]
    probes : sequence of Probe
        Accelerations of the sensors.

    Returns
    -------
    (n_probe, n_line) array of complex
        On the lines of hammer tests. [m/N]

    Raises
    ------
    SimulationError
        If the impact cannot be simulated.
    """
    time = np.arange(impact.force.size) / impact.rate

    def force(t: np.ndarray) -> np.ndarray:
        return np.interp(t, time, impact.force)

    press, pull = (run(p, float(time[-1]), probes, pulses=[(position, force)]) for p in (pressing, pulling))
    kernel = np.exp(-2j * np.pi * SHIFTED_LINES[:, None] * press.time)
    spectrum = kernel @ force(press.time)
    return np.asarray(-((press.signals - pull.signals) @ kernel.T) / (spectrum * (2.0 * np.pi * SHIFTED_LINES) ** 2))


def count_alike(pair: FrfPair, pairs: Iterable[FrfPair], reserved: Collection[str]) -> int:
    """Number of tests that are fitted with impacts at the position of a pair and its sensor; the same chairs open.

    Parameters
    ----------
    pair : FrfPair
        Response channel of a hammer test.
    pairs : iterable of FrfPair
        Those of all tests, with this one.
    reserved : collection of str
        Tests that no fit uses.

    Returns
    -------
    int
        1 for a reserved test.
    """
    if pair.test.name in reserved:
        return 1
    alike = [p for p in pairs if (p.test.place, p.seat) == (pair.test.place, pair.seat)]
    return sum(p.test.name not in reserved for p in alike)


def with_lifting_error(observation: Observation, pair: FrfPair, change: np.ndarray, n_alike: int = 1) -> Observation:
    """The observation with the error of a change as modes: a share of its size, smooth over frequency.

    The same chairs open alike at each visit, so ``n_alike`` tests have one error in common.

    Parameters
    ----------
    observation : Observation
        Of the pair.
    pair : FrfPair
        Response channel of a hammer test.
    change : (n_line,) array of complex
        Change by chairs that open. [m/N]
    n_alike : int
        Tests with impacts at this position and this sensor.

    Returns
    -------
    Observation
        The same one where there is no change.
    """
    size = np.abs(receptance_observation.scale_lines(pair, change))
    if not np.any(size):
        return observation
    size = RECEPTANCE.lifting_error * receptance_observation.local_rms(pair.frequency, size)
    errors = size[:, None] * receptance_observation.smooth_functions(pair.frequency)
    split = receptance_observation.split_complex
    return observation.with_errors(np.column_stack([split(errors + 0j), split(1j * errors)]), n_alike)
