"""What each step of a diagnosis needs: the case, its settings, and the fits that were computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, MutableMapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.search_limit import check_limit
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score


def _report_nothing(n_done: int, total: int, key: str) -> None:
    """Progress that is not reported."""


@dataclass(frozen=True)
class Search:
    """What every step of a diagnosis needs.

    Attributes
    ----------
    case : Case
        Observations, nuisances, simulator and candidates.
    settings : MismatchSettings
    store : mutable mapping
        Fits by key. A store on disk keeps those of an interrupted run.
    report : callable
        Called with (number done, total, key of the candidate) after every joint fit.
    label : str
        Effect that is sought, the first part of the keys of its fits.
    n_before : int or None
        Simulations that the case had cost when its search for effects began: from there its bound holds. None: in a
        fit without effects, which has no bound.
    """

    case: Case
    settings: MismatchSettings = field(default_factory=MismatchSettings)
    store: MutableMapping[str, Any] = field(default_factory=dict)
    report: Callable[[int, int, str], Any] = _report_nothing
    label: str = ""
    n_before: int | None = None

    @classmethod
    def of(
        cls,
        case: Case,
        settings: MismatchSettings | None = None,
        report: Callable[[int, int, str], Any] | None = None,
        store: MutableMapping[str, Any] | None = None,
    ) -> Search:
        """A search with the default for each argument that is None. Fits of a small case have more steps.

        Parameters
        ----------
        case : Case
        settings : MismatchSettings or None
        report : callable or None
            Called with (number done, total, key of the candidate).
        store : mutable mapping or None
            Fits by key.

        Returns
        -------
        Search
        """
        settings = settings or MismatchSettings()
        if not case.is_large:
            steps = THRESHOLDS.max_hammer_steps
            settings = replace(settings, base_iterations=steps, iterations=steps)
        return cls(case, settings, {} if store is None else store, report or _report_nothing)

    def with_label(self, label: str) -> Search:
        """The same search, for the fits of one effect.

        Parameters
        ----------
        label : str
            First part of the keys of these fits.

        Returns
        -------
        Search
        """
        return replace(self, label=label)

    def control_level(self, data_type: str) -> float:
        """Weighted mean square that controls reach in observations of one data type.

        Parameters
        ----------
        data_type : str

        Returns
        -------
        float
        """
        return self.case.control_level.get(data_type, self.settings.control_level)

    def fit(
        self,
        candidates: Iterable[Candidate],
        psi: np.ndarray,
        values: Mapping[str, float],
        reused_jacobian: list[np.ndarray] | None = None,
        stall: float = THRESHOLDS.stall,
        sought_cost: float = np.inf,
    ) -> Fit:
        """Joint fit of candidates from these parameters and nuisances, with the steps of a refit.

        Parameters
        ----------
        candidates : iterable of Candidate
        psi : (n_term,) array of float
        values : mapping
            Nuisance parameter -> value. Others start at their default.
        reused_jacobian : list of (n, p) array of float or None
            Nuisance columns that are updated instead of recomputed.
        stall : float
            Gain per sample that ends the fit of a large case.
        sought_cost : float
            The fit ends where its steps do not promise to reach it.

        Returns
        -------
        Fit

        Raises
        ------
        SimulationError
            If the model cannot be simulated at the start or beside it.
        SearchLimitError
            If the search is limited and the case has cost more simulations than it may.
        """
        if self.n_before is not None:
            check_limit(self.case, self.n_before)
        return fit_jointly(
            self.case, candidates, psi, values, reused_jacobian,
            iterations=self.settings.iterations, stall=stall, sought_cost=sought_cost,
        )  # fmt: skip

    def least_cost_of_interest(self, fit: Fit) -> float:
        """Cost that a candidate beside ``fit`` must reach to be of interest: a gain of half a threshold.

        Parameters
        ----------
        fit : Fit
            Without the candidate.

        Returns
        -------
        float
            Infinite for a small case, whose candidates are compared by held-out conditions.
        """
        return fit.cost - self.settings.threshold if self.case.is_large else np.inf

    def continue_fit(self, fit: Fit, stall: float = THRESHOLDS.stall) -> Fit:
        """The fit continued from where it is, with new derivatives.

        Parameters
        ----------
        fit : Fit
        stall : float
            Gain per sample that ends the fit of a large case.

        Returns
        -------
        Fit

        Raises
        ------
        SimulationError
            If the model cannot be simulated close to it.
        """
        return self.fit(fit.candidates, fit.psi, fit.values, stall=stall)

    def converge(self, fit: Fit) -> Fit:
        """The fit, continued until a round of steps gains less than a name needs. Each round has new derivatives.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        Fit
            The last one that could be simulated.
        """
        for _ in range(THRESHOLDS.max_rounds):
            try:
                before, fit = fit, self.continue_fit(fit, THRESHOLDS.fine_stall)
            except SimulationError:
                break
            if fit.evidence - before.evidence < self.settings.threshold:
                break
        return fit

    def with_jacobian(self, fit: Fit) -> Fit:
        """The fit, continued if it has no Jacobian.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        Fit
            Unchanged if the simulation fails close to it.
        """
        try:
            return fit if fit.jacobian else self.continue_fit(fit)
        except SimulationError:
            return fit

    def stored_fit(
        self, key: str, compute: Callable[[], Fit | None], candidates: Iterable[Candidate] = ()
    ) -> Fit | None:
        """A fit by its key, computed if the store lacks it.

        Parameters
        ----------
        key : str
        compute : callable
            () -> Fit, or None if the simulation fails.
        candidates : iterable of Candidate
            Those of the fit. They carry functions and are not stored.

        Returns
        -------
        Fit or None
        """
        if key not in self.store:
            fit = compute()
            self.store[key] = fit.with_candidates(()) if fit is not None else None
        stored = self.store[key]
        return None if stored is None else stored.with_candidates(candidates)

    def key_of(self, purpose: str, score: Score, fit: Fit) -> str:
        """Key of a further fit of a candidate.

        Parameters
        ----------
        purpose : str
            What the fit is for.
        score : Score
            Of the candidate.
        fit : Fit
            Without the candidate.

        Returns
        -------
        str
        """
        psi = tuple(np.round(score.fit.psi, 12))
        return f"{self.label}:{purpose}:{score.candidate.key}:{len(fit.candidates)}:{psi}"

    def prior_values(self) -> dict[str, float]:
        """Prior means of the shared nuisances that the base fit may have changed to hide an effect."""
        return {n.name: n.mean for n in self.case.nuisances if n.owner is None and n.can_mask}

    def with_updated_errors(self, fit: Fit) -> tuple[Search, Fit]:
        """Search and fit with errors of the observations as the model of the fit gives them, and fitted again.

        Parameters
        ----------
        fit : Fit

        Returns
        -------
        search : Search
        fit : Fit
            Both as they are if the case does not change, or if the simulation fails.
        """
        updated = self.case.with_updated_errors(fit)
        if updated is self.case:
            return self, fit
        search = replace(self, case=updated)
        key = f"renewed:{'+'.join(c.key for c in fit.candidates)}"
        try:
            refit = search.stored_fit(key, lambda: search.continue_fit(fit), fit.candidates)
        except SimulationError:
            return self, fit
        assert refit is not None
        return search, refit
