"""A small artificial fleet with season, noise, events and passages for tests of views. Its values have no meaning."""

from datetime import datetime, timedelta

import numpy as np

from turnout.registry.ids import content_id
from turnout.workflow.batches import UnitResult

START = datetime(2023, 1, 9, 10)
TURNOUTS, SECTIONS, CAMPAIGNS = ("north_1", "south_2"), ("OT", "A7", "A9"), 75
FREQUENCY = {"ballast": 150.0, "railpad": 480.0}


def fleet_tables():
    """Turnouts, sections and events; two events on one day, one of a single section, one before all campaigns."""
    events = [
        ("north_1", None, datetime(2024, 3, 5), "tamping", True, False),
        ("north_1", "north_1/A7", datetime(2024, 9, 2), "pad_exchange", False, True),
        ("south_2", None, datetime(2024, 6, 3), "tamping", True, False),
        ("south_2", None, datetime(2024, 6, 3), "sensor_change", True, True),
        ("south_2", None, datetime(2022, 6, 3), "tamping", True, False),
    ]
    keys = ("turnout_id", "section_id", "event_at_utc", "kind", "resets_ballast", "resets_railpad")
    return {
        "turnouts": [
            {"turnout_id": t, "name": t.replace("_", " "), "line": "L", "km": 1.5, "layout": "l", "config_hash": "h"}
            for t in TURNOUTS
        ],
        "sections": [
            {
                "section_id": f"{t}/{s}", "turnout_id": t, "label": s, "panel": "OT" if s == "OT" else "CP",
                "track": "main", "position_m": 5.0 * i,
            }
            for t in TURNOUTS
            for i, s in enumerate(SECTIONS)
        ],
        "events": [{"event_id": content_id(*map(str, e))} | dict(zip(keys, e)) for e in events],
    }  # fmt: skip


def hammer_results(seed=1):
    """One result per section and campaign, every 14 days; ballast of north_1/A7 falls by 2 %/a."""
    generator = np.random.default_rng(seed)
    results = []
    for t in TURNOUTS:
        for k in range(CAMPAIGNS):
            at = START + timedelta(days=14 * k)
            season = 10 - 15 * np.cos(2 * np.pi * (at - datetime(2023, 1, 15)).days / 365.25)
            temperature = round(float(season + generator.normal(0, 5)), 1)
            campaign = {"campaign_id": f"{t}/{at:%Y-%m-%d}"}
            for s in SECTIONS:
                results.append(_result(t, s, at, campaign, None if k % 17 == 3 else temperature, generator, k))
    return results


def _result(t, s, at, campaign, temperature, generator, k):
    base = {"turnout_id": t, "section_id": f"{t}/{s}"}
    model_id = content_id(t, s, str(at))
    rejected = (t, s, k) == ("south_2", "A9", 20)
    model = base | campaign | {
        "model_id": model_id, "measured_at_utc": at, "method": "joint",
        "status": "rejected" if rejected else "accepted",
        "n_impacts_used": 28, "n_impacts_rejected": 2, "code_version": "1", "config_hash": "h",
        "reason": "low_coherence" if rejected else None, "measured_value": 0.41 if rejected else None,
        "limit_value": 0.8 if rejected else None, "coherence_minimum": 0.93,
    }  # fmt: skip
    modes = []
    for band, f0 in FREQUENCY.items():
        drift = -0.02 * (at - START).days / 365.25 if (t, s, band) == ("north_1", "A7", "ballast") else 0.0
        warm = -0.0015 * ((temperature if temperature is not None else 10.0) - 10.0)
        f = f0 * (1 + drift + warm + 0.006 * generator.standard_normal())
        modes.append(
            base | {
                "model_id": model_id, "band": band, "measured_at_utc": at, "frequency_hz": f, "frequency_se_hz": 0.4,
                "damping_ratio": 0.1, "damping_se": 0.004, "rail_temperature_c": temperature, "n_impacts": 28,
                "source": "hammer",
            }
        )  # fmt: skip
    impacts = [
        base | campaign | {
            "impact_id": f"{model_id}:{i}", "recording_id": model_id, "record": i,
            "status": "rejected" if i == 7 else "accepted", "reason": "double_hit" if i == 7 else None,
        }
        for i in range(8)
    ]  # fmt: skip
    tables = {"models": [model], "modes": [] if rejected else modes, "impacts": impacts if k == 5 else []}
    return UnitResult(f"{t}/hammer/{s}/{at:%Y-%m-%d}", t, "hammer", "k", "1", "ok", tables)


def passage_results(seed=2, n=400):
    """One result per passage of north_1 with two sensors; the scores of A9 fall by 4 % in the last four weeks."""
    generator = np.random.default_rng(seed)
    types = [("IC", 160.0, 18.0), ("Regio", 120.0, 14.0), ("freight", 90.0, 22.0)]
    return [_passage(k, generator, *types[generator.integers(3)], n) for k in range(n)]


def _passage(k, generator, train, speed, load, n):
    at = START + timedelta(days=600 * (k + float(generator.random())) / n)
    base = {"turnout_id": "north_1", "passed_at_utc": at}
    passage_id = content_id("passage", k)
    passage = base | {
        "passage_id": passage_id, "recording_id": content_id("recording", k), "n_axles": 16, "train_type": train,
        "status": "rejected" if k == 11 else "accepted", "reason": "train_cut_off" if k == 11 else None,
        "speed_kmh": speed + 10 * generator.standard_normal(), "track": "main", "direction": "facing",
        "axle_load_t": None if k % 50 == 9 else load + generator.standard_normal(), "cluster_id": f"c-{train}",
    }  # fmt: skip
    fits = []
    for s in ("A7", "A9"):
        fell = 4.0 if s == "A9" and (START + timedelta(days=600) - at).days < 28 else 0.0
        fit = 70.0 - 0.1 * (passage["speed_kmh"] - 100) + 4 * generator.standard_normal() - fell
        fits.append(
            base | {
                "passage_id": passage_id, "section_id": f"north_1/{s}", "channel": f"a_{s}", "model_id": f"m{s}",
                "status": "null_explains" if fit < 62 else "accepted", "fit_pct": fit, "fit_null_pct": 55.0,
                "forecast_pct": fit - 30, "leave_one_out_pct": None if k % 7 == 0 else fit - 15, "n_wheels": 16,
                "peak_ms2": 100.0,
            }
        )  # fmt: skip
    recording = {
        "recording_id": passage["recording_id"], "turnout_id": "north_1", "passage_id": passage_id, "kind": "passage",
        "path": f"north_1/passages/{at:%Y%m%dT%H%M%SZ}.tdms", "file_format": "tdms",
    }  # fmt: skip
    tables = {"passages": [passage], "passage_fits": fits, "recordings": [recording]}
    return UnitResult(f"north_1/passage/{at:%Y%m%dT%H%M%SZ}-{k}", "north_1", "passage", "k", "1", "ok", tables)


def quarantine_results():
    """Three files that could not be read."""
    rows = [("truncated", 1312.0, 4096.0), ("not_finite", None, None), ("truncated", 12.0, 4096.0)]
    results = []
    for i, (reason, value, limit) in enumerate(rows):
        path = f"south_2/hammer/2026-01-05/OT_{i}.uff"
        row = {
            "turnout_id": "south_2", "section_id": "south_2/OT", "kind": "hammer", "path": path, "stage": "read",
            "reason_code": reason, "place": "record 7 of 30", "found": "ends early", "remedy": "Copy the file again",
            "measured_value": value, "threshold": limit,
        }  # fmt: skip
        unit = f"south_2/hammer/OT{i}/2026-01-05"
        results.append(UnitResult(unit, "south_2", "hammer", "k", "1", "quarantined", {"quarantine": [row]}))
    return results
