"""Hammer tests and passages of one turnout as a case for the engine."""

from copy import copy
from dataclasses import replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.case import Case, Nuisance
from turnout.mismatch.engine.map_fit import CHEAP_STEPS, fit_jointly
from turnout.mismatch.turnout import passage_model, passage_observation, sensitivity
from turnout.mismatch.turnout.candidates.catalogue import LOOSE, distant_wheels, library
from turnout.mismatch.turnout.hammer_case import Blows
from turnout.mismatch.turnout.observations import (
    foreign,
    hammer_observations,
    passage_observations,
    undisturbed,
    with_errors,
)
from turnout.mismatch.turnout.prediction import Predicting
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.saturation import ceilings, highest, within_range
from turnout.mismatch.turnout.track_parameters import SEAT_SD, rail_spreads, track_nuisances, with_rail, zone_of
from turnout.mismatch.turnout.wheel_roughness import heavier

GAIN_SD = 0.02  # relative standard deviation of the gain of a sensor
WARMTH, SPAN = "pad_temperature", 4.0  # [-, K]; at 1 % per kelvin: 2 % of frequency
# Change of ln unsprung mass, or of a rail value, above which errors are computed again. The response to
# roughness near the P2 resonance then changes by a fifth of its amplitude.
FOLLOWED = 0.15


class TrackCase(Predicting, Case):
    """``Case`` of a ``CampaignInput``.

    ``families`` restricts the candidates, ``solver`` gives the settings of the simulation used in fits.
    """

    frozen_jacobian = True
    ceilings: dict = {}
    heavier: dict = {}

    def __init__(self, campaign, settings=None, families=None, solver=None):
        settings = settings or MismatchSettings()
        self.ceilings = ceilings(campaign, settings.threshold)
        self._prepare(within_range(campaign, self.ceilings), settings, solver or passage_model.Track1D())
        found, self.start_values, reserved = list(hammer_observations(self)), {}, set(campaign.reserved)
        self.start_values = self._from_blows([o for name, o in found if name not in reserved])
        found += undisturbed(self, list(passage_observations(self)))
        self.slow.clear()
        self.foreign = foreign(self)
        if not found:
            raise SimulationError("nothing to diagnose: " + "; ".join(self.notes))
        self.observations = tuple(o for name, o in found if name not in reserved)
        self.reserved = tuple(o for name, o in found if name in reserved)
        if not self.observations:
            raise SimulationError("every recording is reserved for the verification: nothing is left to fit.")
        self.nuisances = tuple(self.listed())
        self.candidates = tuple(c for c in library(self, families) if c.family != WARMTH or self._warmed())
        self.families = families

    def _warmed(self):
        """Whether every recording has a rail temperature and these differ by ``MIN_TEMPERATURE_RANGE``.

        Otherwise temperature could explain any difference between recordings.
        """
        seen = [p.conditions for p in self.pairs.values()] + [self.said(made) for made in self.rollings.values()]
        found = [said.get("rail_temperature") for said in seen]
        return None not in found and max(found) - min(found) >= SPAN

    def _from_blows(self, observations):
        """Values of the nuisances of track and sensors from the hammer tests alone: the start of all fits."""
        self.nuisances, self.observations = tuple(self.listed()), tuple(observations)
        if not observations:
            return {}
        roughly = fit_jointly(Blows(self).roughened(), iterations=CHEAP_STEPS)
        self.start_values = roughly.values
        self.recentre(roughly.values)
        found = fit_jointly(Blows(self), values=roughly.values, iterations=CHEAP_STEPS).values
        self.recentre(found)
        return found

    def _prepare(self, campaign, settings, solver):
        """Set up everything that does not depend on recordings."""
        self.settings, self.solver, self.campaign = settings, solver, campaign
        self.nominal, self._railed = zone_of(campaign.turnout, campaign.places()), {}
        self.recentre({})
        self.trains = tuple(dict.fromkeys(p.train or p.name for p in campaign.passages))
        self.pairs, self.rollings, self.strange, self.slow, self.unlike, self.notes = {}, {}, {}, {}, [], []
        self.waves = self._waves()
        routes = {p.route: None for p in campaign.passages}
        self.surface = self.waves and RunningSurface(self.nominal.turnout, self.waves, routes)

    def recentre(self, values):
        """Linearise receptances about the rail given by ``values``, and clear the caches.

        Receptances are linear in deviations of the rail from there.
        """
        self.rail = {name: values.get(name, 0.0) for name in rail_spreads(self.nominal)}
        self.zone = with_rail(self.nominal, self.rail)
        self._forget()

    def struck(self):
        """Condition -> position of the impacts [m], for hammer tests."""
        return {o.condition: self.pairs[o.name].test.place for o in self.observations if o.name in self.pairs}

    def fitted(self):
        """``AlignedPassage`` of each passage that is fitted; reserved passages may not suggest a candidate."""
        return [self.rollings[o.name] for o in self.observations if o.name in self.rollings]

    def peak(self, channel):
        """Largest value of a channel in the passages, within their band; 0 where it has none. [m/s²]"""
        found = [0.0]
        for o in self.observations:
            made = self.rollings.get(o.name)
            names = [s.name for s in made.sensors] if made else []
            if channel in names:
                found.append(float(np.max(np.abs(o.data.reshape(len(names), -1)[names.index(channel)]))))
        return max(found)

    def highest(self, channel):
        """Largest value of a channel at its full sampling rate, reserved recordings included. [m/s²]"""
        return highest(self.campaign, channel)

    def _waves(self):
        if not self.campaign.passages:
            return None
        offset = self.campaign.turnout.roughness_level
        return Waves([s.place for s in self.campaign.sensors], 0.0 if offset is None else offset)

    def listed(self):
        """All nuisances of track, trains, sensors, rail roughness and passages."""
        yield from track_nuisances(self.zone, self.trains)
        for sensor in self.campaign.sensors:
            yield Nuisance(f"gain_{sensor.name}", "-", 0.0, GAIN_SD, meaning="gain of a sensor less one", bends=False)
            if not sensor.mounting.startswith("sleeper"):
                yield Nuisance(f"seat_{sensor.name}", "m", 0.0, SEAT_SD, meaning="place of a sensor less its file's")
        if self.waves:
            yield from self.waves.nuisances()
            yield from self.surface.nuisances()
        for made in self.rollings.values():
            yield from passage_observation.rolling_nuisances(made.passage)

    @property
    def measured(self):
        """First and last position of sensors and impacts [m]."""
        places = self.campaign.places()
        return min(places), max(places)

    @property
    def control_level(self):
        """Level that controls reach, by kind of observation."""
        return {"hammer": self.settings.hammer_control, "passage": self.settings.passage_control}

    @property
    def cell_level(self):
        """Level that one channel of one passage reaches in controls."""
        return {"passage": self.settings.cell_control}

    def cheap_part(self):
        """Case of the hammer tests alone; None without hammer tests."""
        return Blows(self) if self.pairs else None

    def cheap(self, observation):
        """Hammer tests are cheap to predict; passages have to be simulated."""
        return observation.name in self.pairs

    def own_jacobian(self, values, terms, observation, predicted, names):
        """Derivatives of a passage by its own time, speed and load."""
        return sensitivity.own_jacobian(self, values, terms, observation, predicted, names)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Derivatives by all nuisances, see ``sensitivity.nuisance_jacobian``."""
        return sensitivity.nuisance_jacobian(self, values, terms, observations, base)

    def renewed(self, fit):
        """The case with the rail under the passages and the roughness errors of the wheels as ``fit`` has them.

        Returns the case itself where all changes are within ``UPDATE_THRESHOLD``. The rail was first fitted to the
        hammer tests alone, where it may have absorbed part of the effect that ``fit`` explains now.
        """
        now = heavier(self, fit) if self.rollings else {}
        moved = {train: m for train, m in now.items() if abs(m - self.heavier.get(train, 0.0)) > FOLLOWED}
        bent = bool(self.rollings) and any(abs(fit.values[n] - at) > FOLLOWED for n, at in self.rail.items())
        if not moved and not bent:
            return self
        found = copy(self)
        found.heavier = {**self.heavier, **moved}
        if bent:
            found.recentre(fit.values)
        values = {**fit.values, **{f"wheels_{train}": m for train, m in found.heavier.items()}}

        def anew(o):
            made = self.rollings.get(o.name)
            return with_errors(found, values, made, o) if made and (bent or self.said(made)["train"] in moved) else o

        found.observations, found.reserved = (tuple(map(anew, o)) for o in (self.observations, self.reserved))
        return found

    def further(self, fit):
        """Dips, corrugation and wheel defects, as the residual and the sound level of passages suggest them."""
        from turnout.mismatch.turnout.candidates.rail_defects import geometry_scan

        rolled = any(o.name in self.rollings for o in self.observations)
        found = geometry_scan(self, fit, self.families) if rolled else ()
        return tuple(replace(c, loose=LOOSE) for c in found)

    def distant(self, fit):
        """Wheelsets of other masses, for trains whose residual exceeds the control level."""
        return distant_wheels(self, fit)

    def screen(self, fit):
        """Linear columns of the candidates that have one."""
        from turnout.mismatch.turnout.screening import screen_columns

        return screen_columns(self, fit, self.observations)

    def spaces(self, fit):
        """Subspaces of the residual: forces at supports, faults of channels, wheels and single passages."""
        from turnout.mismatch.turnout.residual_spaces import missing_sources

        return missing_sources(self, fit)

    def latent(self, fit):
        """Missing force at the support that explains most of the residual."""
        from turnout.mismatch.turnout.force_reconstruction import latent_force

        return latent_force(self, fit)
