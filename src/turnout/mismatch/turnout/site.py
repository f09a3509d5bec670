"""The track about the sensors and impacts of a campaign, and the nuisance parameters of all that is on it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.campaign import CampaignInput, PassageInput
from turnout.mismatch.turnout.passage_observation import passage_nuisances
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.track_parameters import track_nuisances
from turnout.mismatch.turnout.zone import Zone, zone_of
from turnout.simulate.sensor import Sensor


@dataclass
class SimulationCount:
    """Number ``n`` of passages that were simulated."""

    n: int = 0


@dataclass(frozen=True)
class Site:
    """Zone of the track as filed, with the sensors, trains, free waves and running surface of a campaign.

    ``waves`` and ``surface`` are None without passages. ``count`` is of the simulations of all predictors of the site.
    """

    nominal: Zone
    sensors: tuple[Sensor, ...]
    trains: tuple[str, ...]
    waves: Waves | None = None
    surface: RunningSurface | None = None
    count: SimulationCount = field(default_factory=SimulationCount, compare=False)

    def shared_nuisances(self) -> tuple[Nuisance, ...]:
        """Nuisances of track, wheelsets and sensors: those that hammer tests depend on, and the wheelsets."""
        return (*track_nuisances(self.nominal, self.trains), *_sensor_nuisances(self.sensors))

    @cached_property
    def common_sds(self) -> dict[str, float]:
        """Prior standard deviations of the values that all supports have in common, and of the running surface."""
        nuisances = [n for n in track_nuisances(self.nominal, self.trains) if n.group == "track"]
        return {n.name: n.sd for n in (*nuisances, *(self.surface.nuisances() if self.surface else ()))}

    @cached_property
    def support_sds(self) -> dict[str, float]:
        """Prior standard deviations of the pad and ballast stiffness that each support has of its own."""
        return {n.name: n.sd for n in track_nuisances(self.nominal, self.trains) if n.group in ("pad", "ballast")}

    def nuisances(self, passages: Iterable[PassageInput] = ()) -> tuple[Nuisance, ...]:
        """All nuisances: the shared ones, then rail roughness, running surface and each of the ``passages``.

        Parameters
        ----------
        passages : iterable of PassageInput
            Train passages.

        Returns
        -------
        tuple[Nuisance, ...]
        """
        geometry: list[Nuisance] = []
        if self.waves is not None:
            geometry += self.waves.nuisances()
        if self.surface is not None:
            geometry += self.surface.nuisances()
        owned = [nuisance for passage in passages for nuisance in passage_nuisances(passage)]
        return (*self.shared_nuisances(), *geometry, *owned)


def _sensor_nuisances(sensors: Iterable[Sensor]) -> Iterator[Nuisance]:
    """Gain of every sensor, and position of those on the rail."""
    for sensor in sensors:
        yield Nuisance(
            f"gain_{sensor.name}",
            "-",
            0.0,
            TRACK.gain_sd,
            meaning="gain of a sensor less one",
            can_mask=False,
            group="gain",
            at=("sensor", sensor.name),
        )
        if not sensor.mounting.startswith("sleeper"):
            yield Nuisance(
                f"seat_{sensor.name}",
                "m",
                0.0,
                TRACK.seat_sd,
                meaning="place of a sensor less its file's",
                group="seat",
                at=("sensor", sensor.name),
            )


def site_of(campaign: CampaignInput) -> Site:
    """The ``Site`` of a campaign.

    Parameters
    ----------
    campaign : CampaignInput
        Its sensors, hammer tests and passages define the zone of the track and the range of the free waves.

    Returns
    -------
    Site
    """
    nominal = zone_of(campaign.turnout, campaign.positions())
    trains = tuple(dict.fromkeys(p.train or p.name for p in campaign.passages))
    if not campaign.passages:
        return Site(nominal, campaign.sensors, trains)
    offset = campaign.turnout.roughness_level
    waves = Waves([s.place for s in campaign.sensors], 0.0 if offset is None else offset)
    routes = tuple(dict.fromkeys(p.route for p in campaign.passages))
    return Site(nominal, campaign.sensors, trains, waves, RunningSurface(nominal.turnout, waves, routes))
