"""Hammer tests and passages of one turnout as a case for the engine."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.turnout import sensitivity
from turnout.mismatch.turnout.accepted_effects import NO_EFFECTS, AcceptedEffect, AcceptedEffects, effects_on
from turnout.mismatch.turnout.campaign import CampaignInput
from turnout.mismatch.turnout.candidates.catalogue import distant_starts, finer_candidates, is_testable, list_candidates
from turnout.mismatch.turnout.case_data import CaseData, case_data
from turnout.mismatch.turnout.channel_lines import line_without_wheel
from turnout.mismatch.turnout.disturbances import independent_of_trains
from turnout.mismatch.turnout.hammer_case import HammerCase, hammer_case
from turnout.mismatch.turnout.observed_passages import with_errors
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.predicted_case import PredictedCase
from turnout.mismatch.turnout.prediction import PredictionCache, Predictor, no_cache
from turnout.mismatch.turnout.predictions import Terms, Values
from turnout.mismatch.turnout.priors import CASE, SIMULATION
from turnout.mismatch.turnout.receptance_observation import LINES
from turnout.mismatch.turnout.unmet_requirements import UnmetRequirement, unmet_requirements
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.mismatch.turnout.wheel_impacts import wheel_impacts
from turnout.mismatch.turnout.wheel_roughness import log_mass_ratios
from turnout.mismatch.turnout.worn_nose import worn_noses
from turnout.physics import RailCorrugation


class TrackCase(PredictedCase):
    """Case of a ``CampaignInput``.

    Parameters
    ----------
    campaign : CampaignInput
    settings : MismatchSettings or None
        None: the defaults.
    families : collection of str or None
        Effects to which the candidates are restricted; None: all.
    solver : Track1D or None
        Settings of the simulation used in fits.
    accepted : iterable of AcceptedEffect
        Effects of the track's file. Every prediction contains them, and their parameters are nuisances.
    cache : callable
        Makes the cache around the predictor of this case, and around that of its hammer tests.

    Raises
    ------
    SimulationError
        No recording can be used, or all of them are reserved.
    """

    is_large = True

    def __init__(
        self,
        campaign: CampaignInput,
        settings: MismatchSettings | None = None,
        families: Collection[str] | None = None,
        solver: Track1D | None = None,
        accepted: Iterable[AcceptedEffect] = (),
        cache: PredictionCache = no_cache,
    ):
        data, predictor = case_data(campaign, settings or MismatchSettings(), solver or Track1D())
        candidates = [c for c in list_candidates(data, families) if is_testable(data, c)]
        self._set_up(data, predictor, candidates, families, effects_on(predictor.track(), accepted), cache)

    def _set_up(
        self,
        data: CaseData,
        predictor: Predictor,
        candidates: Sequence[Candidate],
        families: Collection[str] | None = None,
        accepted: AcceptedEffects = NO_EFFECTS,
        cache: PredictionCache = no_cache,
    ) -> None:
        """Set all attributes. Accepted effects change the rail that hammer tests give: it is fitted again."""
        start_values = data.start_values
        if accepted.effects and any(o.name in data.frf_pairs for o in data.observations):
            values = hammer_case(data, predictor, candidates, accepted, cache).fit_from_priors().values
            start_values, predictor = {**start_values, **values}, predictor.recentre(values)
        nuisances = data.site.nuisances(a.passage for a in data.aligned_passages.values())
        super().__init__(predictor, data.observations, nuisances, candidates, accepted, cache(predictor, False))
        self.data, self.families, self.cache, self.start_values = data, families, cache, start_values
        self.reserved, self.disturbed_recordings = data.reserved, independent_of_trains(data.disturbed)
        self.reuses_derivatives = any(sensitivity.is_in_switch(predictor, a) for a in data.aligned_passages.values())
        self.max_simulations = SIMULATION.max_in_switch if self.reuses_derivatives else None
        self.reservation = reservation(predictor.zone.turnout)
        self.mismatched_trains, self.no_train_matches = data.mismatched_trains, data.no_train_matches
        self.measured_range = data.measured_range
        self.control_level = {"hammer": data.settings.hammer_control, "passage": data.settings.passage_control}
        self.cell_level = {"passage": data.settings.cell_control}
        self.place_level = data.settings.place_control
        self.log_mass_ratios: Mapping[str, float] = {}

    @property
    def campaign(self) -> CampaignInput:
        """The campaign without saturated sensors."""
        return self.data.campaign

    @property
    def settings(self) -> MismatchSettings:
        """Settings of the diagnosis."""
        return self.data.settings

    @property
    def n_simulations(self) -> int:
        """Passages that were simulated so far for this site, without their alignment."""
        return self.predictor.site.count.n

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not used, and why."""
        return self.data.notes

    @property
    def unmet_requirements(self) -> tuple[UnmetRequirement, ...]:
        """Effects that these recordings cannot show, and which measurement could."""
        return unmet_requirements(self.data, self.families)

    @property
    def trains(self) -> tuple[str, ...]:
        """Types or numbers of the trains."""
        return self.data.site.trains

    def hammer_positions(self) -> dict[str, float]:
        """Condition -> position of the impacts [m], for hammer tests."""
        return {o.condition: self.frf_pairs[o.name].test.place for o in self.observations if o.name in self.frf_pairs}

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
        tests = [(o, change) for o, change in zip(self.observations, changes) if o.name in self.frf_pairs]
        seats = sorted({self.frf_pairs[o.name].seat for o, _ in tests})
        by_condition = {o.condition: np.full((len(seats), 2, LINES.size), np.nan) for o, _ in tests}
        for o, change in tests:
            pair = self.frf_pairs[o.name]
            by_condition[o.condition][seats.index(pair.seat)][:, pair.lines] = change.reshape(2, -1)
        return {condition: lines.ravel() for condition, lines in by_condition.items()}

    def fitted_passages(self) -> list[AlignedPassage]:
        """``AlignedPassage`` of each passage that is fitted; reserved passages may not suggest a candidate."""
        return [self.aligned_passages[o.name] for o in self.observations if o.name in self.aligned_passages]

    def hammer_case(self) -> HammerCase | None:
        """Case of the hammer tests alone; None without hammer tests."""
        if not any(o.name in self.frf_pairs for o in self.observations):
            return None
        return hammer_case(self.data, self.predictor, self.all_candidates, self.accepted, self.cache)

    def is_hammer_test(self, observation: Observation) -> bool:
        """Whether an observation is a receptance of a hammer test; passages have to be simulated.

        Parameters
        ----------
        observation : Observation
            A receptance or passage.

        Returns
        -------
        bool
        """
        return observation.name in self.frf_pairs

    def own_jacobian(
        self, values: Values, terms: Terms, observation: Observation, predicted: np.ndarray, names: Sequence[str]
    ) -> np.ndarray:
        """Derivatives of a passage by its own time, speed and load.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        observation : Observation
            A receptance or passage.
        predicted : (n,) array of float
            Prediction of the observation.
        names : sequence of str
            Names of the passage's own numbers.

        Returns
        -------
        (n, n_name) array of float
        """
        aligned = self.aligned_passages.get(observation.name)
        if aligned is None:
            return super().own_jacobian(values, terms, observation, predicted, names)
        all_terms = (*self.accepted.terms(values), *terms)
        columns = dict(sensitivity.own_columns(self.predictor, values, all_terms, aligned, predicted))
        return np.column_stack([columns[name] for name in names])

    def with_updated_errors(self, fit: Fit) -> TrackCase:
        """The case with the rail under the passages and the roughness errors of the wheels as ``fit`` has them.

        Returns the case itself where all changes are within ``CASE.update_threshold``. The rail was first fitted to
        the hammer tests alone, where it may have absorbed part of the effect that ``fit`` explains now.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        TrackCase
        """
        if not self.aligned_passages:
            return self
        ratios = log_mass_ratios(*self.with_fixed_effects(fit))
        changed = {
            train: m
            for train, m in ratios.items()
            if abs(m - self.log_mass_ratios.get(train, 0.0)) > CASE.update_threshold
        }
        rail_changed = any(abs(fit.values[n] - at) > CASE.update_threshold for n, at in self.predictor.rail.items())
        if not changed and not rail_changed:
            return self
        updated = copy(self)
        updated.log_mass_ratios = {**self.log_mass_ratios, **changed}
        if rail_changed:
            updated.predictor = self.predictor.recentre(fit.values)
            updated.predictions = self.cache(updated.predictor, False)
        values = {**fit.values, **{f"wheels_{train}": m for train, m in updated.log_mass_ratios.items()}}

        def with_new_errors(o: Observation) -> Observation:
            aligned = self.aligned_passages.get(o.name)
            if aligned is None or not (rail_changed or aligned.conditions["train"] in changed):
                return o
            return with_errors(updated.predictor, values, aligned, o)

        updated.observations = tuple(map(with_new_errors, self.observations))
        updated.reserved = tuple(map(with_new_errors, self.reserved))
        return updated

    def residual_candidates(self, fit: Fit) -> tuple[Candidate, ...]:
        """Dips, corrugation and wheel defects, as the residual and the sound level of passages suggest them.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        tuple[Candidate, ...]
        """
        from turnout.mismatch.turnout.candidates.rail_defects import scan_geometry

        if not self.fitted_passages():
            return ()
        return self.accepted.without(scan_geometry(*self.with_fixed_effects(fit), self.families))

    def finer_candidates(self, candidate: Candidate) -> tuple[Candidate, ...]:
        """An effect between supports at every quarter of the bays beside the candidate.

        Parameters
        ----------
        candidate : Candidate
            A leader.

        Returns
        -------
        tuple[Candidate, ...]
        """
        return finer_candidates(self.data, candidate)

    def ambiguity(self) -> Ambiguity | None:
        """The likeliest of impacts of wheels, a line in the level of all passages and one of a channel; else None."""
        from turnout.mismatch.turnout.candidates.short_corrugation import ambiguous_line

        has_corrugation = self.families is None or RailCorrugation.name in self.families
        possible = (wheel_impacts(self), ambiguous_line(self) if has_corrugation else None, line_without_wheel(self))
        return max((a for a in possible if a is not None), key=lambda a: a.nats, default=None)

    def tolerated_effects(self, fit: Fit) -> tuple[Candidate, ...]:
        """Worn noses: dips of the file that are certainly much deeper than it says.

        Parameters
        ----------
        fit : Fit
            Without effects.

        Returns
        -------
        tuple[Candidate, ...]
        """
        surface = self.predictor.site.surface
        if not surface or not surface.parameters or not self.fitted_passages():
            return ()
        noses = worn_noses(surface, surface.estimate(self, fit), fit)
        return self.accepted.without(c for c in noses if self.families is None or c.family in self.families)

    def distant_starts(self, fit: Fit) -> list[tuple[Candidate, tuple[float, ...]]]:
        """Wheelsets of other masses, for trains whose residual exceeds the control level.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        list[tuple[Candidate, tuple[float, ...]]]
        """
        return distant_starts(self, fit)

    def residual_spaces(self, fit: Fit) -> Iterator[ResidualSpace]:
        """Subspaces of the residual: forces at supports, faults of channels, wheels and single passages.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Yields
        ------
        Iterator[ResidualSpace]
            Subspaces of the residual: forces at supports, faults of channels, wheels and single passages.
        """
        from turnout.mismatch.turnout.residual_spaces import source_spaces

        return source_spaces(self, fit)

    def latent_covariates(self, fit: Fit) -> dict[str, Any] | None:
        """Missing force at the support that explains most of the residual.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        dict[str, Any] or None
        """
        from turnout.mismatch.turnout.force_reconstruction import latent_force

        return latent_force(self, fit)

    def numerical_error(self, fit: Fit) -> list[np.ndarray] | None:
        """Difference of each prediction to one with half the step and half the mesh; None without passages.

        It is 0 for hammer tests and where the finer simulation fails. The mesh stays where pads are spread
        over nodes.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        list of (n,) array of float or None
        """
        if not self.aligned_passages:
            return None
        errors = []
        for o, predicted in zip(self.observations, fit.predictions):
            aligned = self.aligned_passages.get(o.name)
            refined = predicted if aligned is None else self._refined_prediction(fit, aligned, predicted)
            errors.append(refined - predicted)
        return errors

    def _refined_prediction(self, fit: Fit, aligned: AlignedPassage, predicted: np.ndarray) -> np.ndarray:
        """Prediction of a passage with half the step and half the mesh; ``predicted`` if that fails."""
        solver = self.predictor.solver
        fine_solver = Track1D(
            2.0 * solver.rate, solver.scheme, 2 * (solver.elements or 2 * SIMULATION.elements_per_bay)
        )
        try:
            return self.predictor.with_solver(fine_solver).predict_passage(fit.values, self.all_terms(fit), aligned)
        except SimulationError:
            return predicted
