"""Cases: observations, nuisance parameters, candidate effects and a simulator. The engine knows nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case_check import checked_predictions
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.ambiguity import Ambiguity
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.residual_space import ResidualSpace

Values: TypeAlias = Mapping[str, float]  # nuisance parameters by name
Terms: TypeAlias = Sequence[Any]  # effects in the model, as ``Candidate.term`` gives them


class Case:
    """Base of all cases: give it observations, nuisances, candidates, and override ``predict``.

    Attributes
    ----------
    observations : tuple of Observation
        Those that are fitted.
    reserved : tuple of Observation
        Those that no fit uses. They may withdraw a name, and verify it.
    nuisances : tuple of Nuisance
    candidates : tuple of Candidate
    free_laws : tuple of Candidate
        Stiffness and damping of any form, by a few candidates without a meaning of their own. They are never named. A
        name beside which they still explain much of held-out recordings is withdrawn.
    is_large : bool
        Too large to refit every candidate from every start, as with simulated passages. Candidates are then chosen by
        their first-order changes and compared by evidence. Derivatives of the nuisances are updated by Broyden's
        formula, except for the observations for which ``is_hammer_test`` holds.
    reuses_derivatives : bool
        Derivatives of earlier points are used again. After a step that costs more, a fit then computes new ones before
        it tries smaller steps.
    max_simulations : int or None
        Simulations, beside those of the fit without effects, after which a search ends; None: no bound.
    start_values : mapping
        Values of nuisances where fits start, else their means.
    control_level : mapping
        Data type -> weighted mean square that controls, cases without an effect, reach. Else that of the settings.
    cell_level : mapping
        Data type -> the same for one channel of one recording.
    place_level : float
        Evidence that residuals of cases without an effect reach for a position. [nats]
    disturbed_recordings : tuple
        Recordings that are not used, since a source other than the known inputs shows in them.
    mismatched_trains : tuple of str
        Trains, most recordings of which do not agree with their vehicle file.
    no_train_matches : bool
        Several trains were recorded, and none agrees with its simulation: no recording of a train is fitted.
    reservation : str
        Why diagnoses of such a case are not proven on concealed data; "" where they are. Its names are withheld.
    measured_range : (float, float)
        First and last measured position. [m]
    """

    observations: tuple[Observation, ...] = ()
    reserved: tuple[Observation, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    free_laws: tuple[Candidate, ...] = ()
    is_large = False
    reuses_derivatives = False
    max_simulations: int | None = None
    start_values: Values = {}
    control_level: Mapping[str, float] = {}
    cell_level: Mapping[str, float] = {}
    place_level: float = 0.0
    disturbed_recordings: tuple = ()
    mismatched_trains: tuple = ()
    no_train_matches: bool = False
    reservation: str = ""
    measured_range = (-np.inf, np.inf)

    @property
    def n_simulations(self) -> int:
        """Simulations that the case has cost so far; 0 for a case without a bound."""
        return 0

    def is_hammer_test(self, observation: Observation) -> bool:
        """Whether an observation is a hammer test: its derivatives are computed again at every step of a fit.

        Parameters
        ----------
        observation : Observation

        Returns
        -------
        bool
        """
        return False

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions of observations.

        Parameters
        ----------
        values : mapping
            Nuisance parameter -> value.
        terms : sequence
            Effects in the model, as ``Candidate.term`` gives them.
        observations : sequence of Observation
            Fitted or reserved ones.

        Returns
        -------
        list of (n,) array of float
            One per observation, in the unit of its data.

        Raises
        ------
        SimulationError
            If the model cannot be simulated with these values.
        """
        raise NotImplementedError

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions a small step from known ones, for derivatives.

        Parameters
        ----------
        values : mapping
            Nuisance parameter -> value.
        terms : sequence
            Effects for which the predictions are known.
        new : sequence
            The same effects with one parameter changed.
        observations : sequence of Observation
        predictions : sequence of (n,) array of float
            Those with ``terms``.

        Returns
        -------
        list of (n,) array of float
            One per observation.

        Raises
        ------
        SimulationError
            If the model cannot be simulated with these values.
        """
        return self.predict(values, new, observations)

    def nuisance_jacobian(
        self, values: Values, terms: Terms, observations: Sequence[Observation], base: Sequence[np.ndarray]
    ) -> list[np.ndarray]:
        """Derivatives of predictions by all nuisances, by forward differences unless a case overrides this.

        Nuisances of different owners are shifted together: one prediction serves them all.

        Parameters
        ----------
        values : mapping
            Nuisance parameter -> value.
        terms : sequence
            Effects in the model.
        observations : sequence of Observation
        base : sequence of (n,) array of float
            Predictions at these values.

        Returns
        -------
        list of (n, n_nuisance) array of float
            One per observation.

        Raises
        ------
        SimulationError
            If the model cannot be simulated a step away.
        """
        groups: dict[object, list[int]] = {}
        last_rank: dict[str, int] = {}
        for k, nuisance in enumerate(self.nuisances):
            if nuisance.owner is None:
                groups[nuisance.name] = [k]
            else:
                rank = last_rank[nuisance.owner] = last_rank.get(nuisance.owner, -1) + 1
                groups.setdefault(("own", rank), []).append(k)
        jacobians = [np.zeros((o.data.size, len(self.nuisances)), order="F") for o in observations]
        for members in groups.values():
            shifted = dict(values)
            for k in members:
                shifted[self.nuisances[k].name] += THRESHOLDS.nuisance_step * self.nuisances[k].sd
            predicted = checked_predictions(observations, self.predict(shifted, terms, observations))
            for k in members:
                nuisance = self.nuisances[k]
                for o, new, old, jacobian in zip(observations, predicted, base, jacobians):
                    if nuisance.owner in (None, o.name):
                        jacobian[:, k] = (new - old) / (THRESHOLDS.nuisance_step * nuisance.sd)
        return jacobians

    def own_jacobian(
        self, values: Values, terms: Terms, observation: Observation, predicted: np.ndarray, names: Sequence[str]
    ) -> np.ndarray:
        """Derivatives of an observation by the nuisances that it owns.

        Parameters
        ----------
        values : mapping
            Nuisance parameter -> value.
        terms : sequence
            Effects in the model.
        observation : Observation
        predicted : (n,) array of float
            Its prediction at these values.
        names : sequence of str
            Nuisances of the observation.

        Returns
        -------
        (n, n_name) array of float

        Raises
        ------
        SimulationError
            If the model cannot be simulated a step away.
        """
        full = self.nuisance_jacobian(values, terms, [observation], [predicted])[0]
        order = [n.name for n in self.nuisances]
        return full[:, [order.index(name) for name in names]]

    def screen(self, fit: Fit) -> dict[tuple[str, int], list[np.ndarray]]:
        """Columns of candidates at their starts, from which a shortlist estimates their gain.

        Parameters
        ----------
        fit : Fit
            The fit whose residual is to be explained.

        Returns
        -------
        dict
            (key of the candidate, number of the start) -> changes (n,) of each observation. Candidates without a
            column are predicted.
        """
        return {}

    def residual_candidates(self, fit: Fit) -> Sequence[Candidate]:
        """Candidates that only the residual of a fit suggests.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        sequence of Candidate
            They are tested beside ``candidates``.
        """
        return ()

    def finer_candidates(self, candidate: Candidate) -> Sequence[Candidate]:
        """Positions between those of ``candidates`` at which the effect of a leader is tried as well.

        Parameters
        ----------
        candidate : Candidate

        Returns
        -------
        sequence of Candidate
        """
        return ()

    def ambiguity(self) -> Ambiguity | None:
        """Something that the recordings show and cannot tell what it is; None by default."""
        return None

    def tolerated_effects(self, fit: Fit) -> Sequence[Candidate]:
        """Effects that a wide tolerance of the base model hides, although their size is a finding.

        Parameters
        ----------
        fit : Fit
            Without effects.

        Returns
        -------
        sequence of Candidate
            Each with the parameter that masks it, and the nuisances from which its fit starts.
        """
        return ()

    def distant_starts(self, fit: Fit) -> Iterable[tuple[Candidate, tuple[float, ...]]]:
        """Starts too far from neutral for a column: predicted, with the masking parameter at its mean.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        iterable of (Candidate, tuple of float)
        """
        return ()

    def with_broad_errors(self) -> Case:
        """The same case with large independent errors: its optimum has a wide basin."""
        return self

    def hammer_positions(self) -> dict[str, float]:
        """Condition -> position of the impacts [m], for hammer tests."""
        return {}

    def changes_by_line(self, changes: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """Changes of hammer tests, one place for each channel and line that any of them has.

        Parameters
        ----------
        changes : sequence of (n,) array of float
            One for each of the ``observations``.

        Returns
        -------
        dict of str to (m,) array of float
            Condition -> changes, nan where a test has no such line.
        """
        return {}

    def with_updated_errors(self, fit: Fit) -> Case:
        """The same case with errors of its observations as the model of a fit gives them.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        Case
            Itself if nothing changes.
        """
        return self

    def hammer_case(self) -> Case | None:
        """A case of the hammer tests alone, with the same shared nuisances. None if there are none."""
        return None

    def residual_spaces(self, fit: Fit) -> Iterable[ResidualSpace]:
        """Subspaces of the observations to which a cause may be fixed.

        Parameters
        ----------
        fit : Fit
            The fit whose residual is to be located.

        Returns
        -------
        iterable of ResidualSpace
            None by default.
        """
        return ()

    def latent_covariates(self, fit: Fit) -> dict[str, Any] | None:
        """Covariates of the latent force, by which its law is sought.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        dict or None
            Name -> (n,) values, with "force" and its "unit". None if the case has no such view.
        """
        return None

    def numerical_error(self, fit: Fit) -> list[np.ndarray] | None:
        """Numerical error of each observation's prediction.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        list of (n,) array of float, or None
            In the unit of the data; None if predictions are exact.
        """
        return None
