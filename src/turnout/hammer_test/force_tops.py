"""Find force pulses with a flat top: analog clipping or soft saturation of the hammer's channel."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.constants import MAD_TO_SD
from turnout.hammer_test.contact import crossing
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.hammer_test.impact_window import Contact, Cut


# A concave pulse is at most as flat as a parabola, sqrt(0.05 / 0.5) = 0.316 of its half width; half-sine 0.303.
MAX_NATURAL_TOP = 0.335
# Top share that is flat with certainty, whatever the test's other impacts look like.
MIN_CERTAIN_TOP = 0.42
# Samples above half the peak: least number for a top share, and for a comparison with natural pulses.
MIN_TOP_SAMPLES, MIN_NATURAL_SAMPLES = 3.0, 8.0
# An impact's top share may exceed the median of its test by this much, more for few samples and for noise of some
# percent; saturation by tanh(1) gives 0.05 to 0.06.
MIN_TOP_EXCESS = 0.03
# Least number of impacts for a comparison within a test.
MIN_IMPACTS = 5
# Largest force noise over the peak for which a top share is used.
MAX_TOP_NOISE = 0.02


def top_share(force: np.ndarray, contact: Contact, polarity: int = 1) -> float | None:
    r"""Share of the time above half the peak in which a pulse is within 5 % of its peak.

    .. math:: q = w(0.95) / w(0.5)

    Half-sine 0.303, haversine 0.287, Hertzian :math:`\sin^{3/2}` 0.293, parabola 0.316. No pulse with its largest
    curvature at the top exceeds the parabola, at any width, height or skew. A half-sine clipped at 90 % of its peak
    has 0.49, behind a saturation tanh(1) 0.36. None for pulses of fewer than ``MIN_TOP_SAMPLES`` at half height.

    Parameters
    ----------
    force : (n,) array of float
        Force. [N]
    contact : Contact
        Contact of the hammer in it.
    polarity : int
        Sign of the impact.

    Returns
    -------
    float or None
        q. [-]

    Examples
    --------
    >>> from turnout.hammer_test.impact_window import Contact
    >>> x = np.sin(np.pi * np.arange(61) / 60)
    >>> about = Contact(1, 59, 30, 1.0, 40.0, 0.0, 0.0, 0.0, 0.0)
    >>> print(f"{top_share(x, about):.2f} {top_share(np.minimum(x, 0.9), about):.2f}")
    0.30 0.49
    """
    if contact.half_width < MIN_TOP_SAMPLES:
        return None
    first = max(0, contact.onset - 2)
    pulse = polarity * force[first : contact.end + 3]
    fine = _refine(pulse)
    top = int(np.argmax(fine))
    width = [
        crossing(fine, top, share * fine[top], 1) - crossing(fine, top, share * fine[top], -1) for share in (0.95, 0.5)
    ]
    return width[0] / width[1]


MAX_SPLINE_SAMPLES = 128  # longest pulse whose weights are kept: a longer one has a spline of its own


def _refine(pulse: np.ndarray) -> np.ndarray:
    """The cubic spline of a pulse at eighths of its sampling interval."""
    if pulse.size > MAX_SPLINE_SAMPLES:
        return scipy.interpolate.CubicSpline(np.arange(pulse.size), pulse)(np.arange(8 * (pulse.size - 1) + 1) / 8.0)
    return _spline_weights(pulse.size) @ pulse


@lru_cache(maxsize=MAX_SPLINE_SAMPLES)
def _spline_weights(n: int) -> np.ndarray:
    """(8 (n - 1) + 1, n) weights of the samples of a pulse in its spline, which is linear in them."""
    return scipy.interpolate.CubicSpline(np.arange(n), np.eye(n))(np.arange(8 * (n - 1) + 1) / 8.0)


def natural_top(contact: Contact) -> float:
    """Largest natural ``top_share``: noise shifts the 5 % line, with dw/w = d(level) / (2 * 0.05), at three sigma.

    Parameters
    ----------
    contact : Contact
        Contact of the hammer.

    Returns
    -------
    float
        [-]
    """
    return MAX_NATURAL_TOP * float(np.sqrt(1.0 + 60.0 * contact.noise_force / abs(contact.peak)))


def judge_tops(cuts: Sequence[Cut], deviation: float) -> None:
    """Reject the impacts with a top flatter than a natural pulse or than the others of the test.

    A top flatter than a parabola is rejected unless the test's other impacts have the same: then it is the shape of
    this tip. In a test of ``MIN_IMPACTS`` or more, one hammer with one tip makes one shape, and an outlier is rejected
    too. A soft saturation may leave a pointed pulse no flatter than a natural half-sine.

    Parameters
    ----------
    cuts : sequence of Cut
        The impacts of a test; the result is entered in them.
    deviation : float
        Robust standard deviations beyond which a top is an outlier. [-]
    """
    measured = [(c, share) for c in cuts if (share := _share_if_quiet(c)) is not None]
    shares = np.array([share for _, share in measured])
    is_comparable = len(measured) >= MIN_IMPACTS
    median_share = float(np.median(shares)) if is_comparable else 0.0
    spread = deviation * MAD_TO_SD * float(np.median(np.abs(shares - median_share))) if is_comparable else np.inf
    for cut, share in measured:
        c = cut.contact
        natural = natural_top(c) if c.half_width >= MIN_NATURAL_SAMPLES else np.inf
        natural = min(max(natural, median_share + MIN_TOP_EXCESS / 2.0), max(natural, MIN_CERTAIN_TOP))
        usual = median_share + max(
            spread, MIN_TOP_EXCESS * (1.0 + 4.0 / c.half_width + 100.0 * c.noise_force / abs(c.peak))
        )
        limit = min(natural, usual)
        if share > limit:
            comparison = f"the others' {median_share:.2f} allow" if usual < natural else "is natural"
            detail = f"the top of the force is flat: {share:.2f} of its half width, at most {limit:.2f} {comparison}"
            cut.rejections.append(Rejection("overload", float(share), float(limit), detail, cut.channels[0].name))


def _share_if_quiet(cut: Cut) -> float | None:
    if cut.rejections or cut.contact.noise_force > MAX_TOP_NOISE * abs(cut.contact.peak):
        return None
    return top_share(cut.force, cut.contact, cut.polarity)
