"""The same blow twice: a test that was exported again, in another format or under another name."""

import numpy as np

from turnout.records import Rejection

# Of the largest value: what rounding to 16 bits leaves. Two blows of one hammer differ by far more in shape alone.
ALIKE = 1e-4


def judge_repeats(cuts):
    """Reject every blow whose force and acceleration are those of an earlier one; counted twice it narrows all errors.

    The windows are compared with their peaks upon each other, as far as both go.
    """
    peaks = np.array([np.max(np.abs(c.force)) for c in cuts])
    order = np.argsort(peaks, kind="stable")
    for place, k in enumerate(order):
        for other in order[place + 1 :]:
            if peaks[other] - peaks[k] > 2.0 * ALIKE * peaks[other]:
                break
            first, second = sorted((int(k), int(other)))
            if not repeated(cuts[second]) and (apart := difference(cuts[first], cuts[second])) <= ALIKE:
                earlier = cuts[first]
                detail = f"the same samples as record {earlier.record + 1} of {earlier.recording.source or 'the test'}"
                cuts[second].rejections.append(Rejection("duplicate", apart, ALIKE, detail))


def difference(one, other) -> float:
    """Largest difference of force or acceleration over the largest value of either; inf for different rates."""
    if one.rate != other.rate:
        return np.inf
    tops = [int(np.argmax(np.abs(c.force))) for c in (one, other)]
    ahead = min(tops)
    n = ahead + min(one.force.size - tops[0], other.force.size - tops[1])
    pairs = ((one.force, other.force), (one.acceleration, other.acceleration))
    found = 0.0
    for a, b in pairs:
        a, b = a[tops[0] - ahead :][:n], b[tops[1] - ahead :][:n]
        top = max(np.max(np.abs(a)), np.max(np.abs(b)))
        found = max(found, float(np.max(np.abs(a - b)) / top) if top > 0.0 else 0.0)
    return found


def repeated(cut) -> bool:
    """Whether ``judge_repeats`` found the blow in an earlier one."""
    return any(r.reason == "duplicate" for r in cut.rejections)
