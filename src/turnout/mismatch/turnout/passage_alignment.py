"""Align passages with their simulation: time and speed of the train, and uncertain numbers of the running surface.

The surface needs a search, since linear steps do not converge from afar. A nose that lies 0.3 m further is reached 7 ms
later at 44 m/s: three quarters of a period at 112 Hz, but a fifth at 30 Hz. So the numbers are changed one by one, to
where a few passages correlate best with the simulation below 30 Hz.
"""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout.passage_band import band_limited, limited, read_at
from turnout.mismatch.turnout.passage_model import LEAD
from turnout.mismatch.turnout.running_surface import PLACES

# Hz, end of the band of the rail's deflection under the axles; least correlation of a passage with its train.
# The right train correlates by 0.8 with a dip of 1.5 mm, by 0.6 to 0.7 with a flat of 80 mm, a wrong one at most 0.6.
ALIGNED, ALIKE = 30.0, 0.65  # [Hz], -
STEP = 1.0 / 800.0  # s, sampling step of signals that are correlated


def slow(recording, sensors):
    """(n_sensor, n) signals of the sensors below ``ALIGNMENT_BAND_END``, every ``SAMPLE_STEP``."""
    grid = np.arange(0.0, recording.duration, STEP)
    return read_at(limited(recording, sensors, ALIGNED), recording.rate, grid)


def align(passage, data, simulated, rate):
    """(reference time [s], speed [m/s], correlation) of the best alignment of a recording with its simulation.

    ``data`` are signals of ``low_pass``. All lags are searched, and speeds within 1.5 % of the recorded one; the
    simulation is stretched in time about the arrival of the first wheel. Roughness and dips have no influence in this
    band.

    If no alignment reaches ``MIN_CORRELATION`` with all sensors, the one that correlates least is left out, where three
    or more are there: its fault is left to the fit. Failing that, samples are clipped at the largest value of the
    simulation. The impacts of a long flat are many times larger than any axle's response.
    """
    low = band_limited(simulated, rate, high=ALIGNED)
    best = _best(data, low, rate)
    if best[0] < ALIKE:
        top = np.max(np.abs(low), axis=1, keepdims=True)
        best = max(best, _best(np.clip(data, -top, top), low, rate))
    likeness, lag, stretch = best
    return lag * STEP + LEAD, passage.speed * (1.0 + stretch), likeness


def _best(data, low, rate):
    """(correlation, lag in steps, stretch) of the best alignment of the simulation ``low`` with ``data``."""
    n_sensor, model_time = len(data), np.arange(0.0, low.shape[-1] / rate, STEP)
    size = 1 << int(np.ceil(np.log2(data.shape[1] + model_time.size)))
    spectrum = np.fft.rfft(data, size)
    weight = 1.0 / np.maximum(np.sqrt(np.sum(data**2, axis=1)), 1e-12)
    all_, but_one = [], []
    for stretch in np.linspace(-0.015, 0.015, 13):
        model = read_at(low, rate, LEAD + (model_time - LEAD) * (1.0 + stretch))
        norm = np.maximum(np.sqrt(np.sum(model**2, axis=1)), 1e-12)
        product = np.fft.irfft(spectrum * np.fft.rfft(model, size).conj(), size)
        alike = (weight / norm)[:, None] * product
        total, worst = alike.sum(axis=0), alike.min(axis=0)
        all_.append(_likest(total / n_sensor, stretch))
        but_one.append(_likest((total - worst) / max(n_sensor - 1, 1), stretch))
    best = max(all_)
    if best[0] < ALIKE and n_sensor >= 3:
        best = max(but_one)
    likeness, k, stretch = best
    return likeness, k if k < size - model_time.size else k - size, stretch


def _likest(score, stretch):
    """(correlation, lag in steps, stretch) at the largest score."""
    k = int(np.argmax(score))
    return float(score[k]), k, float(stretch)


TRIED = 3  # passages used, those of the shortest trains; each is simulated 20 times a number, or more
APART, FAR = 0.15, 2.0  # m between trial positions; largest deviation in prior standard deviations
FACTORS = (-1.0, -0.5, 0.5, 1.0)  # trial changes of other numbers, in prior standard deviations
FINER, AROUND = 4, 3  # subdivision of the position step in the second round; steps to each side
SAMPLES = 20.0  # independent samples of a passage below 30 Hz, approximately; its weight against the prior
HIGHEST = 0.999  # correlation is limited to this: beyond, it contains no information on the surface


def seated(case, values):
    """Nuisances of the running surface as a few passages have it, dict name -> value.

    {} where no number is uncertain.
    """
    heard = [p for p in case.campaign.passages if case.campaign.sensors_of(p)]
    heard = [p for p in heard if p.name not in case.campaign.reserved] or heard
    passages = sorted(heard, key=lambda p: len(p.vehicle.wheels))[:TRIED]
    known = {n.name: n for n in case.surface.nuisances()}
    found = dict.fromkeys(known, 0.0)
    best = _score(case, {**values, **found}, passages) if known else 0.0
    for again in (False, True):
        for u in sorted(case.surface.unsure, key=lambda u: u.field not in PLACES):
            centre, prior = found[u.name], known[u.name]
            for by in _moves(u.field, prior.sd, again):
                moved = {**found, u.name: float(np.clip(centre + by, *prior.bounds))}
                score = _score(case, {**values, **moved}, passages)
                if score > best:
                    best, found = score, moved
    return found


def _moves(field, sd, again):
    if field not in PLACES:
        return [f * sd * (0.5 if again else 1.0) for f in FACTORS]
    if again:
        return [APART * k / FINER for k in range(-AROUND, AROUND + 1) if k]
    step = min(APART, sd)
    n = int(FAR * sd / step)
    return [step * k for k in range(-n, n + 1) if k]


def _score(case, values, passages):
    """Twice the logarithm of likelihood and prior of numbers of the surface.

    The simulation explains the square of the correlation of each of the ``passages``. The prior is that of the track
    file.
    """
    away = sum((values[u.name] / u.nuisance.sd) ** 2 for u in case.surface.unsure)
    return -away - SAMPLES * sum(np.log(1.0 - min(_likeness(case, values, p), HIGHEST) ** 2) for p in passages)


def _likeness(case, values, passage):
    try:
        return aligned(case, values, passage)[2]
    except SimulationError:
        return 0.0


def aligned(case, values, passage):
    """``align`` of a passage with its simulation at ``values``; SimulationError if it cannot be simulated."""
    sensors, surfaces = case.campaign.sensors_of(passage), case.surface.surfaces(passage.route, values)
    roll = case.roll(values, (), passage)
    signals = roll(passage, passage.vehicle, passage.speed, sensors, surfaces=surfaces)
    if passage.name not in case.slow:
        case.slow[passage.name] = slow(passage.recording, sensors)
    return align(passage, case.slow[passage.name], signals, case.solver.rate)
