"""Benchmarks of the hammer test: quality of impacts, windows, coherence gate, and cost."""

from functools import cache

import numpy as np

from benchmarks import hammer_impacts as simulated
from benchmarks import off_axis, random_tracks
from benchmarks.bar import Bar, stopwatch
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts, receptance_of
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.hammer_test.response_scale import equivalent_free_rails
from turnout.records import Recording
from turnout.signal.coherence import coherence_limits, lower_coherence_limit
from turnout.signal.filters import force_pulse
from turnout.signal.spectra import correct_poles

N_TEST = 400


def bars():
    """Definitions: second hits of 5-30 % after 4-50 ms, tips of 0.1-3 ms in four pulse families, 12-bit loggers."""
    yield from impact_quality()
    yield from response_faults()
    yield from windows_and_gate()
    yield from best_subset()
    yield from speed()


@cache
def detection_rates(fault, tips=(1e-4, 3e-3), noise=(1e-3, 1e-2), reason=None):
    """(share of faulty impacts detected, share of accepted impacts with any finding, numbers of both)."""
    rng = np.random.default_rng(17)
    n_named = n_faulty = n_alarms = n_sound = 0
    for _ in range(N_TEST):
        impacts = find_impacts(simulated.test_of(rng, fault, tips=tips, noise=noise), "hammer", "rail")
        sound_impacts = impacts if fault is None else impacts[:-1]
        n_alarms += sum(bool(i.rejections or i.notes) for i in sound_impacts)
        n_sound += len(sound_impacts)
        if fault is not None:
            n_faulty += 1
            n_named += reason in {r.reason for r in (*impacts[-1].rejections, *impacts[-1].notes)}
    return n_named / max(n_faulty, 1), n_alarms / n_sound, n_faulty, n_sound


def impact_quality():
    detected, alarms, n, m = detection_rates(simulated.second_impact, reason="double_hit")
    yield Bar("second hits found", detected, 0.99, sense=">=", n=f"n={n}")
    yield Bar("findings on accepted impacts of the same tests", alarms, 0.01, n=f"n={m}")
    for name in ("hard_clip", "analog_clip", "soft_clip"):
        fault = getattr(simulated, name)
        detected, alarms, n, m = detection_rates(fault, reason="overload")
        yield Bar(f"{name.replace('_', ' ')} found, tips 0.1-3 ms", detected, 0.95, sense=">=", n=f"n={n}")
        short, _, n, _ = detection_rates(fault, (1e-4, 3e-4), reason="overload")
        yield Bar("   of these tips 0.1-0.3 ms, 2 to 6 samples", short, sense="", n=f"n={n}")
        yield Bar("   findings on accepted impacts of the same tests", alarms, 0.01, n=f"n={m}")
    _, alarms, _, m = detection_rates(None, noise=(0.0, 0.0))
    yield Bar("findings on quiet 12-bit channels without noise", alarms, 0.01, n=f"n={m}")
    rng, clipped = np.random.default_rng(3), []
    for _ in range(100):
        recordings = simulated.test_of(rng, None, tips=(5e-4, 3e-3))
        samples = recordings[-1].samples.copy()
        limit = rng.uniform(0.5, 0.9) * np.max(np.abs(samples[1]))
        samples[1] = np.clip(samples[1], -limit, limit)
        last = find_impacts(
            [*recordings[:-1], Recording(samples, simulated.RATE, simulated.CHANNELS)], "hammer", "rail"
        )[-1]
        clipped.append("overload" in {r.reason for r in last.rejections})
    yield Bar("   hard clip of the response at 50-90 % found", float(np.mean(clipped)), sense="", n="n=100")


def reasons_on_tracks(rng, n_test, n_impact=10, **fault):
    """Set of reasons of each impact on random tracks, and by how much its response exceeds a limit."""
    reasons, excess = [], []
    for _ in range(n_test):
        recordings, of_test = random_tracks.hammer_test(rng, n_impact, **fault)
        impacts = find_track_impacts(recordings, "hammer", "rail", ReceptanceSettings())
        reasons += [{r.reason for r in i.rejections} for i in impacts]
        excess += list(of_test)
    return reasons, np.array(excess)


def response_faults():
    """Responses that are late, early, in a wrong unit or limited, on random tracks in closed form."""
    rng = np.random.default_rng(8)
    reasons, _ = reasons_on_tracks(rng, 100)
    yield Bar("intact impacts on random tracks that are rejected", np.mean(list(map(bool, reasons))), 0.003,
              n=f"n={len(reasons)}")  # fmt: skip
    for name, delays, bar in (
        ("response early by 1 to 15 ms: right reason", (-15e-3, -8e-3, -3e-3, -1e-3), 0.99),
        ("response late by 1 to 3 ms: right reason", (1e-3, 1.5e-3, 2e-3, 3e-3), 0.99),
        ("   late by 0.5 ms", (5e-4,), None),
    ):
        found = [r for d in delays for r in reasons_on_tracks(rng, 16, 6, delay=d)[0]]
        share = np.mean(["not_simultaneous" in r for r in found])
        yield Bar(name, share, bar, sense=">=" if bar else "", n=f"n={len(found)}")
    for name, factor in (("g as m/s²", 1 / 9.81), ("m/s² as g", 9.81), ("lbf as N", 4.448), ("N as lbf", 1 / 4.448)):
        found, _ = reasons_on_tracks(rng, 24, 6, factor=factor)
        share = np.mean(["out_of_scale" in r for r in found])
        is_large = abs(np.log(factor)) > 2.0
        yield Bar(f"{'' if is_large else '   '}{name}: found", share, 0.99 if is_large else None,
                  sense=">=" if is_large else "", n=f"n={len(found)}")  # fmt: skip
    tests = (random_tracks.hammer_test(rng, 3)[0] for _ in range(200))
    rails = [equivalent_free_rails(find_impacts(t, "hammer", "rail")).rails for t in tests]
    for name, share in (("least", 0.0), ("median", 0.5), ("largest", 1.0)):
        yield Bar(f"   resistance of random tracks, {name}", np.quantile(rails, share), unit="rails 54E1", sense="",
                  n=f"n={len(rails)}")  # fmt: skip
    found, excess = reasons_on_tracks(rng, 100, n_limited=2)
    is_found, is_limited = np.array(["overload" in r for r in found]), excess > 1.0
    yield Bar("limited before the filter by more than 10 %: found", np.mean(is_found[excess > 1.1]), sense="",
              n=f"n={np.sum(excess > 1.1)}")  # fmt: skip
    yield Bar("   by less: found", np.mean(is_found[is_limited & (excess <= 1.1)]), sense="",
              n=f"n={np.sum(is_limited & (excess <= 1.1))}")  # fmt: skip
    yield Bar("   impacts of the same tests below the limit: called limited", np.mean(is_found[~is_limited]), 0.003,
              n=f"n={np.sum(~is_limited)}")  # fmt: skip


def windowed_receptance(settings, noise=0.0):
    """(receptance, pole, residue) of a 150 Hz mode with 0.3 % damping in 0.2 s: 59 % of it remains at the end."""
    pole, residue = -0.003 * 2 * np.pi * 150 + 2j * np.pi * 150, 0.7 - 0.4j
    t = np.arange(4000) / simulated.RATE
    response = np.real(residue * np.exp(pole * t))
    rng, recordings = np.random.default_rng(2), []
    for k in range(10):
        force = rng.uniform(800, 1200) * force_pulse("half-sine", t - 5e-3, 1.5e-3)
        answer = np.convolve(force, response)[:4000]
        answer += noise * np.max(answer) * rng.standard_normal(4000)
        recordings.append(Recording(np.stack([force, answer]), simulated.RATE, simulated.CHANNELS, record=k))
    return receptance_of(find_impacts(recordings, "hammer", "rail", settings), settings), pole, residue


def fit_mode(result, decay):
    """Pole and residue of one mode, by linear least squares on the lines around it."""
    is_near = (result.frequency > 100) & (result.frequency < 200)
    f = result.frequency[is_near]
    h = result.h1[is_near] * (2j * np.pi * f + decay) ** 2
    q = np.exp(-2j * np.pi * f / simulated.RATE)
    rows = np.stack([np.ones_like(q), q, -q * h, -(q**2) * h], axis=1)
    system = np.concatenate([rows.real, rows.imag]), np.concatenate([h.real, h.imag])
    b0, b1, a1, a2 = np.linalg.lstsq(*system, rcond=None)[0]
    z = next(r for r in np.roots([1.0, a1, a2]) if r.imag > 0)
    return np.log(z) * simulated.RATE, 2.0 * (b0 * z + b1) / (z - np.conj(z))


def windows_and_gate():
    decay = 60.0
    result, pole, residue = windowed_receptance(ReceptanceSettings(exponential_window=decay))
    estimated_pole, amplitude = fit_mode(result, decay)
    s = correct_poles(estimated_pole, decay)
    zeta, truth = -s.real / abs(s), -pole.real / abs(pole)
    yield Bar("exponential window: error of damping", 100 * abs(zeta / truth - 1), 0.1, "%")
    yield Bar("exponential window: error of amplitude", 100 * abs(amplitude / residue - 1), 0.1, "%")
    raw = -estimated_pole.real / abs(estimated_pole)
    yield Bar("   the same damping left uncorrected", 100 * abs(raw / truth - 1), unit="%", sense="")
    yield Bar("lowest line (0 Hz masked)", result.frequency[0], 5.0, "Hz", ">=", note="one line spacing")
    rng = np.random.default_rng(4)
    impacts = find_impacts(simulated.test_of(rng, None, tips=(1e-3, 2e-3), noise=(3e-3, 1e-2)), "hammer", "rail")
    r = receptance_of(impacts)
    h1, hv, h2 = np.abs(r.h1), np.abs(r.hv), np.abs(r.h2)
    inside = np.mean((h1 <= hv * (1 + 1e-9)) & (hv <= h2 * (1 + 1e-9)))
    yield Bar("lines with |H1| <= |Hv| <= |H2|", float(inside), 1.0, sense=">=", n=f"n={r.n} impacts")
    yield from coverage()


def coverage(n=10, draws=40_000):
    """Confidence limits of the coherence on random Gaussian records."""
    rng, worst, lower = np.random.default_rng(5), [], []
    for true in (0.5, 0.8, 0.95):
        x, e = (rng.standard_normal((2, draws, n, 2)) @ [1.0, 1j]).reshape(2, draws, n)
        y = np.sqrt(true) * x + np.sqrt(1 - true) * e
        power = np.mean(np.abs(x) ** 2, axis=1) * np.mean(np.abs(y) ** 2, axis=1)
        z = np.abs(np.mean(x.conj() * y, axis=1)) ** 2 / power
        low, high = coherence_limits(z, n)
        worst.append(abs(np.mean((low <= true) & (true <= high)) - 0.95))
        lower.append(np.mean(lower_coherence_limit(z, n) >= 0.8))
        if true == 0.8:
            yield Bar(
                "   true coherence 0.8 passes the gate on the lower limit", float(lower[-1]), 0.055, n=f"n={draws}"
            )
            yield Bar("   and the paper's plain > 0.8", float(np.mean(z > 0.8)), sense="", n=f"n={draws}")
    yield Bar("coverage of the 95 % limits, worst deviation", float(max(worst)), 0.005, n=f"n={3 * draws}")


def best_subset():
    """Errors of the modes of tests with impacts beside the axis: best subset over all accepted impacts."""
    seeds = range(100, 124)
    found = off_axis.rms_errors(seeds)
    for (band, name, n), error in found.items():
        if n:
            note = f"{error:.3g} against {found[band, name, 0]:.3g}"
            ratio = error / found[band, name, 0]
            yield Bar(f"best subset: error of the {band} {name}", ratio, 1.0, "times", n=f"n={len(seeds)}", note=note)


def speed():
    rng = np.random.default_rng(6)
    sections = [simulated.test_of(rng, None, n_impact=30, tips=(1e-3, 2e-3)) for _ in range(8)]
    with stopwatch() as finding:
        tests = [find_impacts(recordings, "hammer", "rail") for recordings in sections]
    yield Bar("part of the hammer test: 8 x 30 impacts of 4,000 samples found and judged", finding.cpu, 1.0, "CPU s")
    with stopwatch() as averaging:
        lines = sum(receptance_of(impacts).frequency.size for impacts in tests)
    yield Bar("part of the hammer test: receptance with all limits", averaging.cpu, 0.3, "CPU s", n=f"{lines} lines")
