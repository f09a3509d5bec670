"""Hammer tests and passages of one turnout as a case for the engine."""

from copy import copy
from dataclasses import replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.case import Case, Nuisance
from turnout.mismatch.engine.map_fit import MAX_CHEAP_STEPS, fit_jointly
from turnout.mismatch.turnout import passage_model, passage_observation, sensitivity
from turnout.mismatch.turnout.candidates.catalogue import MODEL_ERROR_SHARE, distant_mass_starts, list_candidates
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.observations import (
    hammer_observations,
    mismatched_trains,
    passage_observations,
    with_errors,
    without_disturbed,
)
from turnout.mismatch.turnout.prediction import TrackPredictor
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.saturation import raw_peak, saturated_channels, without_saturated
from turnout.mismatch.turnout.track_parameters import SEAT_SD, rail_sds, track_nuisances, with_rail, zone_of
from turnout.mismatch.turnout.wheel_roughness import log_mass_ratios

GAIN_SD = 0.02  # relative standard deviation of the gain of a sensor
TEMPERATURE_EFFECT, MIN_TEMPERATURE_RANGE = "pad_temperature", 4.0  # [-, K]; at 1 % per kelvin: 2 % of frequency
# Change of ln unsprung mass, or of a rail value, above which errors are computed again. The response to
# roughness near the P2 resonance then changes by a fifth of its amplitude.
UPDATE_THRESHOLD = 0.15


class TrackCase(TrackPredictor, Case):
    """``Case`` of a ``CampaignInput``.

    ``families`` restricts the candidates, ``solver`` gives the settings of the simulation used in fits.
    """

    expensive = True
    saturated: dict = {}
    log_mass_ratios: dict = {}

    def __init__(self, campaign, settings=None, families=None, solver=None):
        settings = settings or MismatchSettings()
        self.saturated = saturated_channels(campaign, settings.threshold)
        self._prepare(without_saturated(campaign, self.saturated), settings, solver or passage_model.Track1D())
        recordings, self.start_values, reserved = list(hammer_observations(self)), {}, set(campaign.reserved)
        self.start_values = self._fit_hammer_start([o for name, o in recordings if name not in reserved])
        recordings += without_disturbed(self, list(passage_observations(self)))
        self.low_passed.clear()
        self.mismatched_trains = mismatched_trains(self)
        if not recordings:
            raise SimulationError("nothing to diagnose: " + "; ".join(self.notes))
        self.observations = tuple(o for name, o in recordings if name not in reserved)
        self.reserved = tuple(o for name, o in recordings if name in reserved)
        if not self.observations:
            raise SimulationError("every recording is reserved for the verification: nothing is left to fit.")
        self.nuisances = tuple(self.all_nuisances())
        self.candidates = tuple(
            c
            for c in list_candidates(self, families)
            if c.family != TEMPERATURE_EFFECT or self._has_temperature_range()
        )
        self.families = families

    def _has_temperature_range(self):
        """Whether every recording has a rail temperature and these differ by ``MIN_TEMPERATURE_RANGE``.

        Otherwise temperature could explain any difference between recordings.
        """
        conditions = [p.conditions for p in self.frf_pairs.values()] + [
            self.conditions_of(aligned) for aligned in self.aligned_passages.values()
        ]
        temperatures = [condition.get("rail_temperature") for condition in conditions]
        return None not in temperatures and max(temperatures) - min(temperatures) >= MIN_TEMPERATURE_RANGE

    def _fit_hammer_start(self, observations):
        """Values of the nuisances of track and sensors from the hammer tests alone: the start of all fits."""
        self.nuisances, self.observations = tuple(self.all_nuisances()), tuple(observations)
        if not observations:
            return {}
        rough_fit = fit_jointly(HammerCase(self).with_broad_errors(), iterations=MAX_CHEAP_STEPS)
        self.start_values = rough_fit.values
        self.recentre(rough_fit.values)
        values = fit_jointly(HammerCase(self), values=rough_fit.values, iterations=MAX_CHEAP_STEPS).values
        self.recentre(values)
        return values

    def _prepare(self, campaign, settings, solver):
        """Set up everything that does not depend on recordings."""
        self.settings, self.solver, self.campaign = settings, solver, campaign
        self.nominal, self._rail_tracks = zone_of(campaign.turnout, campaign.positions()), {}
        self.recentre({})
        self.trains = tuple(dict.fromkeys(p.train or p.name for p in campaign.passages))
        self.frf_pairs, self.aligned_passages, self.unmatched_aligned, self.low_passed, self.unmatched, self.notes = (
            {},
            {},
            {},
            {},
            [],
            [],
        )
        self.waves = self._rail_waves()
        routes = {p.route: None for p in campaign.passages}
        self.surface = self.waves and RunningSurface(self.nominal.turnout, self.waves, routes)

    def recentre(self, values):
        """Linearise receptances about the rail given by ``values``, and clear the caches.

        Receptances are linear in deviations of the rail from there.
        """
        self.rail = {name: values.get(name, 0.0) for name in rail_sds(self.nominal)}
        self.zone = with_rail(self.nominal, self.rail)
        self._clear_caches()

    def hammer_positions(self):
        """Condition -> position of the impacts [m], for hammer tests."""
        return {o.condition: self.frf_pairs[o.name].test.place for o in self.observations if o.name in self.frf_pairs}

    def fitted_passages(self):
        """``AlignedPassage`` of each passage that is fitted; reserved passages may not suggest a candidate."""
        return [self.aligned_passages[o.name] for o in self.observations if o.name in self.aligned_passages]

    def band_peak(self, channel):
        """Largest value of a channel in the passages, within their band; 0 where it has none. [m/s²]"""
        peaks = [0.0]
        for o in self.observations:
            aligned = self.aligned_passages.get(o.name)
            names = [s.name for s in aligned.sensors] if aligned else []
            if channel in names:
                peaks.append(float(np.max(np.abs(o.data.reshape(len(names), -1)[names.index(channel)]))))
        return max(peaks)

    def raw_peak(self, channel):
        """Largest value of a channel at its full sampling rate, reserved recordings included. [m/s²]"""
        return raw_peak(self.campaign, channel)

    def _rail_waves(self):
        if not self.campaign.passages:
            return None
        offset = self.campaign.turnout.roughness_level
        return Waves([s.place for s in self.campaign.sensors], 0.0 if offset is None else offset)

    def all_nuisances(self):
        """All nuisances of track, trains, sensors, rail roughness and passages."""
        yield from track_nuisances(self.zone, self.trains)
        for sensor in self.campaign.sensors:
            yield Nuisance(
                f"gain_{sensor.name}", "-", 0.0, GAIN_SD, meaning="gain of a sensor less one", can_mask=False
            )
            if not sensor.mounting.startswith("sleeper"):
                yield Nuisance(f"seat_{sensor.name}", "m", 0.0, SEAT_SD, meaning="place of a sensor less its file's")
        if self.waves:
            yield from self.waves.nuisances()
            yield from self.surface.nuisances()
        for aligned in self.aligned_passages.values():
            yield from passage_observation.passage_nuisances(aligned.passage)

    @property
    def measured_range(self):
        """First and last position of sensors and impacts [m]."""
        positions = self.campaign.positions()
        return min(positions), max(positions)

    @property
    def control_level(self):
        """Level that controls reach, by kind of observation."""
        return {"hammer": self.settings.hammer_control, "passage": self.settings.passage_control}

    @property
    def cell_level(self):
        """Level that one channel of one passage reaches in controls."""
        return {"passage": self.settings.cell_control}

    def cheap_case(self):
        """Case of the hammer tests alone; None without hammer tests."""
        return HammerCase(self) if self.frf_pairs else None

    def is_cheap(self, observation):
        """Hammer tests are cheap to predict; passages have to be simulated."""
        return observation.name in self.frf_pairs

    def own_jacobian(self, values, terms, observation, predicted, names):
        """Derivatives of a passage by its own time, speed and load."""
        return sensitivity.own_jacobian(self, values, terms, observation, predicted, names)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Derivatives by all nuisances, see ``sensitivity.nuisance_jacobian``."""
        return sensitivity.nuisance_jacobian(self, values, terms, observations, base)

    def with_updated_errors(self, fit):
        """The case with the rail under the passages and the roughness errors of the wheels as ``fit`` has them.

        Returns the case itself where all changes are within ``UPDATE_THRESHOLD``. The rail was first fitted to the
        hammer tests alone, where it may have absorbed part of the effect that ``fit`` explains now.
        """
        ratios = log_mass_ratios(self, fit) if self.aligned_passages else {}
        changed = {
            train: m for train, m in ratios.items() if abs(m - self.log_mass_ratios.get(train, 0.0)) > UPDATE_THRESHOLD
        }
        rail_changed = bool(self.aligned_passages) and any(
            abs(fit.values[n] - at) > UPDATE_THRESHOLD for n, at in self.rail.items()
        )
        if not changed and not rail_changed:
            return self
        updated = copy(self)
        updated.log_mass_ratios = {**self.log_mass_ratios, **changed}
        if rail_changed:
            updated.recentre(fit.values)
        values = {**fit.values, **{f"wheels_{train}": m for train, m in updated.log_mass_ratios.items()}}

        def with_new_errors(o):
            aligned = self.aligned_passages.get(o.name)
            return (
                with_errors(updated, values, aligned, o)
                if aligned and (rail_changed or self.conditions_of(aligned)["train"] in changed)
                else o
            )

        updated.observations, updated.reserved = (
            tuple(map(with_new_errors, o)) for o in (self.observations, self.reserved)
        )
        return updated

    def residual_candidates(self, fit):
        """Dips, corrugation and wheel defects, as the residual and the sound level of passages suggest them."""
        from turnout.mismatch.turnout.candidates.rail_defects import scan_geometry

        has_passages = any(o.name in self.aligned_passages for o in self.observations)
        candidates = scan_geometry(self, fit, self.families) if has_passages else ()
        return tuple(replace(c, model_error_share=MODEL_ERROR_SHARE) for c in candidates)

    def distant_starts(self, fit):
        """Wheelsets of other masses, for trains whose residual exceeds the control level."""
        return distant_mass_starts(self, fit)

    def screen(self, fit):
        """Linear columns of the candidates that have one."""
        from turnout.mismatch.turnout.screening import screen_columns

        return screen_columns(self, fit, self.observations)

    def residual_spaces(self, fit):
        """Subspaces of the residual: forces at supports, faults of channels, wheels and single passages."""
        from turnout.mismatch.turnout.residual_spaces import source_spaces

        return source_spaces(self, fit)

    def latent_covariates(self, fit):
        """Missing force at the support that explains most of the residual."""
        from turnout.mismatch.turnout.force_reconstruction import latent_force

        return latent_force(self, fit)
