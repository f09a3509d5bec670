"""Find start and end of the free decay after an impact, and check whether enough of it was recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.hammer_test.contact import further_contacts
from turnout.records import Rejection

if TYPE_CHECKING:
    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.hammer_test.impact_window import Cut

# s, end of a record over which its remaining amplitude is taken: a period of the slowest mode.
TAIL_TIME = 0.01
# Several further contacts, one with this share of the main peak and this late [ms], may be quick impacts of a machine.
MIN_REPEATED_SHARE, MIN_REPEATED_DELAY = 0.7, 60.0


def judge_second_contact(cut: Cut, settings: ReceptanceSettings) -> None:
    """Note or reject a double impact; keep the free decay on one side of the second contact, if there is enough.

    A double impact is a valid input of a linear system, but no free decay follows it at once. Under ``move``

    - a second contact after the vibration has decayed has no effect: the record is cut before it;
    - otherwise the decay starts after the last contact, if its amplitude there is at least
      ``double_hit_remaining`` of that after the main contact;
    - in a damped track too little remains, and the impact is rejected.

    Parameters
    ----------
    cut : Cut
        One impact; what is found is entered in it.
    settings : ReceptanceSettings
        How to use an impact with a double impact.
    """
    further, level = further_contacts(cut, cut.contact, settings)
    if not further:
        return
    largest = max(further, key=lambda c: c.share)
    delay = 1e3 * (largest.top - cut.contact.top) / cut.rate
    text = (
        f"further contacts: {len(further)}, the largest {largest.share:.3f} of the first and {delay:+z.1f} ms from it"
    )
    if len(further) > 1 and largest.share > MIN_REPEATED_SHARE and abs(delay) > MIN_REPEATED_DELAY:
        text += "; where each is an impact of its own, set receptance.separation below the time between them"
    last = max(cut.contact.end, *(c.end for c in further))
    remaining = _decay_ratio(cut, last + 1 + round(settings.decay_gap * cut.rate), settings)
    end = min(c.onset for c in further) - round(settings.decay_gap * cut.rate)
    if settings.double_hit == "move" and _has_died_away(cut, end, settings):
        cut.force, cut.acceleration = cut.force[:end], cut.acceleration[:end]
        cut.notes.append(Rejection("double_hit", largest.share, level, f"{text}; the record is cut before it"))
        return
    cut.contact_end = last
    text = f"{text}, {remaining:.2f} of the decay is left"
    if settings.double_hit == "move" and remaining >= settings.double_hit_remaining:
        cut.notes.append(Rejection("double_hit", largest.share, level, f"{text}; it starts after the last contact"))
    else:
        cut.rejections.append(Rejection("double_hit", largest.share, level, text))


def judge_decay(cut: Cut, settings: ReceptanceSettings) -> None:
    """Set the start of the decay; reject one that is too short or has not decayed at its end.

    An exponential window counts as decay: it prevents the leakage that the check is for.

    Parameters
    ----------
    cut : Cut
        One impact; what is found is entered in it.
    settings : ReceptanceSettings
        Least length, and largest amplitude at the end.
    """
    cut.decay_start = cut.contact_end + 1 + round(settings.decay_gap * cut.rate)
    duration = max(0.0, (cut.force.size - cut.decay_start) / cut.rate)
    if duration < settings.minimum_decay:
        detail = f"{1e3 * duration:.1f} ms of decay are left, {1e3 * settings.minimum_decay:.1f} ms are needed"
        cut.rejections.append(Rejection("late", duration, settings.minimum_decay, detail))
        return
    share, limit = _remaining_amplitude(cut, cut.force.size, settings)
    if share > limit:
        detail = f"the record ends while the vibration still has {share:.3f} of its peak"
        cut.rejections.append(Rejection("cut_off", share, limit, detail))


def _remaining_amplitude(cut: Cut, end: int, settings: ReceptanceSettings) -> tuple[float, float]:
    """Amplitude just before sample ``end`` over the peak, and its limit."""
    tail = cut.acceleration[max(0, end - max(round(TAIL_TIME * cut.rate), end // 20)) : end]
    window = np.exp(-settings.exponential_window * (end - cut.contact.onset) / cut.rate)
    top = np.max(np.abs(cut.acceleration))
    noise = 3.0 * np.sqrt(2.0) * cut.contact.noise_acceleration
    if top == 0.0:
        return 0.0, settings.cut_off
    return float(window * np.sqrt(2.0) * np.std(tail) / top), float(max(settings.cut_off, window * noise / top))


def _has_died_away(cut: Cut, end: int, settings: ReceptanceSettings) -> bool:
    """Whether the vibration has decayed by sample ``end``, at least two shortest decays behind the main contact."""
    if end < cut.contact.end + 1 + 2 * round(settings.minimum_decay * cut.rate):
        return False
    share, limit = _remaining_amplitude(cut, end, settings)
    return share <= limit


def _decay_ratio(cut: Cut, start: int, settings: ReceptanceSettings) -> float:
    """Amplitude of the decay from ``start`` on over that after the main contact; 0 if too short."""
    n = round(settings.minimum_decay * cut.rate)
    decay_start = cut.contact.end + 1 + round(settings.decay_gap * cut.rate)
    if cut.force.size - start < n:
        return 0.0
    full = np.max(np.abs(cut.acceleration[decay_start : decay_start + n]), initial=0.0)
    return float(np.max(np.abs(cut.acceleration[start : start + n])) / full) if full > 0.0 else 0.0
