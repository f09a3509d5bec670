"""A case: conditions, inputs and outputs, a simulator, terms, nuisances. The engine knows nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from turnout.mismatch.candidate import Candidate
from turnout.mismatch.observation import Observation


@dataclass(frozen=True)
class Nuisance:
    """A number of the base model that is not exactly known, free under a normal prior.

    ``mean`` and ``sd`` of the prior in ``unit``; ``owner`` is the observation it belongs to, None where shared;
    ``trust`` the largest step in prior standard deviations; it ``bends`` where the base model may have bent it to hide
    an effect, as it may what the track is made of.
    """

    name: str
    unit: str
    mean: float
    sd: float
    owner: str | None = None
    bounds: tuple[float, float] = (-np.inf, np.inf)
    meaning: str = ""
    trust: float = 3.0
    bends: bool = True


class Case:
    """Base of all cases: give it observations, nuisances, candidates and override ``predict``.

    ``reserved`` are observations that no fit reads: they may withdraw a name, and verify it. ``frozen_jacobian`` tells
    the engine that a prediction is dear: the nuisances' derivatives are then kept and updated by Broyden's formula, but
    for observations that are ``cheap``. ``start_values`` are values of nuisances where fits start, else their means;
    ``control_level`` the weighted mean square by kind that cases without an effect reach, else that of the settings;
    ``cell_level`` the same for one channel of one recording, by kind;
    ``disturbed`` recordings not used, since something else than the known inputs shows in them (``track.quiet``);
    ``foreign`` trains, most recordings of which do not look as their description has it; ``measured`` the first and the
    last place where anything was [m].
    """

    observations: tuple[Observation, ...] = ()
    reserved: tuple[Observation, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    frozen_jacobian = False
    start_values: Mapping[str, float] = {}
    control_level: Mapping[str, float] = {}
    cell_level: Mapping[str, float] = {}
    disturbed: tuple = ()
    foreign: tuple = ()
    measured = (-np.inf, np.inf)

    def cheap(self, observation):
        """Derivatives of this observation cost next to nothing."""
        return False

    def predict(self, values, terms, observations):
        """List of (n,) predictions, one per observation; ``values`` are nuisances, ``terms`` the effects."""
        raise NotImplementedError

    def moved(self, values, terms, new, observations, predictions):
        """Predictions with ``new`` terms, a small step from ``terms`` with known ``predictions``: for derivatives."""
        return self.predict(values, new, observations)

    def nuisance_jacobian(self, values, terms, observations, base):
        """List of (n, n_nuisance) derivatives; by forward differences unless a case knows better.

        Nuisances owned by different observations are moved together: one prediction serves them all.
        """
        groups, seen = {}, {}
        for k, nuisance in enumerate(self.nuisances):
            if nuisance.owner is None:
                groups[nuisance.name] = [k]
            else:
                rank = seen[nuisance.owner] = seen.get(nuisance.owner, -1) + 1
                groups.setdefault(("own", rank), []).append(k)
        found = [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        for members in groups.values():
            moved = dict(values)
            for k in members:
                moved[self.nuisances[k].name] += 0.1 * self.nuisances[k].sd
            predicted = self.predict(moved, terms, observations)
            for k in members:
                nuisance = self.nuisances[k]
                for o, new, old, jacobian in zip(observations, predicted, base, found):
                    if nuisance.owner in (None, o.name):
                        jacobian[:, k] = (new - old) / (0.1 * nuisance.sd)
        return found

    def own_jacobian(self, values, terms, observation, predicted, names):
        """(n, n_name) derivatives of an observation by nuisances of its own."""
        full = self.nuisance_jacobian(values, terms, [observation], [predicted])[0]
        order = [n.name for n in self.nuisances]
        return full[:, [order.index(name) for name in names]]

    def screen(self, fit):
        """Columns for candidates at their starts, (key, start) -> list of (n,) per observation; those that are missing
        are predicted."""
        return {}

    def further(self, fit):
        """Candidates that only a look at the residual of ``fit`` suggests."""
        return ()

    def distant(self, fit):
        """(candidate, start) too far from neutral for what a column says: predicted, with the twin at its mean."""
        return ()

    def roughened(self):
        """The same case with broad, independent errors: its optimum has a wide basin."""
        return self

    def struck(self):
        """Condition -> where the hammer fell [m], for those that are hammer tests."""
        return {}

    def renewed(self, fit):
        """The same case with errors of its observations as the model of ``fit`` makes them; itself where they stay."""
        return self

    def cheap_part(self):
        """A case of the cheap observations alone, with the same shared nuisances; None where there is none."""
        return None

    def spaces(self, fit):
        """Subspaces of the observations that a cause could be locked to, ``spaces.Space``; none by default."""
        return ()

    def latent(self, fit):
        """Covariates of the latent force: name -> (n,), with "force"; None where the case has no such view."""
        return None

    def numerical_error(self, fit):
        """Own numerical error of each observation's prediction, list of (n,), or None where it is exact."""
        return None
