"""Find all impacts of a hammer test, each with its measurements and the reasons to reject it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test.agreement import judge_agreement
from turnout.hammer_test.best_subset import select_best
from turnout.hammer_test.contact import band_edges, measure_contact
from turnout.hammer_test.force_tops import judge_tops
from turnout.hammer_test.free_decay import judge_decay, judge_second_contact
from turnout.hammer_test.impact_quality import is_repeated, judge_against_median, judge_repeats, overload
from turnout.hammer_test.impact_window import NO_CONTACT
from turnout.hammer_test.segmentation import cut_impacts
from turnout.records import Impact, Recording, Rejection
from turnout.signal.drop_outs import drop_outs

if TYPE_CHECKING:
    from turnout.hammer_test.impact_window import Contact, Cut

# N, largest peak force: far above any hammer, and below newtons that were read as kilonewtons.
MAX_FORCE = 1e6


def find_impacts(
    recordings: Sequence[Recording], force: str, response: str, settings: ReceptanceSettings | None = None
) -> tuple[Impact, ...]:
    """Find and judge the impacts of one hammer test.

    Parameters
    ----------
    recordings : sequence of Recording
        All recordings of the test together, each with one impact or many. The impacts are compared with each other,
        so do not pass them one by one.
    force, response : str
        Names of the hammer's and the accelerometer's channel; KeyError if a recording has no such channel.
    settings : ReceptanceSettings, optional
        Limits of the quality; the defaults without one.

    Returns
    -------
    tuple of Impact
        In the order of the recordings. An impact that is not used has ``rejections``. A recording without impact
        gives one Impact with the reason "no_impact", "dead_channel" or "not_finite".

    Raises
    ------
    KeyError
        A recording has no channel of that name.

    Examples
    --------
    A half-sine of 500 N and 2 ms has an impulse of 2/pi N s; its first and last 13 µs lie below 2 %.

    >>> from turnout.records import Channel, Recording
    >>> rng, t = np.random.default_rng(1), np.arange(2000) / 10_000.0
    >>> f = 500.0 * np.sin(np.pi * (t - 0.01) / 2e-3) * ((t > 0.01) & (t < 0.012))
    >>> a = np.exp(-80.0 * (t - 0.01)) * np.sin(900.0 * (t - 0.01)) * (t > 0.01)
    >>> channels = Channel("hammer", "force"), Channel("rail", "acceleration")
    >>> noise = rng.normal(size=(2, 2000)) * [[0.1], [1e-3]]
    >>> impact, = find_impacts([Recording(np.stack([f, a]) + noise, 10_000.0, channels)], "hammer", "rail")
    >>> print(f"{impact.peak:.0f} N for {1e3 * impact.contact:.1f} ms, {impact.impulse:.2f} N s", impact.accepted)
    500 N for 1.9 ms, 0.64 N s True
    """
    settings = settings or ReceptanceSettings()
    cuts = cut_impacts(recordings, force, response, settings)
    candidates = [c for c in cuts if not c.rejections]
    judge_repeats(candidates)
    for cut in candidates:
        _measure(cut, settings)
    _judge_scale(candidates, settings.minimum_peak_force)
    pulses = [c.force[c.contact.onset : c.contact.end + 1] for c in candidates]
    for cut, edge in zip(candidates, _band_edges(candidates, pulses)):
        cut.band_edge = edge
    candidates = [c for c in candidates if not is_repeated(c)]
    judge_against_median(candidates, settings)
    judge_tops(candidates, settings.deviation)
    for rate in sorted({c.rate for c in candidates}):
        judge_agreement([c for c in candidates if c.rate == rate], settings)
    return select_best([_impact(c) for c in cuts], settings)


def _band_edges(cuts: Sequence[Cut], pulses: list[np.ndarray]) -> np.ndarray:
    edges = np.empty(len(cuts))
    for rate in {c.rate for c in cuts}:
        rows = [k for k, c in enumerate(cuts) if c.rate == rate]
        edges[rows] = band_edges([pulses[k] for k in rows], rate)
    return edges


def _measure(cut: Cut, settings: ReceptanceSettings) -> None:
    """Measure zero lines, contacts and start of the decay of one impact, and judge it by itself."""
    contact = measure_contact(cut, settings.contact_level)
    force, response = (channel.name for channel in cut.channels)
    if contact.zero_acceleration:
        zero = _significant_zero(cut, contact)
        cut.acceleration, cut.zeros = cut.acceleration - zero, (cut.zeros[0], zero)
    if np.ptp(cut.acceleration) == 0.0:
        cut.rejections.append(Rejection("dead_channel", 0.0, None, f"{response} is constant", response))
    if (stretches := drop_outs(cut.acceleration)).size:
        n = int(np.sum(stretches[:, 1] - stretches[:, 0]))
        cut.rejections.append(Rejection("drop_out", n, 0.0, f"{response} repeats one value for {n} samples", response))
    if cut.polarity < 0:
        cut.rejections.append(Rejection("sign_reversed", contact.peak, 0.0, (
            f"{force} reads {contact.peak:.4g} N at contact: a hammer can only push; "
            "its sign is reversed, or it is another channel"), force))  # fmt: skip
    cut.contact, cut.contact_end = contact, contact.end
    _judge_start(cut, settings)
    if abs(contact.peak) > MAX_FORCE:
        cut.rejections.append(Rejection("out_of_scale", contact.peak, MAX_FORCE, (
            f"{contact.peak:.4g} N: no hammer gives such a force, its unit or scale is wrong")))  # fmt: skip
    if (rejection := overload(cut, contact)) is not None:
        cut.rejections.append(rejection)
    judge_second_contact(cut, settings)
    judge_decay(cut, settings)


def _judge_scale(cuts: Sequence[Cut], min_median_peak: float) -> None:
    """Reject a test whose median peak is too small for any hammer on a track.

    A single small impact is weak, not out of scale.
    """
    peaks = [abs(c.contact.peak) for c in cuts]
    median = float(np.median(peaks)) if cuts else np.inf
    if median >= min_median_peak:
        return
    for cut, peak in zip(cuts, peaks):
        cut.rejections.insert(0, Rejection("out_of_scale", peak, min_median_peak, (
            f"{peak:.4g} N, the test's median is {median:.4g} N: no hammer is so soft on a track, its unit or scale "
            "is wrong (kN read as N?); for a small hammer set receptance.minimum_peak_force")))  # fmt: skip


def _judge_start(cut: Cut, settings: ReceptanceSettings) -> None:
    """Reject an impact that began before its record: the response to the missing force is in the record."""
    contact, at_start = cut.contact, cut.polarity * float(cut.force[0])
    limit = max(settings.contact_level * abs(contact.peak), 5.0 * contact.noise_force)
    if contact.onset == 0 and at_start > limit:
        detail = f"the record starts with {at_start:.4g} N: the impact began before it"
        cut.rejections.append(Rejection("late", at_start, limit, detail))


def _significant_zero(cut: Cut, contact: Contact) -> float:
    """Mean before the impact if it is statistically significant, else 0: a correct zero line must not be changed."""
    n_quiet = max(1, min(cut.first, contact.onset))
    significant = abs(contact.zero_acceleration) > 4.0 * contact.noise_acceleration / np.sqrt(n_quiet)
    return contact.zero_acceleration if significant else 0.0


def _impact(cut: Cut) -> Impact:
    c = cut.contact
    return Impact(
        force=cut.force, acceleration=cut.acceleration, rate=cut.rate, source=cut.recording.source, record=cut.record,
        onset=c.onset, contact_end=cut.contact_end, decay_start=cut.decay_start, peak=c.peak,
        contact=float("nan") if c is NO_CONTACT else (c.end - c.onset + 1) / cut.rate, impulse=c.impulse,
        noise_force=c.noise_force, noise_acceleration=c.noise_acceleration, band_edge=float(cut.band_edge),
        rejections=tuple(cut.rejections), notes=tuple(cut.notes),
    )  # fmt: skip
