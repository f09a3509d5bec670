"""One window of a recording around one impact, with the contact of the hammer in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from turnout.records import Recording, Rejection

if TYPE_CHECKING:
    import numpy as np

    from turnout.records import Channel


@dataclass(frozen=True)
class Contact:
    """The main contact of an impact, in samples of its window and SI units.

    ``onset`` and ``end`` are the first and last sample above the contact level around the peak, ``top`` the
    peak's sample, ``half_width`` the number of samples above half the peak (interpolated).
    """

    onset: int
    end: int
    top: int
    peak: float
    half_width: float
    impulse: float
    noise_force: float
    noise_acceleration: float
    zero_acceleration: float


NO_CONTACT = Contact(0, 0, 0, *[float("nan")] * 6)  # of an impact that was not measured


@dataclass
class Cut:
    """One window of a recording around one impact, from which an ``Impact`` is made.

    ``force`` [N] has its zero line subtracted; ``polarity`` (+1, -1) is the sign of the impact. ``first`` and ``last``
    are the first and last sample above the trigger, counted from the start of the window. ``zeros`` were subtracted
    from force and acceleration: add them to get the recorded values. ``contact``, ``contact_end``, ``decay_start`` and
    ``band_edge`` [Hz] are set when the impact is measured; a rejected cut may stay without them.
    """

    force: np.ndarray
    acceleration: np.ndarray
    rate: float
    first: int
    last: int
    polarity: int
    force_noise: float
    recording: Recording
    channels: tuple[Channel, Channel]
    zeros: tuple[float, float] = (0.0, 0.0)
    record: int = 0
    rejections: list[Rejection] = field(default_factory=list)
    notes: list[Rejection] = field(default_factory=list)
    contact: Contact = NO_CONTACT
    contact_end: int = 0
    decay_start: int = 0
    band_edge: float = float("nan")
