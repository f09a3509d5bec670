"""Fit rows of vehicles to the train's profile: this finds axles that no cut between peaks finds, with a template."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy import ndimage

from turnout.passage.axle_patterns import Pattern
from turnout.passage.axles import GRID_STEP, MAX_LEFT_HEIGHT, AxleFinding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.axle_patterns import Vehicle

POSITION_SLACK = 0.35  # m, largest deviation of an axle from its position behind the previous one
MIN_HEIGHT = 0.3  # of a typical peak: least height of an axle, and largest height of a peak that is no axle
SCALES = 1.0 + 0.012 * np.arange(-4, 5)  # factors on the lengths, for an error of the speed
PEAK_REACH = 0.6  # m, within which a peak belongs to an axle
N_STARTS = 8  # first peaks that are tried as the first axle


def decode_profile(
    profile: np.ndarray, start: float, pattern: Pattern, audible_length: float, feature: str
) -> AxleFinding | None:
    """Axle count of the row of vehicles of ``pattern`` that collects most of ``profile`` (n,); None if there is none.

    The search starts from each of the first peaks, at each of a few scales, and goes from axle to axle. The next axle
    is the highest point within 0.35 m of its position in the vehicle, measured from the previous axle. So an error of
    the speed does not accumulate. Where the pattern allows a choice, the vehicle that collects more is taken, less the
    peaks that it leaves over within its length. The row ends where the peaks beyond it cost least. A row that leaves a
    peak as high as a wheel is a part of another train. ``audible_length`` [m] is the length of the audible part.

    Parameters
    ----------
    profile : (n,) array of float
        Feature along the train on a grid of ``GRID_STEP``, about 1 at a wheel. [-]
    start : float
        Offset of its first point. [m]
    pattern : Pattern
        Axle pattern of a type of train.
    audible_length : float
        Length of the audible part. [m]
    feature : str
        Name of the feature.

    Returns
    -------
    AxleFinding or None
        Offsets of the axles, with a contrast of 1 and what an axle collects on average.
    """
    low, high = pattern.lengths()
    if not low - 8.0 < audible_length * 1.06 or not high + 12.0 > audible_length * 0.9:
        return None
    # a wheel is a peak of height 1; noise beside it must not be collected
    highest = ndimage.maximum_filter1d(profile, 2 * int(POSITION_SLACK / GRID_STEP) + 1)
    peaks, _ = scipy.signal.find_peaks(profile, height=MIN_HEIGHT, distance=int(0.6 / GRID_STEP))
    if peaks.size < 4:
        return None
    first = np.repeat(peaks[:N_STARTS] * GRID_STEP, SCALES.size)
    search = _RowSearch(profile, highest, peaks, first, np.tile(SCALES, min(N_STARTS, peaks.size)))
    for group in pattern.groups:
        for count in range(group.maximum):
            if not search.is_continued.any():
                break  # every row has ended: no vehicle can be added
            search.add_vehicle(group.vehicles, is_required=count < group.minimum)
    value, positions = search.finish()
    if positions is None or len(positions) < 4:
        return None
    height = np.interp(positions, np.arange(profile.size) * GRID_STEP, profile)
    if np.mean(height >= MIN_HEIGHT) < 0.9:
        return None
    is_left = np.abs(np.subtract.outer(search.peak_position, positions)).min(axis=1) >= PEAK_REACH
    if np.any(search.peak_height[is_left] > MAX_LEFT_HEIGHT * np.median(height)):
        return None
    return AxleFinding(start + positions, height, float(1.0 + value), feature)


class _RowSearch:
    """Search over hypotheses (start, scale), to all of which vehicles are added at once."""

    def __init__(
        self, profile: np.ndarray, highest: np.ndarray, peaks: np.ndarray, first: np.ndarray, scale: np.ndarray
    ) -> None:
        self.profile, self.highest, self.scale = profile, highest, scale
        self.peak_position, self.peak_height = peaks * GRID_STEP, profile[peaks]
        self.first, self.rear = first, np.zeros(first.size)
        self.is_continued, self.score = np.ones(first.size, bool), np.zeros(first.size)
        self.positions = np.zeros((first.size, 0))
        self.best_end: tuple[float, np.ndarray | None] = (-np.inf, None)

    def add_vehicle(self, vehicles: Sequence[Vehicle], is_required: bool) -> None:
        """Add one of ``vehicles`` to every hypothesis; where none is required, the row may also end before it."""
        if not is_required:
            self._consider_end()
        trials = [self._try_vehicle(v) for v in vehicles]
        gain = np.array([t[0] for t in trials])
        size = np.array([len(v.axles) for v in vehicles])
        choice = (gain * size[:, None]).argmax(axis=0)
        width = max(len(v.axles) for v in vehicles)
        added = np.full((self.first.size, width), np.nan)
        for k, (_, positions, *_) in enumerate(trials):
            is_chosen = choice == k
            added[is_chosen, : positions.shape[1]] = positions[is_chosen]
        rows = np.arange(self.first.size)
        collected = np.array([t[3] for t in trials])[choice, rows]
        is_gaining = gain[choice, rows] > (-0.35 if is_required else -0.1)
        if not is_required:
            # a hypothesis that finds no further vehicle has ended and does not change any more
            self.is_continued &= is_gaining
        self.score = np.where(self.is_continued, self.score + collected, self.score)
        self.rear = np.array([v.rear for v in vehicles])[choice]
        added[~self.is_continued] = np.nan
        self.positions = np.hstack([self.positions, added])

    def finish(self) -> tuple[float, np.ndarray | None]:
        """(value, positions) of the best end so far and now."""
        self._consider_end()
        return self.best_end

    def _try_vehicle(self, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray, Vehicle, np.ndarray]:
        """Net gain per axle (n,), positions (n, n_axle) [m], vehicle, collected height (n,), for each hypothesis."""
        if self.positions.shape[1]:
            last = np.nanmax(np.where(np.isfinite(self.positions), self.positions, -np.inf), axis=1)
            last = np.where(np.isfinite(last), last, self.first)
            position = last + self.scale * (self.rear + vehicle.axles[0])
        else:
            position = self.first.copy()
        gaps = np.diff(vehicle.axles, prepend=vehicle.axles[0])
        columns, gain = [], np.zeros(self.first.size)
        for gap in gaps:
            position = self._highest_near(position + self.scale * gap)
            columns.append(position)
            gain += self._height(position) - MIN_HEIGHT
        positions = np.array(columns).T
        between = (self.peak_position > positions[:, :1] - 1.5) & (self.peak_position < positions[:, -1:] + 1.5)
        is_collected = np.any(np.abs(self.peak_position - positions[:, :, None]) < PEAK_REACH, axis=1)
        uncollected = np.sum(
            np.clip(np.minimum(self.peak_height, 1.0) - MIN_HEIGHT, 0, None) * (between & ~is_collected), axis=1
        )
        return (gain - uncollected) / len(gaps), positions, vehicle, gain

    def _highest_near(self, position: np.ndarray) -> np.ndarray:
        """Highest position within the slack, the nearer of equals."""
        reach = int(POSITION_SLACK / GRID_STEP)
        centre = np.clip(np.round(position / GRID_STEP).astype(int), reach, self.profile.size - reach - 1)
        window = self.profile[centre[:, None] + np.arange(-reach, reach + 1)]
        distance = (np.arange(-reach, reach + 1) / reach) ** 2
        return (centre - reach + np.argmax(window - 0.15 * distance, axis=1)) * GRID_STEP

    def _height(self, position: np.ndarray) -> np.ndarray:
        index = np.clip(np.round(position / GRID_STEP).astype(int), 0, self.profile.size - 1)
        return np.minimum(self.profile[index], 1.0)

    def _consider_end(self) -> None:
        """Keep the best hypothesis if the row ended here: what it collects, less the peaks that it leaves over."""
        if not self.positions.shape[1]:
            return
        excess = np.clip(np.minimum(self.peak_height, 1.0) - MIN_HEIGHT, 0.0, None)
        is_near = np.abs(self.peak_position[None, :, None] - self.positions[:, None, :]) < PEAK_REACH
        uncollected = np.sum(excess * ~is_near.any(axis=2), axis=1)
        n = np.sum(np.isfinite(self.positions), axis=1)
        value = np.where(n > 0, (self.score - uncollected) / np.maximum(n, 1), -np.inf)
        k = int(np.argmax(value))
        if value[k] > self.best_end[0]:
            self.best_end = (float(value[k]), self.positions[k][np.isfinite(self.positions[k])].copy())
