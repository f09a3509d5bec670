"""What a mismatch is locked to: residual energy by frame, against permutations, with the false discovery rate."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Frame:
    """One frame's share: ``level`` stands out with ``effect`` [dB] over the rest; ``p`` by permutation, ``q``
    after Benjamini and Hochberg over all frames; ``share`` of the variance of log energy; ``n`` cells."""

    frame: str
    level: object
    effect: float
    share: float
    p: float
    q: float
    n: int


def cell_energies(observations, residuals):
    """Log mean square of the whitened residual of every cell, (n,), and its levels: frame -> (n,) object."""
    energy, labels, names = [], {}, sorted({k for o in observations for k in o.labels})
    for o, r in zip(observations, residuals):
        if o.cells is None:
            continue
        inside = o.cells >= 0
        count = np.bincount(o.cells[inside])
        total = np.bincount(o.cells[inside], (o.whitened(r) ** 2)[inside])
        good = np.flatnonzero(count > 0)
        energy.append(np.log(np.maximum(total[good] / count[good], 1e-6)))
        for name in names:
            values = o.labels.get(name)
            labels.setdefault(name, []).append(
                np.full(good.size, None, dtype=object) if values is None else np.asarray(values, dtype=object)[good]
            )
    if not energy:
        return np.zeros(0), {}
    return np.concatenate(energy), {name: np.concatenate(v) for name, v in labels.items()}


def attribute(energy, labels, permutations=499, seed=0, excess=None):
    r"""Frames in order of evidence.

    The statistic of a frame is the largest standardised mean of its levels,
    :math:`\max_l \sqrt{n_l}\,(\bar e_l - \bar e) / s`, after the means of the other frames' levels are taken off
    (two-way); its null comes from shuffling the cells. ``excess`` (n,) replaces the log energy.

    Parameters
    ----------
    energy : (n,) array of float
        Log energy of cells in units of sigma.
    labels : dict
        Frame -> (n,) levels; None where a cell has no such frame.

    Returns
    -------
    list of Frame
    """
    rng = np.random.default_rng(seed)
    value = np.asarray(energy if excess is None else excess, dtype=float)
    found = []
    for name in labels:
        keep = np.array([level is not None for level in labels[name]], dtype=bool)
        levels, code = np.unique(labels[name][keep].astype(str), return_inverse=True)
        if levels.size < 2 or keep.sum() < 8:
            continue
        e = _without_others(value[keep], name, {k: v[keep] for k, v in labels.items()})
        count = np.bincount(code)
        spread = max(float(e.std()), 1e-12)

        def statistic(order, e=e, code=code, count=count, spread=spread):
            mean = np.bincount(code, e[order]) / count
            return (mean - e.mean()) * np.sqrt(count) / spread

        seen = statistic(np.arange(e.size))
        top = int(np.argmax(seen))
        null = [float(statistic(rng.permutation(e.size)).max()) for _ in range(permutations)]
        p = (1 + sum(n >= seen[top] for n in null)) / (permutations + 1)
        inside = e[code == top].mean()
        share = float(
            np.sum(count * (np.bincount(code, e) / count - e.mean()) ** 2) / max(np.sum((e - e.mean()) ** 2), 1e-12)
        )
        rest = e[code != top].mean() if levels.size > 1 else 0.0
        level = labels[name][keep][np.flatnonzero(code == top)[0]]
        found.append((name, level, 10.0 / np.log(10.0) * (inside - rest), share, p, int(keep.sum())))
    corrected = benjamini_hochberg([f[4] for f in found])
    frames = [Frame(f[0], f[1], float(f[2]), f[3], f[4], q, f[5]) for f, q in zip(found, corrected)]
    return sorted(frames, key=lambda f: (f.q, -f.share))


def _without_others(e, name, labels):
    """Log energy with the level means of all other frames taken off, two sweeps; not of those whose every level lies
    within one of this frame, as the axles of a train do: they would take it along."""
    e = e - e.mean()
    for _ in range(2):
        for other, values in labels.items():
            if other == name or _nested(values, labels[name]):
                continue
            _, code = np.unique(values.astype(str), return_inverse=True)
            if code.max() + 1 >= e.size // 2:
                continue
            e = e - (np.bincount(code, e) / np.bincount(code))[code]
    return e


def _nested(inner, outer):
    pairs = {*zip(inner.astype(str), outer.astype(str))}
    return len(pairs) == len({level for level, _ in pairs})


def benjamini_hochberg(p):
    """Corrected p values: expected share of wrong discoveries if all below are called (Benjamini, Hochberg 1995).

    >>> [round(q, 3) for q in benjamini_hochberg([0.01, 0.04, 0.03])]
    [0.03, 0.04, 0.04]
    """
    p = np.asarray(p, dtype=float)
    if not p.size:
        return []
    order = np.argsort(p)
    ranked = p[order] * p.size / np.arange(1, p.size + 1)
    q = np.minimum(np.minimum.accumulate(ranked[::-1])[::-1], 1.0)
    out = np.empty_like(q)
    out[order] = q
    return [float(v) for v in out]
