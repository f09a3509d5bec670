"""Force pulses with a flattened top: what analog clipping and soft saturation leave, however noisy the converter."""

import numpy as np
from scipy.interpolate import CubicSpline

from turnout.receptance.contact import crossing
from turnout.receptance.cut import MAD_TO_SD
from turnout.records import Rejection

# A concave pulse is at most as flat as a parabola, sqrt(0.05 / 0.5) = 0.316 of its half width; half-sine 0.303.
FLATTEST_TOP = 0.335
# Flat beyond doubt, whatever the test's other blows look like.
CERTAINLY_FLAT = 0.42
# Samples above half the peak: too few to say anything, and too few to compare with all pulses there are.
FEWEST_SAMPLES, ENOUGH_SAMPLES = 3.0, 8.0
# A blow's top may be flatter than those of its test by this much, more for few samples and for noise of some percent;
# tanh(1) makes 0.05 to 0.06.
FLATTER = 0.03
FEWEST_BLOWS = 5
NOISIEST = 0.02


def top_share(force, contact, polarity=1):
    r"""Part of the time above half the peak that a pulse spends within 5 % of its peak.

    .. math:: q = w(0.95) / w(0.5)

    Half-sine 0.303, haversine 0.287, Hertzian :math:`\sin^{3/2}` 0.293, parabola 0.316: no pulse that bends most
    at its top exceeds the parabola, whatever its width, height or skew. Clipped at 90 % of its peak a half-sine has
    0.49, behind a saturation tanh(1) 0.36. None for pulses of fewer than ``FEWEST_SAMPLES`` at half height.

    Examples
    --------
    >>> from turnout.receptance.contact import Contact
    >>> x = np.sin(np.pi * np.arange(61) / 60)
    >>> about = Contact(1, 59, 30, 1.0, 40.0, 0.0, 0.0, 0.0, 0.0)
    >>> print(f"{top_share(x, about):.2f} {top_share(np.minimum(x, 0.9), about):.2f}")
    0.30 0.49
    """
    if contact.half_width < FEWEST_SAMPLES:
        return None
    first = max(0, contact.onset - 2)
    part = polarity * force[first : contact.end + 3]
    fine = CubicSpline(np.arange(part.size), part)(np.arange(8 * (part.size - 1) + 1) / 8.0)
    top = int(np.argmax(fine))
    width = [
        crossing(fine, top, share * fine[top], 1) - crossing(fine, top, share * fine[top], -1) for share in (0.95, 0.5)
    ]
    return width[0] / width[1]


def natural_top(contact):
    """Largest natural ``top_share``: noise shifts the 5 % line, and dw/w = d(level) / (2 * 0.05), three times over."""
    return FLATTEST_TOP * float(np.sqrt(1.0 + 60.0 * contact.noise_force / abs(contact.peak)))


def judge_tops(cuts, deviation):
    """Reject the blows whose tops are flatter than nature or than the test allows.

    A top flatter than a parabola is rejected unless the test's other blows look the same: then it is the shape of
    this tip. In a test of ``FEWEST_BLOWS`` or more, one hammer with one tip makes one shape, and a blow that stands
    out is rejected too: a soft saturation may leave a pointed pulse no flatter than a half-sine is by nature.
    """
    known = [(c, share) for c in cuts if (share := _share_if_quiet(c)) is not None]
    shares = np.array([share for _, share in known])
    enough = len(known) >= FEWEST_BLOWS
    middle = float(np.median(shares)) if enough else 0.0
    spread = deviation * MAD_TO_SD * float(np.median(np.abs(shares - middle))) if enough else np.inf
    for cut, share in known:
        c = cut.contact
        natural = natural_top(c) if c.half_width >= ENOUGH_SAMPLES else np.inf
        natural = min(max(natural, middle + FLATTER / 2.0), max(natural, CERTAINLY_FLAT))
        usual = middle + max(spread, FLATTER * (1.0 + 4.0 / c.half_width + 100.0 * c.noise_force / abs(c.peak)))
        limit = min(natural, usual)
        if share > limit:
            words = f"the others' {middle:.2f} allow" if usual < natural else "is natural"
            detail = f"the top of the force is flat: {share:.2f} of its half width, at most {limit:.2f} {words}"
            cut.rejections.append(Rejection("overload", float(share), float(limit), detail))


def _share_if_quiet(cut):
    if cut.rejections or cut.contact.noise_force > NOISIEST * abs(cut.contact.peak):
        return None
    return top_share(cut.force, cut.contact, cut.polarity)
