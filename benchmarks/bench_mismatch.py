"""Benchmarks of the diagnosis: a recorded oscillator, information in planned campaigns, cases of a track, cost.

The whole development set takes hours of one core. By default three of its cases run. TURNOUT_MISMATCH_CASES names
others, and "all" runs every one. "whole turnout" is one of eight hammer points and twenty trains.
"""

import os
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from examples.oscillator_case import OscillatorCase

from benchmarks.bar import Bar, stopwatch
from turnout import physics
from turnout.mismatch import diagnose
from turnout.mismatch.engine.distinguishability import distinguishability
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.reserved_data import predict_reserved
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import PlannedCase, measured_campaign, small_plan, turnout_plan
from turnout.stages.recording_choice import reserved_names, select_passages

EFFECTS = {
    "hanging_sleeper": (physics.HangingSleeper(39, 5e-4), {"place": 23.4}),
    "local_ballast": (physics.LocalBallast(36, 0.3), {"place": 21.6}),
    "local_pad": (physics.LocalPad(40, 3.0), {"place": 24.0}),
    "attached_resonator": (physics.AttachedResonator(38, 25.0, 180.0), {"place": 22.8}),
    "pad_temperature": (physics.PadTemperature(0.012), {}),
    "pad_preload": (physics.PadPreload(5e3), {}),
    "zener_pad": (physics.ZenerPad(0.8), {}),
    "rail_shear": (physics.RailShear(3.0), {}),
    "ballast_inertia": (physics.BallastInertia(200.0, 2e4), {}),
    "sleeper_mode": (physics.SleeperMode(0.3, 250.0), {}),
    "surface_dip": (physics.SurfaceDip(23.1, 6e-4, 0.5), {"place": 23.1}),
    "wheel_flat": (physics.WheelFlat(2, 0.08, 0.43, 1.1, "heavy"), {"train": "heavy", "axle": 3}),
    "unsprung_mass": (physics.UnsprungMass(1.5, "heavy"), {"train": "heavy"}),
    "sensor_gain": (physics.SensorGain("S3", 1.3), {"sensor": "S3"}),
    "mount_resonance": (physics.MountResonance("S1", 1 / 350.0, 8.0), {"sensor": "S1"}),
    "time_offset": (physics.TimeOffset("S4", 1.5e-3), {"sensor": "S4"}),
    "sensor_position": (physics.SensorPosition("S3", 0.4), {"sensor": "S3"}),
    "clipping": (physics.Clipping("S3", 2.0), {"sensor": "S3"}),
    "hum": (physics.Hum("S2", 0.5, 0.3), {"sensor": "S2"}),
    "ballast_hardening": (physics.BallastHardening(38, 40, 8.0), {"place": 23.4}),
    "dry_friction": (physics.DryFriction(37, 4000.0), {"place": 22.2}),
    "contact_stiffness": (physics.ContactStiffness(0.3), {}),
    "rail_corrugation": (physics.RailCorrugation(21.0, 27.0, 8e-5, 4e-5, 0.45), {}),
    "out_of_round": (physics.OutOfRound(1, 2e-4, 1.5e-4, 6), {"axle": 2}),
    "low_pass": (physics.LowPass("S3", 1 / 350.0), {"sensor": "S3"}),
    "high_pass": (physics.HighPass("S4", 18.0), {"sensor": "S4"}),
    "clock_drift": (physics.ClockDrift("S1", 2e-3), {"sensor": "S1"}),
}
# Later ones, so that the others keep their seeds. The gap is one that only the heavy train closes: one that no train
# closes cannot be distinguished from missing ballast.
SECOND_EFFECTS = {
    "hanging_sleeper": (physics.HangingSleeper(43, 8e-4), {"place": 25.8}),
    "passage_delay": (physics.PassageDelay("S4", 1.5e-3), {"sensor": "S4"}),
    "passage_gain": (physics.PassageGain("S3", 1.3), {"sensor": "S3"}),
    "hammer_delay": (physics.HammerDelay("S4", 1.5e-3), {"sensor": "S4"}),
    "hammer_gain": (physics.HammerGain("S3", 1.3), {"sensor": "S3"}),
    "loose_fastening": (physics.LooseFastening(38, 40, 0.8), {"place": 23.4}),
}
DEVELOPMENT = [(f"control {k}", None, {}) for k in range(12)]
DEVELOPMENT += [(name, *entry) for more in (EFFECTS, SECOND_EFFECTS) for name, entry in more.items()]
WHOLE = "whole turnout"
DEFAULT_CASES = ("control 0", "pad_temperature", "hanging_sleeper")


def bars():
    """Yield every bar."""
    yield from silverbox()
    yield from campaign_planning()
    yield from development()
    yield from whole_turnout()


def silverbox():
    """The recorded oscillator, with all laws as candidates and without the right one."""
    shared = Path(os.environ.get("TURNOUT_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
    path = shared / "nonlinear_silverbox" / "SNLS80mV.csv"
    if not path.is_file():
        return
    u, y = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1)).T
    segments = [slice(40650 + k * 8692, 40650 + (k + 1) * 8692) for k in range(10)]
    sines = [(f"multisine {k}", f"multisine {k}", u[p], y[p]) for k, p in enumerate(segments)]
    reserved = [sines[8], sines[9], ("arrow", "arrow", u[:40000], y[:40000])]

    def case(**options):
        return OscillatorCase(sines[:8], reserved, 1e7 / 2**14, (60.0, 30.0), (0.1, 0.1), (1.0, 1.0), **options)

    full_case = case()
    with stopwatch() as watch:
        diagnosis = diagnose(full_case)
    fits = [fit_percent([o], [p]) for o, p in zip(reserved_of(full_case), reserved_predictions(full_case, diagnosis))]
    yield Bar(
        "Silverbox: cubic law chosen of ten (1 yes)", float(diagnosis.names == ("cubic_spring",)), 1.0, sense=">="
    )
    yield Bar("Silverbox: held-out multisines", min(fits[:2]), 98.0, "%", ">=", "n=2")
    yield Bar("Silverbox: arrow, beyond the range", fits[2], 96.0, "%", ">=", "n=1", f"{watch.cpu:.1f} CPU s")
    answer_without = diagnose(case(without=("cubic_spring",))).verdict.answer
    yield Bar("Silverbox without the cubic law: unknown (1 yes)", float(answer_without == "unknown"), 1.0, sense=">=")


def reserved_of(case):
    """Observations reserved for the verification."""
    return case.reserved


def reserved_predictions(case, diagnosis):
    """Predictions of the reserved observations by the fitted model."""
    return predict_reserved(case, diagnosis.fit, case.reserved)


def campaign_planning():
    """Evidence lost if an effect is explained by nuisance parameters alone [nats]."""

    def nats_lost(plan, family):
        matrix = distinguishability(PlannedCase(plan, families=(family,)))
        return float(matrix.detectability[0])

    one, two = small_plan((30.0,), passages=False), small_plan((5.0, 30.0), passages=False)
    rolling = replace(small_plan((15.0,), speeds=(40.0,)), hammer_points=())
    yield Bar(
        "evidence of pads that soften when warm, from one temperature", nats_lost(one, "pad_temperature"), 5.0, "nats"
    )
    yield Bar(
        "evidence of pads that soften when warm, from two", nats_lost(two, "pad_temperature"), 1000.0, "nats", ">="
    )
    yield Bar("evidence of frequency-dependent pads from passages alone", nats_lost(rolling, "zener_pad"), 5.0, "nats")
    yield Bar(
        "evidence of frequency-dependent pads from impacts alone", nats_lost(one, "zener_pad"), 1000.0, "nats", ">="
    )


def development():
    """Cases simulated by the same code as in the diagnosis: a necessary test, not a sufficient one."""
    wanted = os.environ.get("TURNOUT_MISMATCH_CASES", ",".join(DEFAULT_CASES)).split(",")
    chosen = [(k, *c) for k, c in enumerate(DEVELOPMENT) if wanted == ["all"] or c[0] in wanted]
    if not chosen:
        return
    right, alarms, controls, covered, costs = 0, 0, 0, 0, []
    for k, name, term, where in chosen:
        campaign = measured_campaign(small_plan(), (term,) if term else (), 500 + k)
        with stopwatch() as watch:
            diagnosis = diagnose(TrackCase(campaign))
        costs.append(watch.cpu)
        answer = diagnosis.verdict.answer
        yield Bar(f"development: cost of {name}", watch.cpu, 15.0 if answer == "none" else 60.0, "CPU s", note=answer)
        if term is None:
            controls += 1
            alarms += diagnosis.verdict.answer != "none"
            continue
        is_named = diagnosis.names[:1] == (name,)
        right += is_named and is_located(diagnosis, where)
        covered += is_named and is_covered(diagnosis, term)
    n = len(chosen) - controls
    yield Bar("development: false alarms", float(alarms), 0.0, sense="<=", n=f"n={controls}")
    if n:
        yield Bar("development: named and placed right", 100.0 * right / n, 95.0, "%", ">=", f"n={n}")
        yield Bar(
            "development: inside the 95 % interval, of those named", 100.0 * covered / max(right, 1), 90.0, "%", ">="
        )
    yield Bar("development: cost of a small case, worst", max(costs), 60.0, "CPU s", n=f"n={len(costs)}")


def whole_turnout():
    """One turnout as a maintainer measures it. It takes minutes and runs only on request."""
    if WHOLE not in os.environ.get("TURNOUT_MISMATCH_CASES", ""):
        return
    campaign = measured_campaign(turnout_plan(), (physics.HangingSleeper(52, 8e-4),), 700)
    chosen = select_passages(campaign.passages)  # as `turnout diagnose` does
    campaign = replace(campaign, passages=tuple(chosen), reserved=reserved_names(chosen, campaign.hammer))
    started = time.monotonic()
    with stopwatch() as watch:
        diagnosis = diagnose(TrackCase(campaign), progress=_print_progress)
    note = f"{diagnosis.verdict.answer} {', '.join(diagnosis.names)}; {watch.cpu:.0f} CPU s"
    right = diagnosis.names[:1] == ("hanging_sleeper",) and is_located(diagnosis, {"place": 31.2})
    yield Bar("whole turnout: hanging sleeper named and placed (1 yes)", float(right), 1.0, sense=">=", n=note)
    yield Bar("whole turnout: time", (time.monotonic() - started) / 60.0, 15.0, "min")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    yield Bar("whole turnout: memory", memory, 4.0, "GiB")


def _print_progress(n_done, total, what):
    print(f"  fit {n_done} of {total}: {what}", file=sys.stderr, flush=True)


def is_located(diagnosis, where):
    """Whether the position is right within one bay, and sensor and train are right."""
    stated = diagnosis.fit.candidates[0].where
    for key, value in where.items():
        if key == "place" and abs(stated.get("place", np.inf) - value) > 0.6:
            return False
        if key != "place" and stated.get(key) != value:
            return False
    return True


def is_covered(diagnosis, term):
    """Whether the first parameter is within 1.96 standard errors.

    For a sine and a cosine their amplitude is compared, since their shares depend on the origin of the position.
    """
    candidate, n = diagnosis.fit.candidates[0], len(diagnosis.fit.values)
    names = [p.name for p in candidate.parameters]
    if {"sine", "cosine"} <= set(names):
        waves = [names.index("sine"), names.index("cosine")]
        size, covariance = diagnosis.fit.psi[waves], diagnosis.fit.covariance[n:, n:][np.ix_(waves, waves)]
        amplitude = np.hypot(*size)
        se = np.hypot(np.sqrt(size @ covariance @ size) / amplitude, candidate.effect.model_error_share * amplitude)
        return abs(amplitude - np.hypot(term.sine, term.cosine)) <= 1.96 * se
    return abs(diagnosis.fit.psi[0] - getattr(term, names[0])) <= 1.96 * diagnosis.fit.psi_se[0]
