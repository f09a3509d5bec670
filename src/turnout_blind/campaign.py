"""Write one case as a measuring campaign leaves it: config/, and raw/ with recordings and notes.

The truth is returned and not written here.
"""

import csv
import os
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from turnout.readers.writing import write
from turnout_blind.nominal_files import write_configuration
from turnout_blind.record import BETWEEN, CAMPAIGNS, FIRST_PASSAGE, N_BLOWS, hammer_test, passage
from turnout_blind.site import draw_site
from turnout_blind.visibility import visible

STAMP = 1_700_000_000  # modification time of every file [s since 1970]


def make_case(folder, case, plan, effects):
    """Write the campaign of a ``plan`` (``strata.CasePlan``) below ``folder``/``case``; returns its truth (a dict)."""
    rng, site, world, drawn = stage(plan, effects)
    decoys, told = draw_decoys(rng, site)
    folder = Path(folder) / case
    write_configuration(folder / "config", case, site)
    _raw(folder / "raw" / case, site, world, rng, decoys)
    _stamp(folder)
    seen = visible(site, world, [int(v) for v in plan.seed]) if drawn else {"hammer_pct": 0.0, "passage_pct": 0.0}
    return {
        "case": case,
        "stratum": plan.stratum,
        "panel": plan.panel,
        "effects": [asdict(d) for d in drawn],
        "visible": seen,
        "decoys": told,
        "sensors": dict(zip(site.names(), site.sensors)),
        "temperatures": list(site.temperatures),
        "seed": [int(v) for v in plan.seed],
    }


def stage(plan, effects):
    """(random generator, site, world with the effects in it, list of ``ConcealedEffect``) of a plan."""
    rng = np.random.default_rng(list(plan.seed))
    options = {"panel": plan.panel}
    for kind, _ in plan.effects:
        options.update(effects[kind].site)
    site = draw_site(rng, **options)
    world, drawn = site.world.copy(), []
    for kind, rung in plan.effects:
        concealed = effects[kind].concealed(rng, site, rung)
        effects[kind].act(world, site, concealed.where, concealed.parameters)
        drawn.append(concealed)
    return rng, site, world, drawn


def draw_decoys(rng, site):
    """Visible but harmless disturbances: (what is added to the recordings, their description in the truth)."""
    hum = str(rng.choice(site.names()))
    line, level = float(rng.choice([50.0, 16.7])), float(rng.uniform(0.02, 0.1))
    loud = str(rng.choice([n for n in site.names() if n != hum]))
    extra, turn = float(rng.uniform(0.05, 0.15)), float(rng.uniform(0.0, 6.28))
    bad = ("blow", int(rng.integers(2)), site.blows[rng.integers(len(site.blows))], int(rng.integers(N_BLOWS)))
    fault = str(rng.choice(["double", "overload"]))
    decoys = {
        hum: lambda t, rng: level * np.sin(2.0 * np.pi * line * t + turn),
        loud: lambda t, rng: extra * rng.normal(size=t.size) * 3.0,
        bad: fault,
    }
    told = {"hum": {"sensor": hum, "frequency": line, "level": level}, "noisy": {"sensor": loud, "rms": 3.0 * extra}}
    return decoys, {**told, "bad_blow": {"campaign": bad[1], "place": bad[2], "blow": bad[3], "fault": fault}}


def _raw(folder, site, world, rng, decoys):
    (folder / "passages").mkdir(parents=True, exist_ok=True)
    for c, when in enumerate(CAMPAIGNS):
        day = folder / "hammer" / when.date().isoformat()
        day.mkdir(parents=True, exist_ok=True)
        for point in site.blows:
            section = f"S{site.sensors.index(point) + 1}"
            write(hammer_test(site, world, c, point, rng, decoys), day / f"{section}_1.npz", "npz", single=True)
    speeds = [p.speed * (1.0 + 0.005 * float(rng.normal())) for p in site.passages]  # as read by a wayside device
    for k, plan in enumerate(site.passages):
        recording = passage(site, world, k, rng, decoys)
        noted = {**recording.conditions, "train_type": plan.train, "speed": round(speeds[k], 3)}
        name = f"{FIRST_PASSAGE + k * BETWEEN:%Y%m%dT%H%M%SZ}.npz"
        write([replace(recording, conditions=noted)], folder / "passages" / name, "npz", single=True)
    _notes(folder, site, speeds, rng)


def _notes(folder, site, speeds, rng):
    """Write campaigns.csv and trains.csv with realistic errors of such notes. One train in eight has no speed."""
    rows = [["campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator"]]
    for when, t in zip(CAMPAIGNS, site.temperatures):
        noted = f"{t + float(rng.normal()) * 0.7:.1f}"
        rows.append([when.date().isoformat(), when.isoformat(), noted, "H1", "plastic", "survey crew"])
    _table(folder / "campaigns.csv", rows)
    rows = [["passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track", "n_axles"]]
    silent = int(rng.integers(len(site.passages)))
    for k, plan in enumerate(site.passages):
        train = site.true_trains[plan.train]
        when = FIRST_PASSAGE + k * BETWEEN
        speed = f"{3.6 * speeds[k]:.1f}"
        load = train.axle_load / 9810.0 * (1.0 + 0.03 * float(rng.normal()))
        moment = when.replace(second=int(rng.integers(1, 4))).isoformat()
        n = str(train.axles().size)
        rows.append([moment, plan.train, "" if k == silent else speed, f"{load:.2f}", "main", n])
    _table(folder / "trains.csv", rows)


def _table(path, rows):
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def _stamp(folder):
    """Give all files the same modification time."""
    for path in sorted(Path(folder).rglob("*")):
        os.utime(path, (STAMP, STAMP))
