"""Parts of the calibrated model that belong together: components of one route, and what lies near a section."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    GroupInformation,
    StateParameter,
    VisitInformation,
    change_candidates,
    deviations_from_file,
    estimate_history,
    stretch_candidates,
)
from turnout.stages.recorded_work import events_of


@pytest.mark.parametrize(("section", "n_opened"), [("A", 3), ("B", 0), ("", 3)])
def test_work_on_a_section_opens_the_nose_and_the_waves_near_it_alone(tmp_path, section, n_opened):
    """Formerly each grinding of any section made every nose of the turnout uncertain again."""
    (tmp_path / "events.csv").write_text(f"turnout,section,date,kind\nt1,{section},2026-01-10,grinding\n")
    sections = [SimpleNamespace(label="A", position=9.0), SimpleNamespace(label="B", position=30.0)]
    turnout = SimpleNamespace(folder=tmp_path, id="t1", sections=sections)
    nose = [
        StateParameter(f"ln {number} of the kink at 5.24 m", 0.0, 0.4, 0.0, group, position=5.24)
        for number, group in (("depth", "depth"), ("length", "surface"))
    ]
    wave = StateParameter("cos_wave_3@-0.90-12.00", 0.0, 1e-4, 0.0, "wave", unit="m", start=-0.9, end=12.0)
    (event,) = events_of(turnout, [*nose, wave])
    assert len(event.opened) == n_opened


def both_routes(group, n=5):
    """Supports behind a crossing, where each route has its own: they are numbered alike, 0.1 m apart."""
    return [
        StateParameter(f"{prefix}{group}@{x:.2f}", 0.0, 0.1, 0.03, group, k, x, route=route)
        for route, prefix, offset in (("main", "", 0.0), ("diverging", "diverging ", 0.1))
        for k, x in enumerate(0.6 * np.arange(n) + offset)
    ]


def test_a_run_of_soft_sleepers_behind_a_crossing_is_one_deviation_of_its_route():
    """Formerly supports of the other route with the same number broke each run, or were part of it."""
    parameters = both_routes("ballast")
    y = np.array([-0.45 if p.route == "main" and p.index in (1, 2, 3) else 0.0 for p in parameters])
    names, information = tuple(p.name for p in parameters), np.eye(len(y)) / 0.12**2
    visit = VisitInformation(
        "v0", 0.0, (GroupInformation("A: impacts at 1.20 m", 1, names, information, information @ y),)
    )
    history = estimate_history(parameters, [visit], accepted=None)
    (found,) = deviations_from_file(history, parameters, {"ballast": 0.15})
    assert found.names == ("ballast@0.60", "ballast@1.20", "ballast@1.80")


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_candidates_are_of_one_route_with_the_dampers_of_this_route(offset):
    """A damper at the same position on the other route changed with a spring."""
    springs, dampers = both_routes("pad"), both_routes("pad_damper")
    if not offset:  # sleepers before the crossing bear both routes
        springs, dampers = (
            [replace(p, name=re.sub("@.*", f"@{0.6 * p.index:.2f}", p.name), position=0.6 * p.index) for p in of]
            for of in (springs, dampers)
        )
    parameters = [*springs, *dampers]
    by_name = {p.name: p for p in parameters}
    candidates = [c for c in (*change_candidates(parameters), *stretch_candidates(parameters)) if len(c.direction) > 1]
    assert len(candidates) == len({(c.name, c.grows) for c in candidates}) > 40
    for c in candidates:
        changed = [by_name[name] for name in c.direction]
        assert len({p.route for p in changed}) == 1
        assert sum(p.group == "pad" for p in changed) == sum(p.group == "pad_damper" for p in changed)
