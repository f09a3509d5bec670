"""Histories: sites that are visited for two years, with seasons, wear and recorded maintenance.

An effect appears at an unknown day, as a step or by growth; or it is there from the first day; or there is none. Files
and seals are those of single campaigns, with one campaign for each visit and the events of the owner.
"""

from __future__ import annotations

import csv
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout_blind.campaign import (
    draw_decoys,
    read_speeds,
    set_file_times,
    write_campaign,
    write_notes,
    write_passage,
)
from turnout_blind.nominal_files import write_configuration
from turnout_blind.site import CROSSING, PLAIN, SWITCH, PlannedPassage, draw_site
from turnout_blind.visibility import effect_visibility

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout_blind.effect import ConcealedEffect, Effect
    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World

NONE, START, STEP, GROWTH = PATTERNS = ("none", "start", "step", "growth")
PATTERN_WEIGHTS = (0.25, 0.125, 0.3125, 0.3125)  # 20, 10, 25 and 25 of 80 sites
HISTORY_EFFECTS = ("ballast", "pad", "gain", "position", "void", "dip", "nose")
SWITCH_EFFECTS = ("chair_gap", "ballast", "heel", "void", "toe", "pad")  # in histories of switch panels
FIRST_DAY, N_DAYS = datetime(2022, 2, 1), 730
VISIT_JITTER = 20.0  # half the range of the uniform error of the day of a visit [d]
GROWTH_DAYS = 365.0  # time from the first to the full size of an effect that grows [d]
WEAR_RATE, WEAR_SCATTER = 0.02, 0.01  # loss of ballast stiffness [ln per year], mean and sd over supports
TAMPING_SD, TAMPING_SCATTER = 0.12, 0.08  # change of ballast stiffness by tamping [ln], of all and of each support
MEAN_TEMPERATURE, SEASON, WEATHER = 10.0, 11.0, 3.0  # rail temperature, its yearly amplitude and its sd [°C]
VISIT_TRAINS = (("locomotive", 33.0), ("loaded", 25.0), ("railcar", 33.0))  # trains of a visit in turn, speed [m/s]
# Kind of recorded work -> effects that it would repair: the exchange of a sensor those of that sensor alone
REPAIRED = {"tamping": ("ballast", "void"), "sensor_change": ("gain", "position")}
# Parameter of an effect -> its value at a share s of the full size, from the full value
GROWING = {
    "ballast": {"factor": lambda v, s: v**s},
    "pad": {"factor": lambda v, s: v**s},
    "gain": {"gain": lambda v, s: v**s},
    "position": {"shift": lambda v, s: v * s},
    "void": {"gap": lambda v, s: v * s, "seated": lambda v, s: 1.0 - (1.0 - v) * s, "growth": lambda v, s: 0.0},
    "dip": {"depth": lambda v, s: v * s},
    "nose": {"depth": lambda v, s: v * s},
    "hardening": {"rate": lambda v, s: v * s},
    "chair_gap": {"gap": lambda v, s: v * s},
    "heel": {"factor": lambda v, s: v**s},
    "toe": {"depth": lambda v, s: v * s},
}


@dataclass(frozen=True)
class HistoryPlan:
    """One site: ``pattern`` of ``PATTERNS``, the effect with its rung (None: without), ``seed`` and ``panel``."""

    pattern: str
    effect: tuple[str, int] | None
    seed: tuple[int, ...]
    panel: str = PLAIN
    n_visits: int = 4
    n_passages: int = 1


def plan_histories(
    seed: int,
    n_sites: int,
    effects: Mapping[str, Effect],
    n_passages: int = 1,
    n_visits: int = 4,
    panel: str = PLAIN,
) -> list[HistoryPlan]:
    """Plans of a set of histories in shuffled order.

    Half of them are in crossing panels, as all with a worn nose; or all in switch panels.

    Parameters
    ----------
    seed : int
        Seed of the set.
    n_sites : int
        Number of sites.
    effects : mapping
        Effects by kind.
    n_passages : int
        Passages at each visit.
    n_visits : int
        Visits in two years.
    panel : str
        ``SWITCH``: all sites are in switch panels; others have no meaning.

    Returns
    -------
    list of HistoryPlan
        The plans.

    Examples
    --------
    >>> from turnout_blind.effect import load_effects
    >>> plans = plan_histories(7, 80, load_effects())
    >>> [sum(p.pattern == pattern for p in plans) for pattern in PATTERNS]
    [20, 10, 25, 25]
    """
    rng = np.random.default_rng([seed, 31])
    ends = np.rint(np.cumsum(PATTERN_WEIGHTS) * n_sites).astype(int)
    patterns = [PATTERNS[int(np.searchsorted(ends, k, side="right"))] for k in range(n_sites)]
    kinds = [k for k in (SWITCH_EFFECTS if panel == SWITCH else HISTORY_EFFECTS) if k in effects]
    order = rng.permutation(n_sites)
    first, plans = int(rng.integers(len(kinds))), []
    for number, k in enumerate(order.tolist()):
        kind = kinds[(first + k) % len(kinds)]
        n_rungs = len(effects[kind].ladder)
        rung = int(rng.integers(n_rungs // 2, n_rungs))
        effect = None if patterns[k] == NONE else (kind, rung)
        plans.append(HistoryPlan(patterns[k], effect, (seed, 37, number), PLAIN, n_visits, n_passages))
    if panel == SWITCH:
        return [replace(p, panel=SWITCH) for p in plans]
    has_nose = [p.effect is not None and effects[p.effect[0]].site.get("panel") == CROSSING for p in plans]
    without_nose = rng.permutation([k for k, nose in enumerate(has_nose) if not nose]).tolist()
    crossings = {k for k, nose in enumerate(has_nose) if nose}
    crossings |= set(without_nose[: max(n_sites // 2 - len(crossings), 0)])
    return [replace(p, panel=CROSSING if k in crossings else PLAIN) for k, p in enumerate(plans)]


def make_history(folder: str | Path, case: str, plan: HistoryPlan, effects: Mapping[str, Effect]) -> dict[str, Any]:
    """Write the visits of a plan below ``folder``/``case``.

    Parameters
    ----------
    folder : str or Path
        Folder of the cases.
    case : str
        Id of the case.
    plan : HistoryPlan
        Plan of the site.
    effects : mapping
        Effects by kind.

    Returns
    -------
    dict
        Truth of the case.
    """
    rng = np.random.default_rng(list(plan.seed))
    site = _visited_site(rng, draw_site(rng, same_temperature=False, one_speed=False, panel=plan.panel), plan)
    wear = WEAR_RATE + WEAR_SCATTER * rng.normal(size=site.world.position.size)
    work = _draw_maintenance(rng, site)
    concealed = effects[plan.effect[0]].draw_concealed(rng, site, plan.effect[1]) if plan.effect else None
    onset = _draw_onset(rng, site, plan.pattern)
    while has_repair(concealed, onset, work):
        work = _draw_maintenance(rng, site)
    decoys, decoy_truth = draw_decoys(rng, site)
    folder = Path(folder) / case
    write_configuration(folder / "config", case, site)
    _write_events(folder / "config" / "events.csv", case, work)
    speeds, severities, visible = read_speeds(site, rng), [], []
    for v, when in enumerate(site.campaigns):
        intact = _world_at(site, when, wear, work)
        share = _severity(plan.pattern, when, onset)
        world = intact.copy()
        if concealed is not None and share > 0.0:
            parameters = parameters_at(concealed.kind, concealed.parameters, share)
            effects[concealed.kind].act(world, site, concealed.where, parameters)
        write_campaign(folder / "raw" / case, site, world, v, rng, decoys)
        first = v * plan.n_passages
        for k in range(first, first + plan.n_passages):
            write_passage(folder / "raw" / case, site, world, k, speeds[k], rng, decoys)
        severities.append(share)
        now = replace(site, world=intact, passages=site.passages[first : first + 1])
        seed = [int(v) for v in plan.seed]
        visible.append(effect_visibility(now, world, seed) if share else {"hammer_pct": 0.0, "passage_pct": 0.0})
    write_notes(folder / "raw" / case, site, speeds, rng)
    set_file_times(folder)
    return {
        "case": case, "stratum": "history", "pattern": plan.pattern, "panel": plan.panel,
        "effects": [asdict(concealed)] if concealed else [],
        "onset": onset.date().isoformat() if onset and plan.pattern in (STEP, GROWTH) else None,
        "visits": [when.date().isoformat() for when in site.campaigns], "severities": severities, "visible": visible,
        "maintenance": [{"day": day.date().isoformat(), "kind": kind, "section": s} for day, kind, s, _ in work],
        "decoys": decoy_truth, "sensors": dict(zip(site.names(), site.sensors)), "seed": [int(v) for v in plan.seed],
    }  # fmt: skip


def parameters_at(kind: str, parameters: Mapping[str, Any], share: float) -> dict[str, Any]:
    """Parameters of an effect that has reached a share of its full size.

    Parameters
    ----------
    kind : str
        Kind of the effect, one of ``HISTORY_EFFECTS`` or ``SWITCH_EFFECTS``.
    parameters : mapping
        Those of the full size.
    share : float
        0 (no effect) to 1.

    Returns
    -------
    dict
        Parameters.

    Examples
    --------
    >>> parameters_at("ballast", {"factor": 0.25, "side": 1.0}, 0.5)
    {'factor': 0.5, 'side': 1.0}
    """
    return {name: GROWING[kind].get(name, lambda v, s: v)(value, share) for name, value in parameters.items()}


def _visited_site(rng: np.random.Generator, site: Site, plan: HistoryPlan) -> Site:
    """The site with its visits, their temperatures and their passages."""
    days = np.linspace(0.0, N_DAYS, plan.n_visits) + VISIT_JITTER * rng.uniform(-1.0, 1.0, plan.n_visits)
    campaigns = tuple(FIRST_DAY + timedelta(days=float(round(d)), hours=9) for d in days)
    temperatures = tuple(_season(when) + WEATHER * float(rng.normal()) for when in campaigns)
    passages = []
    for when, t in zip(campaigns, temperatures):
        for k in range(plan.n_passages):
            train, speed = VISIT_TRAINS[k % len(VISIT_TRAINS)]
            passages.append(
                PlannedPassage(
                    train, speed * float(np.exp(0.04 * rng.normal())), float(rng.uniform(0.0, 2.0 * np.pi)),
                    t + float(rng.uniform(-2.0, 2.0)), when + timedelta(hours=2, minutes=30 * k),
                )
            )  # fmt: skip
    return replace(site, campaigns=campaigns, temperatures=temperatures, passages=passages)


def _season(when: datetime) -> float:
    """Mean rail temperature of a day, lowest on 20 January. [°C]"""
    return MEAN_TEMPERATURE - SEASON * float(np.cos(2.0 * np.pi * (when.timetuple().tm_yday - 20) / 365.25))


def _draw_onset(rng: np.random.Generator, site: Site, pattern: str) -> datetime | None:
    """Day on which the effect appears: between the first and the last visit, of growth half a year before the last."""
    first, last = site.campaigns[0], site.campaigns[-1]
    if pattern == START:
        return first - timedelta(days=1)
    if pattern == NONE:
        return None
    margin = 0.5 * GROWTH_DAYS if pattern == GROWTH else 1.0
    return first + timedelta(days=float(rng.uniform(1.0, (last - first).days - margin)))


def _severity(pattern: str, when: datetime, onset: datetime | None) -> float:
    """Share of the full size that the effect has at a time."""
    if onset is None or when <= onset:
        return 0.0
    return 1.0 if pattern != GROWTH else min((when - onset).total_seconds() / 86400.0 / GROWTH_DAYS, 1.0)


def has_repair(concealed: ConcealedEffect | None, onset: datetime | None, work: Sequence[Maintenance]) -> bool:
    """Whether recorded work from the day of the onset on would repair the effect. Such work is drawn again.

    Parameters
    ----------
    concealed : ConcealedEffect or None
        The effect.
    onset : datetime or None
        Time from which it is there.
    work : sequence of tuple
        Recorded work: day, kind, section or "", and the changes of the world.

    Returns
    -------
    bool
        False without an effect.
    """
    if concealed is None or onset is None:
        return False
    sensor = concealed.where.get("sensor")
    return any(
        concealed.kind in REPAIRED[kind] and change.get("sensor") == sensor and day.date() >= onset.date()
        for day, kind, _, change in work
    )


def _is_done(day: datetime, when: datetime) -> bool:
    """Whether work of a day is in the world at a time: ``events.csv`` dates it to the start of its day."""
    return day.date() <= when.date()


# day, kind, section or "", and the changes of the world
Maintenance = tuple[datetime, str, str, dict[str, Any]]


def _draw_maintenance(rng: np.random.Generator, site: Site) -> list[Maintenance]:
    """Tamping at one site of two, the exchange of a sensor at one of four."""
    first, days = site.campaigns[0], (site.campaigns[-1] - site.campaigns[0]).days
    work: list[Maintenance] = []
    if rng.random() < 0.5:
        n = site.world.position.size
        factor = np.exp(TAMPING_SD * rng.normal() + TAMPING_SCATTER * rng.normal(size=n))
        day = first + timedelta(days=float(rng.integers(1, days)))
        work.append((day, "tamping", "", {"ballast": factor, "damping": np.exp(0.1 * rng.normal(size=n))}))
    if rng.random() < 0.25:
        i = int(rng.integers(len(site.sensors)))
        change = {"sensor": site.names()[i], "gain": 1.0 + 0.01 * rng.normal(), "shift": 0.015 * rng.normal()}
        day = first + timedelta(days=float(rng.integers(1, days)))
        work.append((day, "sensor_change", f"S{i + 1}", change))
    return work


def _world_at(site: Site, when: datetime, wear: np.ndarray, work: list[Maintenance]) -> World:
    """The world without the effect at a time: worn, and changed by the work before."""
    world = site.world.copy()
    years = (when - site.campaigns[0]).total_seconds() / 86400.0 / 365.25
    world.ballast = world.ballast * np.exp(-wear * years)
    for day, kind, _, change in work:
        if not _is_done(day, when):
            continue
        if kind == "tamping":
            world.ballast = world.ballast * change["ballast"]
            world.ballast_damping = world.ballast_damping * change["damping"]
        else:
            gain = float(change["gain"])
            world.channels.setdefault(change["sensor"], []).append(partial(_other_gain, gain))
            world.sensor_shift[change["sensor"]] = float(change["shift"])
    return world


def _other_gain(gain: float, recording_type: str, rng: np.random.Generator) -> Fault:
    """Fault of a sensor with another gain."""
    return lambda x, rate: gain * x


def _write_events(path: Path, case: str, work: list[Maintenance]) -> None:
    rows = [["turnout", "section", "date", "kind", "resets", "note"]]
    rows += [[case, section, day.date().isoformat(), kind, "", ""] for day, kind, section, _ in sorted(work, key=_day)]
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def _day(work: Maintenance) -> datetime:
    return work[0]
