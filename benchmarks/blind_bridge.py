"""One case of a blind set -> finding rows, by the diagnosis as a library.

``python -m benchmarks.blind_bridge FOLDER CASE ROWS.json`` reads FOLDER/config and FOLDER/raw as any user's, and
writes rows with the columns of mismatch_findings. It reads neither truth nor generator.
"""

import json
import sys
from pathlib import Path

from turnout.config.load import load_configuration, with_raw
from turnout.mismatch.diagnose import diagnose
from turnout.mismatch.track.campaign import Campaign, HammerTest, Passage
from turnout.mismatch.track.track_case import TrackCase
from turnout.readers import read
from turnout.simulate import Sensor, load_track, load_vehicle


def campaign_of(folder, case):
    """``Campaign`` of the recordings and notes below ``folder``; two passages of eight are reserved."""
    folder = Path(folder)
    turnout = with_raw(load_configuration(folder / "config").turnout(case), folder / "raw")
    track = load_track(folder / "config" / "tracks" / "site.yaml")
    channels = turnout.passages.description.channels
    sensors = tuple(Sensor(c.name, c.position, c.mounting) for c in channels)
    passages = tuple(_passages(folder, case, turnout))
    reserved = {}
    for passage in sorted(passages, key=lambda p: p.speed):
        reserved[passage.train] = passage.name  # the fastest of each train
    kept = tuple(reserved[t] for t in ("railcar", "loaded") if t in reserved)
    return Campaign(track, sensors, tuple(_tests(folder, case, turnout, track)), passages, kept)


def _tests(folder, case, turnout, track):
    for path in sorted((folder / "raw" / case).glob("hammer/*/*.npz")):
        section, day = path.stem.split("_")[0], path.parent.name
        made = read(path, folder / "raw", turnout.hammer.descriptions[section]).recordings
        place = track.locations[section][0]
        noted = {"rail_temperature": turnout.campaigns[day].rail_temperature}
        yield HammerTest(f"{section} {day}", place, made, "force", day, noted)


def _passages(folder, case, turnout):
    paths = sorted((folder / "raw" / case).glob("passages/*.npz"))
    vehicles = {}
    for path, train in zip(paths, sorted(turnout.trains, key=lambda t: t["passed_at_utc"])):
        if not train["speed_kmh"]:
            continue  # nobody noted its speed
        recording = read(path, folder / "raw", turnout.passages.description).recordings[0]
        name = train["train_type"]
        vehicles.setdefault(name, load_vehicle(name, 0.0, folder / "config" / "vehicles"))
        noted = {"rail_temperature": float(recording.conditions["rail_temperature"])}
        yield Passage(path.stem, recording, vehicles[name], float(train["speed_kmh"]) / 3.6, name, conditions=noted)


def rows_of(diagnosis):
    """Finding rows, one per effect found, or one "none"."""
    rows, seen = [], diagnosis.verification
    for verdict in diagnosis.verdicts:
        best = verdict.scores[0] if verdict.scores and verdict.names else None
        where = dict(best.candidate.where) if best else {}
        names, candidate = verdict.names, best.candidate if best else None
        frame = candidate.frame if best else diagnosis.frames[0].frame if diagnosis.frames else None
        n = len(candidate.parameters) if best else 0
        values = zip(candidate.parameters, best.fit.psi[-n:], best.fit.psi_se[-n:]) if n else ()
        numbers = {p.name: {"value": float(v), "se": float(s), "unit": p.unit} for p, v, s in values}
        rows.append(
            {
                "verdict": verdict.answer, "grade": verdict.grade or None, "term": names[0] if names else None,
                "rival_term": names[1] if len(names) > 1 else None, "locked_to": frame,
                "position_m": where.get("place"), "channel": where.get("sensor"),
                "probability": verdict.probability, "fit_before_pct": _number(seen.before),
                "fit_after_pct": _number(seen.after), "fit_rival_pct": _number(seen.rival),
                "fit_decoy_pct": _number(seen.decoy), "n_held_out": seen.n, "sentence": verdict.reason,
                "parameters_json": json.dumps({**numbers, "where": where}),
            }
        )  # fmt: skip
    return rows


def _number(value):
    return None if value is None or value != value else float(value)


def main(folder, case, out):
    """Diagnose and write."""
    rows = rows_of(diagnose(TrackCase(campaign_of(folder, case))))
    Path(out).write_text(json.dumps(rows, indent=1) + "\n")
    print(", ".join(f"{r['verdict']} {r['term'] or ''}".strip() for r in rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
