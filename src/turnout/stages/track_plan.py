"""Contradictions in the plan of a track file: overlapping sections, panels out of order, a blade behind the nose."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import NamedTuple

from turnout.config.layout_schema import PANELS
from turnout.config.parameters import ParameterSet
from turnout.config.schema import suggestion
from turnout.errors import ConfigError
from turnout.simulate.track_file import SUPPORT_UNITS, entries_of_routes

PANEL_ORDER = ("SP", "CLP", "CP", "AS")  # from the switch toe on; the open track is on both sides
PANELS_BEHIND_BLADES = ("CP", "AS")
MIN_OVERLAP = 0.001  # m: what rounding leaves
MAX_ELEMENTS_PER_BAY = 40  # of 15 mm: a finer mesh changes nothing below 10 kHz and needs hours


class Stretch(NamedTuple):
    """A section of a track file; ``route`` is None on all routes."""

    entry: ParameterSet
    start: float
    end: float
    panel: str
    route: str | None

    @property
    def middle(self) -> float:
        """Middle of the section. [m]"""
        return 0.5 * (self.start + self.end)

    def meets(self, stretch: Stretch) -> bool:
        """Whether both are on one route.

        Parameters
        ----------
        stretch : Stretch
            Another section.

        Returns
        -------
        bool
            True if one of them names no route.
        """
        return None in (self.route, stretch.route) or self.route == stretch.route


def plan_errors(parameters: ParameterSet) -> Iterator[ConfigError]:
    """An error for each entry of a track file that contradicts another one, and for each unknown panel.

    Parameters
    ----------
    parameters : ParameterSet
        A track file that has been read without an error, or any other parameter file.

    Yields
    ------
    ConfigError
        With file, line and entry.
    """
    elements = parameters.get("elements_per_bay")
    if isinstance(elements, int) and elements > MAX_ELEMENTS_PER_BAY:
        remedy = f"Write a number up to {MAX_ELEMENTS_PER_BAY}; 4 are usual"
        yield parameters.error("elements_per_bay", f"{elements} elements between two supports", remedy)
    stretches = [
        Stretch(s, s.number("from", "m"), s.number("to", "m"), str(s.get("panel", "")), s.get("route"))
        for s in parameters.mappings_at("sections")
    ]
    for stretch in stretches:
        if stretch.panel and stretch.panel not in PANELS:
            yield stretch.entry.error("panel", f"{stretch.panel!r} is no panel", suggestion(stretch.panel, PANELS))
    for first, second in combinations(stretches, 2):
        yield from _overlap_errors(first, second)
    yield from _panel_errors(stretches, _direction(parameters))
    yield from _blade_errors(parameters, stretches)


def _overlap_errors(first: Stretch, second: Stretch) -> Iterator[ConfigError]:
    """An error of two sections that give one value at one place, unless the second is a part of the first."""
    common = [key for key in SUPPORT_UNITS if key in first.entry and key in second.entry]
    overlap = min(first.end, second.end) - max(first.start, second.start)
    is_part = first.start <= second.start and second.end <= first.end
    is_shorter = second.end - second.start < first.end - first.start
    if common and first.meets(second) and overlap > MIN_OVERLAP and not (is_part and is_shorter):
        start, end = max(first.start, second.start), min(first.end, second.end)
        problem = (
            f"{common[0]} is given from {start:g} to {end:g} m here and in section {first.entry.get('label')!r} "
            f"(from {first.start:g} to {first.end:g} m)"
        )
        yield second.entry.error(None, problem, "Correct an end; only a part of an earlier section may have its own")


def _direction(parameters: ParameterSet) -> float:
    """1 where positions count from the switch toe to the crossing, -1 where the blade points the other way."""
    blade = parameters.optional_mapping_at("blade")
    return -1.0 if blade and blade.number("heel", "m") < blade.number("toe", "m") else 1.0


def _panel_errors(stretches: list[Stretch], direction: float) -> Iterator[ConfigError]:
    """An error for each panel whose sections begin before those of the panel that it follows."""
    groups = [[s for s in stretches if s.panel == panel] for panel in PANEL_ORDER]
    for before, after in pairwise([group for group in groups if group]):
        last = max(before, key=lambda s: direction * s.middle)
        first = min(after, key=lambda s: direction * s.middle)
        if direction * first.middle < direction * last.middle:
            problem = f"panel {first.panel} at {first.middle:g} m is before panel {last.panel} at {last.middle:g} m"
            remedy = "Positions count from the switch toe towards the crossing: correct the ends or a panel"
            yield first.entry.error("panel", problem, remedy)


def _blade_errors(parameters: ParameterSet, stretches: list[Stretch]) -> Iterator[ConfigError]:
    """An error for each end of a blade that lies in a panel behind the blades, or behind every nose."""
    blade = parameters.optional_mapping_at("blade")
    shapes = list(entries_of_routes(parameters.optional_mapping_at("routes")))
    ends = [(shape, "start") for shape in shapes if shape["kind"] in ("blade_top", "stock_fall")]
    ends += [(blade, key) for key in ("heel", "toe") if blade]
    noses = [shape.number("place", "m") for shape in shapes if shape["kind"] == "kink"]
    direction = _direction(parameters)
    for x, (entry, key) in {entry.number(key, "m"): (entry, key) for entry, key in ends}.items():
        panels = [s.panel for s in stretches if s.start < x < s.end and s.panel]
        if panels and all(panel in PANELS_BEHIND_BLADES for panel in panels):
            yield entry.error(key, f"{x:g} m is in panel {panels[0]}, where no blade is", "Correct the position")
        elif noses and all(direction * (nose - x) < 0.0 for nose in noses):
            problem = f"a blade at {x:g} m, behind the nose at {max(noses, key=lambda n: direction * n):g} m"
            yield entry.error(key, problem, "Correct the one or the other")
