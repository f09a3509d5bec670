"""Where on a recording its train lies: lag and speed at which the base simulation looks most like it."""

import numpy as np

from turnout.mismatch.track.bands import band_limited, limited, read_at
from turnout.mismatch.track.roll import LEAD

# The rail's deflection under the axles: with a dip of 1.5 mm the right train is 0.8 alike, with a flat of 80 mm 0.6 to
# 0.7, a wrong one at most 0.6
ALIGNED, ALIKE = 30.0, 0.65  # [Hz], -
STEP = 1.0 / 800.0  # between samples of what is compared [s]


def slow(recording, sensors):
    """(n_sensor, n) what the sensors recorded below ``ALIGNED``, every ``STEP``."""
    grid = np.arange(0.0, recording.duration, STEP)
    return read_at(limited(recording, sensors, ALIGNED), recording.rate, grid)


def align(passage, data, simulated, rate):
    """(reference time [s], speed [m/s], correlation) at which the base simulation lies best on a recording that is
    ``slow``.

    Searches all lags and speeds within 1.5 % of the noted one; the simulation is stretched in time about the first
    wheel's arrival. The band ends at ``ALIGNED``, below which roughness and dips have no say. Where the sensors
    together look like no such train, the one that disagrees most is not asked, if three or more are there: what is
    wrong with it is for the fit to find. Where that does not help either, no sample counts for more than the largest of
    the simulation: the blows of a long flat are many times as strong, and no axle's.
    """
    low = band_limited(simulated, rate, high=ALIGNED)
    best = _best(data, low, rate)
    if best[0] < ALIKE:
        top = np.max(np.abs(low), axis=1, keepdims=True)
        best = max(best, _best(np.clip(data, -top, top), low, rate))
    likeness, lag, stretch = best
    return lag * STEP + LEAD, passage.speed * (1.0 + stretch), likeness


def _best(data, low, rate):
    """(likeness, lag in steps, stretch) at which the simulation ``low`` lies best on ``data``."""
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
    """(likeness, lag in steps, stretch) where the score is best."""
    k = int(np.argmax(score))
    return float(score[k]), k, float(stretch)
