"""Write one case as a measuring campaign leaves it: config/, and raw/ with recordings and notes.

The truth is returned and not written here.
"""

from __future__ import annotations

import csv
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout.readers.writing import write
from turnout_blind.nominal_files import write_configuration
from turnout_blind.record import N_IMPACTS, hammer_test, passage
from turnout_blind.site import draw_site
from turnout_blind.visibility import effect_visibility

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from turnout_blind.effect import ConcealedEffect, Effect
    from turnout_blind.site import Site
    from turnout_blind.strata import CasePlan
    from turnout_blind.true_site import World

FILE_TIME = 1_700_000_000  # modification time of every file [s since 1970]


def make_case(folder: str | Path, case: str, plan: CasePlan, effects: Mapping[str, Effect]) -> dict[str, Any]:
    """Write the campaign of a plan below ``folder``/``case``.

    Parameters
    ----------
    folder : str or Path
        Folder of the cases.
    case : str
        Id of the case.
    plan : CasePlan
        Plan of the case.
    effects : mapping
        Effects by kind.

    Returns
    -------
    dict
        Truth of the case.
    """
    rng, site, world, concealed = stage(plan, effects)
    decoys, decoy_truth = draw_decoys(rng, site)
    folder = Path(folder) / case
    write_configuration(folder / "config", case, site)
    _write_recordings(folder / "raw" / case, site, world, rng, decoys)
    set_file_times(folder)
    visibility = (
        effect_visibility(site, world, [int(v) for v in plan.seed])
        if concealed
        else {"hammer_pct": 0.0, "passage_pct": 0.0}
    )
    return {
        "case": case,
        "stratum": plan.stratum,
        "panel": plan.panel,
        "effects": [asdict(d) for d in concealed],
        "visible": visibility,
        "decoys": decoy_truth,
        "sensors": dict(zip(site.names(), site.sensors)),
        "temperatures": list(site.temperatures),
        "seed": [int(v) for v in plan.seed],
    }


def stage(
    plan: CasePlan, effects: Mapping[str, Effect]
) -> tuple[np.random.Generator, Site, World, list[ConcealedEffect]]:
    """Site and world of a plan.

    Parameters
    ----------
    plan : CasePlan
        Plan of the case.
    effects : mapping
        Effects by kind.

    Returns
    -------
    (Generator, Site, World, list of ConcealedEffect)
        Random generator, site, world with the effects in it, and the effects.
    """
    rng = np.random.default_rng(list(plan.seed))
    options: dict[str, Any] = {"panel": plan.panel}
    for effect_type, _ in plan.effects:
        options.update(effects[effect_type].site)
    site = draw_site(rng, **options)
    world, concealed = site.world.copy(), []
    for effect_type, rung in plan.effects:
        effect = effects[effect_type].draw_concealed(rng, site, rung)
        effects[effect_type].act(world, site, effect.where, effect.parameters)
        concealed.append(effect)
    return rng, site, world, concealed


def draw_decoys(rng: np.random.Generator, site: Site) -> tuple[dict[Any, Any], dict[str, Any]]:
    """Visible but harmless disturbances.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    (dict, dict)
        What is added to the recordings, by sensor or by impact; its description in the truth.
    """
    hum_sensor = str(rng.choice(site.names()))
    hum_frequency, hum_level = float(rng.choice([50.0, 16.7])), float(rng.uniform(0.02, 0.1))
    noisy_sensor = str(rng.choice([n for n in site.names() if n != hum_sensor]))
    noise_level, phase = float(rng.uniform(0.05, 0.15)), float(rng.uniform(0.0, 6.28))
    bad_impact = (
        "blow",
        int(rng.integers(2)),
        site.hammer_positions[rng.integers(len(site.hammer_positions))],
        int(rng.integers(N_IMPACTS)),
    )
    fault = str(rng.choice(["double", "overload"]))
    decoys = {
        hum_sensor: lambda t, rng: hum_level * np.sin(2.0 * np.pi * hum_frequency * t + phase),
        noisy_sensor: lambda t, rng: noise_level * rng.normal(size=t.size) * 3.0,
        bad_impact: fault,
    }
    truth = {
        "hum": {"sensor": hum_sensor, "frequency": hum_frequency, "level": hum_level},
        "noisy": {"sensor": noisy_sensor, "rms": 3.0 * noise_level},
    }
    return decoys, {
        **truth,
        "bad_blow": {"campaign": bad_impact[1], "place": bad_impact[2], "blow": bad_impact[3], "fault": fault},
    }


def _write_recordings(
    folder: Path, site: Site, world: World, rng: np.random.Generator, decoys: Mapping[Any, Any]
) -> None:
    for c in range(len(site.campaigns)):
        write_campaign(folder, site, world, c, rng, decoys)
    speeds = read_speeds(site, rng)
    for k in range(len(site.passages)):
        write_passage(folder, site, world, k, speeds[k], rng, decoys)
    write_notes(folder, site, speeds, rng)


def write_campaign(
    folder: Path, site: Site, world: World, c: int, rng: np.random.Generator, decoys: Mapping[Any, Any]
) -> None:
    """Write the hammer tests of one campaign.

    Parameters
    ----------
    folder : Path
        Folder of the recordings of the site.
    site : Site
        The site.
    world : World
        Its true state at this campaign.
    c : int
        Number of the campaign.
    rng : Generator
        Source of the random numbers.
    decoys : mapping
        Disturbances from ``draw_decoys``.
    """
    campaign_folder = folder / "hammer" / site.campaigns[c].date().isoformat()
    campaign_folder.mkdir(parents=True, exist_ok=True)
    for position in site.hammer_positions:
        section = f"S{site.sensors.index(position) + 1}"
        recordings = hammer_test(site, world, c, position, rng, decoys)
        write(recordings, campaign_folder / f"{section}_1.npz", "npz", single=True)


def read_speeds(site: Site, rng: np.random.Generator) -> list[float]:
    """Speeds of the passages as read by a wayside device.

    Parameters
    ----------
    site : Site
        The site.
    rng : Generator
        Source of the random numbers.

    Returns
    -------
    list of float
        [m/s]
    """
    return [p.speed * (1.0 + 0.005 * float(rng.normal())) for p in site.passages]


def write_passage(
    folder: Path, site: Site, world: World, k: int, speed: float, rng: np.random.Generator, decoys: Mapping[Any, Any]
) -> None:
    """Write the recording of one passage.

    Parameters
    ----------
    folder : Path
        Folder of the recordings of the site.
    site : Site
        The site.
    world : World
        Its true state at this passage.
    k : int
        Number of the passage.
    speed : float
        Speed as it was read. [m/s]
    rng : Generator
        Source of the random numbers.
    decoys : mapping
        Disturbances from ``draw_decoys``.
    """
    (folder / "passages").mkdir(parents=True, exist_ok=True)
    recording = passage(site, world, k, rng, decoys)
    conditions = {**recording.conditions, "train_type": site.passages[k].train, "speed": round(speed, 3)}
    name = f"{site.passage_time(k):%Y%m%dT%H%M%SZ}.npz"
    write([replace(recording, conditions=conditions)], folder / "passages" / name, "npz", single=True)


def write_notes(folder: Path, site: Site, speeds: Sequence[float], rng: np.random.Generator) -> None:
    """Write campaigns.csv and trains.csv with realistic errors of such notes. One train has no speed.

    Parameters
    ----------
    folder : Path
        Folder of the recordings of the site.
    site : Site
        The site.
    speeds : sequence of float
        Speeds as they were read. [m/s]
    rng : Generator
        Source of the random numbers.
    """
    rows = [["campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator"]]
    for when, t in zip(site.campaigns, site.temperatures):
        temperature = f"{t + float(rng.normal()) * 0.7:.1f}"
        rows.append([when.date().isoformat(), when.isoformat(), temperature, "H1", "plastic", "survey crew"])
    _write_csv(folder / "campaigns.csv", rows)
    rows = [["passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track", "n_axles"]]
    without_speed = int(rng.integers(len(site.passages)))
    for k, plan in enumerate(site.passages):
        train = site.true_trains[plan.train]
        speed = f"{3.6 * speeds[k]:.1f}"
        load = train.axle_load / 9810.0 * (1.0 + 0.03 * float(rng.normal()))
        time = site.passage_time(k).replace(second=int(rng.integers(1, 4))).isoformat()
        n = str(train.axles().size)
        rows.append([time, plan.train, "" if k == without_speed else speed, f"{load:.2f}", "main", n])
    _write_csv(folder / "trains.csv", rows)


def _write_csv(path: Path, rows: Iterable[Sequence[str]]) -> None:
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def set_file_times(folder: Path) -> None:
    """Give all files the same modification time.

    Parameters
    ----------
    folder : str or Path
        Folder of the case.
    """
    for path in sorted(Path(folder).rglob("*")):
        os.utime(path, (FILE_TIME, FILE_TIME))
