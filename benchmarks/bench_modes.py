"""Modes of sections with known truth: mistaken modes on complex sections, coverage and width of intervals.

``TURNOUT_BENCH_SHARE`` (default 1) scales the number of tests for a quick look, ``TURNOUT_BENCH_CAMPAIGNS`` sets the
campaigns of each section for the coverage alone.
"""

import os

import numpy as np
from scipy.stats import binom

from benchmarks.bar import Bar, stopwatch
from benchmarks.modes_demonstration import demonstration_coverage
from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify
from turnout.modal.poles import continuous_pole
from turnout.modal.summary import cramer_rao_bound

SHARE = float(os.environ.get("TURNOUT_BENCH_SHARE", "1"))
SEED = int(os.environ.get("TURNOUT_BENCH_SEED", "138"))  # another one gives other sections and campaigns
SETTINGS = IdentifySettings(null_draws=10)
RATE, N = 20e3, 600
BANDS = ("ballast", "railpad")
N_COMPLEX, N_SECTION = round(400 * SHARE), 8
N_CAMPAIGN = int(os.environ.get("TURNOUT_BENCH_CAMPAIGNS", round(60 * SHARE)))  # of each section
# A mode is mistaken if it is off by both: chance alone gives twice the half interval once in ten thousand.
MATERIAL = np.array([0.03, 0.25])  # relative errors of frequency and damping
INTERVALS = 2.0


def decays_of(modes, n_impact, rng, spread, noise, colour):
    """Decays (n_impact, N) of modes (frequency, damping, complex amplitude), all frequencies scattering together.

    ``noise`` is its standard deviation over the largest sample, its density falls with frequency to the power
    ``colour``.
    """
    frequency, damping, amplitude = (np.array(column) for column in zip(*modes, strict=True))
    moved = frequency * (1.0 + spread * rng.standard_normal((n_impact, 1)))
    pole = continuous_pole(moved, np.broadcast_to(damping, moved.shape))
    # another pulse each time: the amplitudes of high modes vary more
    pulse = 1.0 - 0.08 * rng.standard_normal((n_impact, 1)) * (frequency / 1000.0) ** 2
    size = amplitude * pulse * (1.0 + 0.1 * rng.standard_normal((n_impact, 1)))
    clean = np.einsum("im,imt->it", size, np.exp(pole[..., None] * np.arange(N) / RATE)).real
    length = 4096
    density = np.maximum(np.fft.rfftfreq(length, 1.0 / RATE), RATE / length) ** (-0.5 * colour)
    wander = np.fft.irfft(np.fft.rfft(rng.standard_normal((n_impact, length))) * density, length)[:, :N]
    wander /= np.sqrt(np.mean(wander**2))
    return clean + noise * np.abs(clean).max(axis=1, keepdims=True) * wander


def complex_section(number):
    """Modes and decays of one section: a third mode within 15 %, or twin poles within 3 %; half with 1/f noise."""
    rng = np.random.default_rng([SEED, number])
    named = [
        (rng.uniform(80.0, 200.0), rng.uniform(0.1, 0.3), np.exp(1j * rng.uniform(-0.5, 0.5))),
        (rng.uniform(400.0, 700.0), rng.uniform(0.04, 0.11), 3.0 * np.exp(1j * rng.uniform(-1.0, 0.0))),
    ]
    frequency, damping, amplitude = named[rng.integers(2)]
    distance = rng.uniform(0.01, 0.03) if number % 2 else rng.uniform(0.03, 0.15)
    third = frequency * np.exp(rng.choice([-1.0, 1.0]) * distance)
    share = rng.uniform(0.2, 0.6) * np.exp(1j * rng.uniform(-np.pi, np.pi))
    modes = [*named, (third, damping * rng.uniform(0.5, 1.5), amplitude * share), (1100.0, 0.04, 0.5)]
    noise, colour = (0.1, 1.0) if number % 4 < 2 else (0.01, 0.0)
    return modes, decays_of(modes, 30, rng, 0.006, noise, colour)


def is_mistaken(mode, truth):
    """Whether a mode is none of the true modes (frequency, damping): materially off, and beyond its own interval."""
    half = 0.5 * np.array(
        [(mode.frequency_high - mode.frequency_low) / mode.frequency, (mode.damping_high - mode.damping_low)]
    )
    for frequency, damping in truth:
        error = np.abs([np.log(mode.frequency / frequency), mode.damping / damping - 1.0])
        if not np.any((error > MATERIAL) & (error > INTERVALS * half / [1.0, damping])):
            return False
    return True


def is_beyond_resolution(mode, modes, decays, noise):
    """Whether two standard errors of the true mode next to ``mode`` are material even for the best estimator.

    The Cramér-Rao bound of all true modes in the principal decay, which has the amplitudes of all impacts and the white
    noise of one: no unbiased estimator tells the poles of such a section apart, even if it knows their number.
    """
    truth = np.array([[np.log(frequency), damping] for frequency, damping, _ in modes])
    strength, shape = np.linalg.svd(decays, full_matrices=False)[1:]
    sigma2 = (noise * np.mean(np.abs(decays).max(axis=1))) ** 2
    bound = cramer_rao_bound(truth[None], strength[:1, None] * shape[:1], RATE, sigma2)
    nearest = int(np.argmin(np.abs(truth - [np.log(mode.frequency), mode.damping]) @ [1.0, 0.5]))
    return bool(np.any(2.0 * bound[nearest] / [1.0, truth[nearest, 1]] > MATERIAL))


def mistaken_modes():
    """Share of named modes that are no true mode, over all complex sections."""
    n_mode, mistaken, failed = 0, {"third mode": 0, "twin poles": 0}, 0
    count, beyond = {"white, 40 dB": 0, "1/f, 20 dB": 0}, 0
    with stopwatch() as watch:
        for number in range(N_COMPLEX):
            modes, decays = complex_section(number)
            model = identify(list(decays), RATE, SETTINGS)
            reasons = [*model.rejections, *(r for _, r in model.diagnostics["rejected_impacts"])]
            failed += any("identification fail" in (r.detail or "") for r in reasons)
            for mode in model.modes:
                n_mode += 1
                if is_mistaken(mode, [m[:2] for m in modes]):
                    mistaken["twin poles" if number % 2 else "third mode"] += 1
                    is_white = number % 4 >= 2
                    count["white, 40 dB" if is_white else "1/f, 20 dB"] += 1
                    beyond += is_white and is_beyond_resolution(mode, modes, decays, 0.01)
    total = sum(mistaken.values())
    note = ", ".join(f"{name} {value}" for name, value in (mistaken | count).items())
    yield Bar("mistaken modes on complex sections", 100.0 * total / n_mode, 1.0, "%", n=f"n={n_mode}", note=note)
    about = f"n={count['white, 40 dB']}"
    yield Bar("mistaken in white noise that no unbiased estimator resolves", beyond, None, "", "", n=about)
    yield Bar("modes named, of two a section", n_mode / (2 * N_COMPLEX), None, "", "", n=f"n={2 * N_COMPLEX}")
    yield Bar("sections whose identification failed", failed, 0, n=f"n={N_COMPLEX}")
    yield Bar("identification of a complex section", watch.cpu / N_COMPLEX, None, "CPU s", "")


def track_like_section(number):
    """Six modes of one section: two named ones, and four such as a fit to simulated track has beside them."""
    rng = np.random.default_rng([SEED + 1, number])

    def mode(low, high, least, most, size):
        return rng.uniform(low, high), rng.uniform(least, most), size * np.exp(1j * rng.uniform(-0.7, 0.7))

    return [
        mode(95.0, 175.0, 0.1, 0.25, 1.0),
        mode(450.0, 700.0, 0.04, 0.11, 3.0),
        mode(200.0, 290.0, 0.15, 0.3, 0.3),
        mode(720.0, 790.0, 0.04, 0.08, 0.3),
        mode(950.0, 1100.0, 0.1, 0.2, 1.0),
        mode(1250.0, 1450.0, 0.03, 0.06, 0.5),
    ]


def interval_coverage():
    """Coverage and width of nominal 95 % intervals: 8 sections, 2 bands, 2 quantities."""
    coverage, width, lost = [], [], 0
    with stopwatch() as watch:
        for section in range(N_SECTION):
            modes = track_like_section(section)
            truth = np.array([[frequency, damping] for frequency, damping, _ in modes[:2]])
            values = {band: [] for band in BANDS}
            for campaign in range(N_CAMPAIGN):
                rng = np.random.default_rng([SEED + 2, section, campaign])
                model = identify(list(decays_of(modes, 30, rng, 0.006, 0.01, 0.0)), RATE, SETTINGS)
                for band in BANDS:
                    m = model.mode(band)
                    lost += m is None
                    if m is not None:
                        low, high = (m.frequency_low, m.damping_low), (m.frequency_high, m.damping_high)
                        values[band].append(((m.frequency, m.damping), low, high))
            for index, band in enumerate(BANDS):
                value, low, high = np.array(values[band]).transpose(1, 0, 2)
                coverage += list(np.mean((low <= truth[index]) & (truth[index] <= high), axis=0))
                exact = np.quantile(np.abs(value - truth[index]), 0.95, axis=0)
                width += list(np.median(0.5 * (high - low), axis=0) / exact)
    coverage, n = np.array(coverage), f"n={len(coverage)} groups of {N_CAMPAIGN}"
    counts = np.arange(N_CAMPAIGN + 1)
    chance = binom.pmf(counts, N_CAMPAIGN, 0.95)[(counts >= 0.93 * N_CAMPAIGN) & (counts <= 0.97 * N_CAMPAIGN)].sum()
    inside = int(np.sum((coverage >= 0.93) & (coverage <= 0.97)))
    note = f"intervals of exactly 95 % would give {chance * len(coverage):.0f}; mean coverage {coverage.mean():.3f}"
    yield Bar("groups with a coverage of 93 to 97 %", inside, 30, sense=">=", n=n, note=note)
    yield Bar("lowest coverage", coverage.min(), 0.90, sense=">=", n=n)
    yield Bar("median width over the exact one", float(np.median(width)), 1.3, n=n, note=f"largest {max(width):.1f}")
    yield Bar("campaigns without a named mode", lost, None, "", "", n=f"n={2 * N_SECTION * N_CAMPAIGN}")
    yield Bar("identification of 30 impacts", watch.cpu / (N_SECTION * N_CAMPAIGN), None, "CPU s", "")


def bars():
    """All bars of modes with known truth."""
    yield from mistaken_modes()
    yield from interval_coverage()
    yield from demonstration_coverage()
