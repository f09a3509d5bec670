"""A turnout that is small enough for a diagnosis in a test: two sections on 36 m of uniform track, a locomotive."""

import shutil
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

from turnout import physics
from turnout.readers.writing import write
from turnout.simulate import Hammer, Sensor, load_track, load_vehicle, simulate_hammer, simulate_passage
from turnout.simulate.turnout_track import stretch_of_track

DAY = datetime(2026, 7, 25, 9, 0)
PLACES = {"A": 18.0, "B": 18.6}
SLEEPER, SOFT = 18.0, 0.3
LAYOUT = """
sections:
  A: {panel: CP, track: main, position: 18.0}
  B: {panel: CP, track: main, position: 18.6}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  rate: 5000
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: N, mounting: hammer}
    rail: {source: rail, quantity: acceleration, unit: m/s², mounting: rail head at sleeper}
passages:
  files: "passages/{time}.{ext}"
  rate: 5000
  channels:
    A: {source: A, quantity: acceleration, unit: m/s², mounting: rail web, section: A, limit: 500}
    B: {source: B, quantity: acceleration, unit: m/s², mounting: rail web, section: B, limit: 500}
"""
TRACK = """
# An even track, for tests.
name: small
layers: 2
extent:
  from: {value: 0, unit: m, source: chosen}
  to: {value: 36, unit: m, source: chosen}
spacing: {value: 0.6, unit: m, source: chosen}
absorbing_end:
  length: {value: 6, unit: m, source: chosen}
  rate: {value: 400, unit: 1/s, source: chosen}
rail:
  youngs_modulus: {value: 210, unit: GPa, source: chosen}
  second_moment: {value: 3037, unit: cm⁴, source: chosen}
  area: {value: 76.7, unit: cm², source: chosen}
  mass: {value: 60.2, unit: kg/m, source: chosen}
  shear_modulus: {value: 80.77, unit: GPa, source: chosen}
  shear_coefficient: {value: 0.393, unit: "-", source: chosen}
  density: {value: 7850, unit: kg/m³, source: chosen}
support:
  pad_stiffness: {value: 300, unit: MN/m, source: chosen}
  pad_damping: {value: 30, unit: kN s/m, source: chosen}
  sleeper_mass: {value: 140, unit: kg, source: chosen}
  ballast_stiffness: {value: 100, unit: MN/m, source: chosen}
  ballast_damping: {value: 70, unit: kN s/m, source: chosen}
routes:
  main: []
locations:
  A: {place: {value: 18.0, unit: m, source: chosen}}
  B: {place: {value: 18.6, unit: m, source: chosen}}
"""


def write_configuration(folder, repository):
    """Write the configuration of the turnout "t1"; return its folder."""
    config = Path(folder) / "config"
    for sub in ("layouts", "tracks"):
        (config / sub).mkdir(parents=True, exist_ok=True)
    shutil.copytree(repository / "config" / "vehicles", config / "vehicles", dirs_exist_ok=True)
    (config / "config.yaml").write_text("mismatch: {refits: 2, iterations: 3, base_iterations: 6, effects: 1}\n")
    (config / "turnouts.tsv").write_text("turnout\tlayout\nt1\tsmall\n")
    (config / "layouts" / "small.yaml").write_text(LAYOUT)
    (config / "tracks" / "small.yaml").write_text(TRACK)
    return config


def hanging_sleeper(gap):
    """A gap [m] under the sleeper at section A, as effects on any part of the track."""
    return lambda track: (physics.HangingSleeper(track.nearest_support(SLEEPER), gap),)


def soft_pad(track):
    """A rail pad with 0.3 of its stiffness on the sleeper at section A."""
    return (physics.LocalPad(track.nearest_support(SLEEPER), SOFT),)


def write_hammer_tests(folder, terms=None, labels=("A", "B"), day=DAY, impacts=3, seed=1, turnout="t1"):
    """Write the hammer tests of a campaign."""
    config, raw = Path(folder) / "config", Path(folder) / "raw" / turnout
    track = load_track("small", folder=config / "tracks")
    for k, label in enumerate(labels):
        place = PLACES[label]
        made = terms(stretch_of_track(track.track, place)) if terms else ()
        sensors = (Sensor("rail", place, "rail head at sleeper", noise=0.02),)
        hammer = Hammer(force=Sensor("force", place, "hammer", "force", noise=1.0), position_spread=0.0)
        recordings = simulate_hammer(
            track, place, hammer, sensors, impacts, made, seed + k, 5000.0, 0.4, started_at=day,
        )  # fmt: skip
        path = raw / "hammer" / f"{day:%Y-%m-%d}" / f"{label}_1.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        write([replace(r, conditions={}) for r in recordings], path, "hdf5")


def write_passages(
    folder, terms=None, speeds=(90.0, 110.0), day=DAY, change=None, seed=1, vehicle="locomotive", noted=True
):
    """Write passages of a locomotive, one an hour; ``change`` (recording) -> recording alters each file."""
    config, raw = Path(folder) / "config", Path(folder) / "raw" / "t1"
    track = load_track("small", folder=config / "tracks")
    sensors = tuple(Sensor(name, x, "rail web", noise=0.02) for name, x in PLACES.items())
    for k, speed in enumerate(speeds):
        made = terms(track.track) if terms else ()
        train = load_vehicle(vehicle, 0.0, config / "vehicles")
        moment = day + timedelta(hours=k + 1)
        recording = simulate_passage(
            track, train, speed / 3.6, sensors, roughness=-12.0, terms=made, seed=seed, rate=5000.0, lead=0.5,
            tail=0.4, started_at=moment,
        )  # fmt: skip
        recording = change(recording) if change else recording
        recording = recording if noted else replace(recording, conditions={})
        path = raw / "passages" / f"{moment:%Y%m%dT%H%M%SZ}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        write([recording], path, "hdf5", single=True)
