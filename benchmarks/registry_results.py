"""Work batches for the benchmarks: results of hammer campaigns and passages, as the shards write them."""

import random
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from turnout.registry.ids import content_id
from turnout.workflow.batches import UnitResult, write_batch

SHARDS = 64


def hammer_batches(folder: Path, n: int, complete: bool = False) -> list[Path]:
    """``n`` results of one campaign: three recordings, model, two modes; ``complete`` adds impacts and receptance."""
    return _batches(folder, n, lambda i, generator: _hammer(i, generator, complete))


def passage_batches(folder: Path, n: int) -> list[Path]:
    """``n`` passages at 20 turnouts over a year, 12 sensors each."""
    return _batches(folder, n, _passage)


def _batches(folder, n, make):
    folder.mkdir(parents=True, exist_ok=True)
    generator, per = random.Random(1), -(-n // SHARDS)
    return [write_batch(folder, [make(i, generator) for i in range(k, min(n, k + per))]) for k in range(0, n, per)]


def _id(generator):
    return f"{generator.getrandbits(128):032x}"


def _hammer(i, g, complete):
    t, label, day = f"t{i // 8:04d}", f"S{i % 8}", "2026-01-05"
    base = {"turnout_id": t, "section_id": f"{t}/{label}"}
    campaign = {"campaign_id": f"{t}/{day}"}
    at, model_id = f"{day}T10:00:00", _id(g)
    recordings = [
        base | campaign | {
            "recording_id": _id(g), "kind": "hammer", "path": f"{t}/hammer/{day}/{label}_{k}.uff", "file_format": "uff",
            "file_bytes": 983_040, "sampling_rate_hz": 20000.0, "n_channels": 2, "n_records": 10, "n_samples": 4096,
            "expected_n_samples": 4096,
        }
        for k in (1, 2, 3)
    ]  # fmt: skip
    model = base | campaign | {
        "model_id": model_id, "measured_at_utc": at, "method": "joint", "status": "accepted", "model_order": 4,
        "sampling_rate_hz": 20000.0, "a_matrix": np.array([g.random() for _ in range(16)]),
        "b_vector": np.array([g.random() for _ in range(4)]), "c_vector": np.array([g.random() for _ in range(4)]),
        "n_impacts_used": 28, "n_impacts_rejected": 2, "coherence_minimum": 0.93, "hammer_fit_pct": 88.1,
        "code_version": "1", "config_hash": "abc",
    }  # fmt: skip
    modes = [
        base | {
            "model_id": model_id, "band": band, "measured_at_utc": at, "frequency_hz": f + g.gauss(0, 0.01 * f),
            "frequency_se_hz": 0.3 + 0.1 * g.random(), "frequency_sd_hz": 1 + g.random(),
            "damping_ratio": 0.1 + g.gauss(0, 0.003), "damping_se": 0.002 + 0.001 * g.random(),
            "rail_temperature_c": 12.3, "n_impacts": 28, "source": "hammer",
        }
        for band, f in (("ballast", 150.0), ("railpad", 480.0))
    ]  # fmt: skip
    tables = {"recordings": recordings, "models": [model], "modes": modes, "quarantine": []}
    if complete:
        tables |= _details(recordings[0]["recording_id"], model_id, base, campaign, at, g)
    return UnitResult(f"{t}/hammer/{label}/{day}", t, "hammer", "k", "1", "ok", tables)


def _details(recording_id, model_id, base, campaign, at, g):
    """30 impacts, 60 estimates and the curves of one result."""
    impacts = [
        base | campaign | {
            "impact_id": f"{recording_id}:{k}", "recording_id": recording_id, "test": 1, "record": k,
            "status": "accepted", "peak_n": 1e4 * g.random(),
            "contact_ms": g.random(), "impulse_ns": g.random(), "noise_ms2": g.random(),
            "band_edge_hz": 1200.0,
        }
        for k in range(30)
    ]  # fmt: skip
    estimates = [
        {
            "model_id": model_id, "impact_id": f"{recording_id}:{k}", "band": band, "section_id": base["section_id"],
            "measured_at_utc": at, "frequency_hz": 100 + g.random(), "frequency_se_hz": g.random(),
            "damping_ratio": 0.1 + 0.01 * g.random(), "damping_se": g.random(),
        }
        for k in range(30)
        for band in ("ballast", "railpad")
    ]  # fmt: skip
    curve = np.array([g.random() for _ in range(240)], dtype=np.float32)
    names = ("frequency_hz", "h1_real_m_n", "h1_imag_m_n", "h2_abs_m_n", "hv_abs_m_n", "coherence", "coherence_low")
    receptance = base | campaign | dict.fromkeys((*names, "coherence_high", "decay_ms2", "decay_model_ms2"), curve) | {
        "model_id": model_id, "measured_at_utc": at, "n_impacts": 28, "gate": "limit", "valid_to_hz": 1200.0,
        "passed": curve > 0.5, "decay_rate_hz": 20000.0, "stabilisation_json": "[]",
    }  # fmt: skip
    return {"impacts": impacts, "impact_modes": estimates, "receptances": [receptance]}


TRAINS = (("IC", 160.0, 18.0), ("Regio", 120.0, 14.0), ("freight", 90.0, 22.0), ("ICE", 180.0, 16.5))


def _passage(i, g):
    t = f"p{i % 20:03d}"
    at = (datetime(2025, 4, 1) + timedelta(seconds=300.0 * i + 100 * g.random())).isoformat(timespec="milliseconds")
    train, speed, load = TRAINS[g.randrange(4)]
    base = {"turnout_id": t, "passed_at_utc": at}
    passage_id, recording_id, n_axles = _id(g), _id(g), g.choice((16, 24, 32, 48))
    speed, load = g.gauss(speed, 10), g.gauss(load, 1.5)
    passage = base | {
        "passage_id": passage_id, "recording_id": recording_id, "status": "accepted", "n_axles": n_axles,
        "speed_kmh": speed, "speed_se_kmh": 0.2, "acceleration_ms2": g.gauss(0, 0.05), "speed_source": "recording",
        "direction": "facing", "track": "main", "train_type": train, "train_type_probability": 0.99,
        "train_type_source": "recording", "axle_load_t": load, "axle_load_se_t": 0.5,
        "axle_load_source": "timetable", "axle_times_s": np.cumsum([0.1 + g.random() for _ in range(n_axles)]),
        "cluster_id": f"{train}-{speed // 20:.0f}", "rail_temperature_c": g.gauss(12, 8),
    }  # fmt: skip
    fits = []
    for k in range(12):
        fit = 75 - 0.05 * speed - 0.2 * k + g.gauss(0, 4)
        fits.append(
            base | {
                "passage_id": passage_id, "section_id": f"{t}/S{k % 8}", "channel": f"a{k:02d}",
                "model_id": content_id(t, k), "status": "accepted" if fit > 55 else "null_explains", "fit_pct": fit,
                "fit_null_pct": 52 + g.gauss(0, 0.7), "forecast_pct": fit - 30 + g.gauss(0, 3),
                "forecast_null_pct": 12 + g.gauss(0, 0.7), "leave_one_out_pct": fit - 15 + g.gauss(0, 3),
                "leave_one_out_null_pct": 30 + g.gauss(0, 0.7), "parameters_per_s": 3.0 * n_axles / 10,
                "chi_squared_failed_share": g.randrange(n_axles // 2) / n_axles, "n_wheels": n_axles,
                "along_b_share": min(1.0, max(0.0, g.gauss(0.7, 0.15))), "forecast_others_pct": fit + g.gauss(-38, 5),
                "peak_ms2": 100 * (1 + 0.2 * g.random()),
            }
        )  # fmt: skip
    recording = {
        "recording_id": recording_id, "turnout_id": t, "passage_id": passage_id, "kind": "passage",
        "path": f"{t}/passages/{at}.tdms", "file_format": "tdms", "file_bytes": 9_600_000, "sampling_rate_hz": 20000.0,
        "n_channels": 12, "n_records": 1, "n_samples": 200_000,
    }  # fmt: skip
    tables = {"passages": [passage], "passage_fits": fits, "recordings": [recording]}
    return UnitResult(f"{t}/passage/{at}", t, "passage", "k", "1", "ok", tables)
