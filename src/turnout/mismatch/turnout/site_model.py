"""Track of a site about given rail values, and the positions of its sensors: what all predictions share."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_model
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.predictions import Terms, Values
from turnout.mismatch.turnout.rail_parameters import rail_sds, with_rail
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.site import Site
from turnout.physics.term import PhysicsTerm
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import Track


class SiteModel:
    """Track and sensors of one site, with what was measured there.

    ``rail`` holds the logarithms of the rail values about which the track of passages is modelled, ``zone`` the track
    with them. ``frf_pairs`` and ``aligned_passages`` describe by name what was measured. Nothing ever changes but
    caches.
    """

    def __init__(self, site: Site, solver: Track1D, rail: Values | None = None):
        self.site, self.solver = site, solver
        self.frf_pairs: Mapping[str, FrfPair] = {}
        self.aligned_passages: Mapping[str, AlignedPassage] = {}
        self.rail = {name: (rail or {}).get(name, 0.0) for name in rail_sds(site.nominal)}
        self.zone = with_rail(site.nominal, self.rail)
        self._zones_with_file_values: dict[tuple[str, ...], Any] = {}

    @property
    def waves(self) -> Waves:
        """Free waves of the rail; SimulationError without passages."""
        if self.site.waves is None:
            raise SimulationError("no passage was given: the rail has no free waves.")
        return self.site.waves

    @property
    def surface(self) -> RunningSurface:
        """Running surface with its uncertain numbers; SimulationError without passages."""
        if self.site.surface is None:
            raise SimulationError("no passage was given: there is no running surface.")
        return self.site.surface

    def track(self, route: str = "main", terms: Iterable[PhysicsTerm] = ()) -> Track:
        """Base track of a route, cut to the zone.

        Rail values that ``terms`` set themselves are as in the track file.

        Parameters
        ----------
        route : str
            Route through the turnout.
        terms : iterable of PhysicsTerm
            Physics terms of the effects.

        Returns
        -------
        Track
        """
        file_names = tuple(sorted({t.name for t in terms} & set(self.rail)))
        if file_names and file_names not in self._zones_with_file_values:
            self._zones_with_file_values[file_names] = with_rail(
                self.site.nominal, {n: 0.0 if n in file_names else v for n, v in self.rail.items()}
            )
        zone = self._zones_with_file_values[file_names] if file_names else self.zone
        return zone.turnout.track_of(route)

    def seat(self, sensor: Sensor, values: Values, terms: Terms) -> Sensor:
        """The sensor at the position that ``values`` and ``terms`` give.

        Parameters
        ----------
        sensor : Sensor
            A sensor.
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.

        Returns
        -------
        Sensor
        """
        offset = values.get(f"seat_{sensor.name}", 0.0)
        return passage_model.place_sensor(replace(sensor, place=sensor.place + offset) if offset else sensor, terms)


def drop_oldest(cache: OrderedDict[Hashable, Any], size: int) -> None:
    """Drop the oldest entries beyond ``size``.

    Parameters
    ----------
    cache : OrderedDict
        Entries, the oldest first; it is changed.
    size : int
        Largest number of entries that stay.
    """
    while len(cache) > size:
        cache.popitem(last=False)
