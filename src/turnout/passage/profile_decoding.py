"""Fit rows of vehicles to the train's profile: this finds axles that no cut between peaks finds, with a template."""

from __future__ import annotations

import numpy as np
from scipy import ndimage, signal

from turnout.passage.axle_features import GRID, AxleFinding
from turnout.passage.axle_patterns import Pattern

SLACK = 0.35  # m, largest deviation of an axle from its position behind the previous one
LEAST = 0.3  # of a typical peak: least height of an axle, and largest height of a peak that is no axle
SCALES = 1.0 + 0.012 * np.arange(-4, 5)  # factors on the lengths, for an error of the speed
STARTS = 8  # first peaks that are tried as the first axle


def decoded(profile, start: float, pattern: Pattern, around: float, feature: str) -> AxleFinding | None:
    """Axle count of the row of vehicles of ``pattern`` that collects most of ``profile`` (n,); None if there is none.

    The search starts from each of the first peaks, at each of a few scales, and goes from axle to axle. The next axle
    is the highest point within 0.35 m of its position in the vehicle, measured from the previous axle. So an error of
    the speed does not accumulate. Where the pattern allows a choice, the vehicle that collects more is taken, less the
    peaks that it leaves over within its length. The row ends where the peaks beyond it cost least. ``audible_length``
    [m] is the length of the audible part.
    """
    low, high = pattern.lengths()
    if not low - 8.0 < around * 1.06 or not high + 12.0 > around * 0.9:
        return None
    # a wheel is a peak of height 1; noise beside it must not be collected
    top = ndimage.maximum_filter1d(profile, 2 * int(SLACK / GRID) + 1)
    peaks, _ = signal.find_peaks(profile, height=LEAST, distance=int(0.6 / GRID))
    if peaks.size < 4:
        return None
    first = np.repeat(peaks[:STARTS] * GRID, SCALES.size)
    walk = _Walk(profile, top, peaks, first, np.tile(SCALES, min(STARTS, peaks.size)))
    for group in pattern.groups:
        for count in range(group.maximum):
            if not walk.alive.any():
                break  # every row has ended: no vehicle can be added
            walk.couple(group.vehicles, forced=count < group.minimum)
    value, places = walk.best()
    if places is None or len(places) < 4:
        return None
    height = np.interp(places, np.arange(profile.size) * GRID, profile)
    if np.mean(height >= LEAST) < 0.9:
        return None
    return AxleFinding(start + places, height, float(1.0 + value), feature)


class _Walk:
    """Search over hypotheses (start, scale), to all of which vehicles are added at once."""

    def __init__(self, profile, top, peaks, first, scale):
        self.profile, self.top, self.scale = profile, top, scale
        self.peak_place, self.peak_height = peaks * GRID, profile[peaks]
        self.first, self.rear = first, np.zeros(first.size)
        self.alive, self.score = np.ones(first.size, bool), np.zeros(first.size)
        self.places = np.zeros((first.size, 0))
        self.ended: tuple[float, np.ndarray | None] = (-np.inf, None)

    def couple(self, vehicles, forced):
        """Add one of ``vehicles`` to every hypothesis; where none is required, the row may also end before it."""
        if not forced:
            self._consider()
        tried = [self._trial(v) for v in vehicles]
        gain = np.array([t[0] for t in tried])
        size = np.array([len(v.axles) for v in vehicles])
        best = (gain * size[:, None]).argmax(axis=0)
        width = max(len(v.axles) for v in vehicles)
        added = np.full((self.first.size, width), np.nan)
        for k, (_, places, *_) in enumerate(tried):
            mine = best == k
            added[mine, : places.shape[1]] = places[mine]
        pick = np.arange(self.first.size)
        collected = np.array([t[3] for t in tried])[best, pick]
        good = gain[best, pick] > (-0.35 if forced else -0.1)
        if not forced:
            # a hypothesis that finds no further vehicle has ended and does not change any more
            self.alive &= good
        self.score = np.where(self.alive, self.score + collected, self.score)
        self.rear = np.array([v.rear for v in vehicles])[best]
        added[~self.alive] = np.nan
        self.places = np.hstack([self.places, added])

    def best(self):
        """(value, positions) of the best end so far and now."""
        self._consider()
        return self.ended

    def _trial(self, vehicle):
        """Net gain per axle (n,), positions (n, n_axle) [m], vehicle, collected height (n,), for each hypothesis."""
        if self.places.shape[1]:
            last = np.nanmax(np.where(np.isfinite(self.places), self.places, -np.inf), axis=1)
            last = np.where(np.isfinite(last), last, self.first)
            place = last + self.scale * (self.rear + vehicle.axles[0])
        else:
            place = self.first.copy()
        gaps = np.diff(vehicle.axles, prepend=vehicle.axles[0])
        found, gain = [], np.zeros(self.first.size)
        for gap in gaps:
            place = self._nearest(place + self.scale * gap)
            found.append(place)
            gain += self._height(place) - LEAST
        found = np.array(found).T
        between = (self.peak_place > found[:, :1] - 1.5) & (self.peak_place < found[:, -1:] + 1.5)
        near = np.any(np.abs(self.peak_place - found[:, :, None]) < 0.6, axis=1)
        over = np.sum(np.clip(np.minimum(self.peak_height, 1.0) - LEAST, 0, None) * (between & ~near), axis=1)
        return (gain - over) / len(gaps), found, vehicle, gain

    def _nearest(self, place):
        """Highest position within the slack, the nearer of equals."""
        reach = int(SLACK / GRID)
        centre = np.clip(np.round(place / GRID).astype(int), reach, self.profile.size - reach - 1)
        window = self.profile[centre[:, None] + np.arange(-reach, reach + 1)]
        away = (np.arange(-reach, reach + 1) / reach) ** 2
        return (centre - reach + np.argmax(window - 0.15 * away, axis=1)) * GRID

    def _height(self, place):
        index = np.clip(np.round(place / GRID).astype(int), 0, self.profile.size - 1)
        return np.minimum(self.profile[index], 1.0)

    def _consider(self):
        """Keep the best hypothesis if the row ended here: what it collects, less the peaks that it leaves over."""
        if not self.places.shape[1]:
            return
        over = np.clip(np.minimum(self.peak_height, 1.0) - LEAST, 0.0, None)
        near = np.abs(self.peak_place[None, :, None] - self.places[:, None, :]) < 0.6
        left = np.sum(over * ~near.any(axis=2), axis=1)
        n = np.sum(np.isfinite(self.places), axis=1)
        value = np.where(n > 0, (self.score - left) / np.maximum(n, 1), -np.inf)
        k = int(np.argmax(value))
        if value[k] > self.ended[0]:
            self.ended = (float(value[k]), self.places[k][np.isfinite(self.places[k])].copy())
