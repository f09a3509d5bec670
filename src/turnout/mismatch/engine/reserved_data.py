"""Verification on reserved recordings: fit of base, named effect, best rival and a decoy of as many parameters."""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import Joint

FITTED_STEPS = 8  # Gauss-Newton steps of a reserved recording's own nuisances
SETTLED = 1.0  # decrease of minus twice the log posterior; a step that gains less is the last
BLOCKS = 25  # stretches of a recording over which scatter is estimated


def fit_percent(observations, predictions, centre=True):
    r"""Share of the recordings that is predicted, :math:`100 (1 - \|y - \hat y\| / \|y - \bar y\|)` in units of sigma.

    >>> from turnout.mismatch.engine.case import Observation
    >>> y = np.array([1.0, -1.0, 1.0, -1.0])
    >>> fit_percent([Observation("a", "a", y, 1.0)], [0.9 * y])
    90.0
    """
    missed = total = 0.0
    for o, p in zip(observations, predictions):
        middle = float(np.mean(o.data)) if centre else 0.0
        missed += o.effective * float(np.sum(((o.data - p) / o.sigma) ** 2))
        total += o.effective * float(np.sum(((o.data - middle) / o.sigma) ** 2))
    return round(100.0 * (1.0 - float(np.sqrt(missed / total))), 4)


def fit_of_reserved(case, fit):
    """(predictions of the reserved recordings, fit [%]) by a fitted model. (None, None) if the simulation fails."""
    try:
        found = predict_reserved(case, fit, case.reserved)
    except SimulationError:
        return None, None
    return found, fit_percent(case.reserved, found)


def gain_error(observations, before, after):
    r"""Standard error of ``fit_percent`` of ``after`` less that of ``before``, in points.

    Jackknife over ``N_BLOCKS`` stretches of each observation, each in all of its rows (Efron and Stein 1981): with the
    gain :math:`d_i` of all stretches but one, :math:`\sqrt{(m - 1) / m \sum (d_i - \bar d)^2}`. Both fits lack the same
    roughness, and so do all sensors under one train. The gain is therefore more certain than either fit.
    """
    sums = np.array([_squares(o, b, a) for o, b, a in zip(observations, before, after)]).transpose(1, 0, 2)
    missed_before, missed_after, total = (np.sum(s) - s.ravel() for s in sums)
    gain = 100.0 * (np.sqrt(missed_before / total) - np.sqrt(missed_after / total))
    return float(np.sqrt((gain.size - 1) * np.var(gain)))


def _squares(o, before, after):
    """(3, N_BLOCKS) weighted sums of squares of the residuals ``before`` and ``after``, and of the recording."""
    parts = (o.data - before, o.data - after, o.data - np.mean(o.data))
    return [_stretches(o, (p / o.sigma) ** 2) for p in parts]


def _stretches(o, squares):
    """(N_BLOCKS,) sums of ``squares`` (n,) over stretches of the observation, each in all of its rows."""
    together = squares.reshape(o.rows, -1).sum(axis=0)
    return [o.effective * float(np.sum(b)) for b in np.array_split(together, BLOCKS)]


def falls(observations, before, after, points):
    """Whether ``after`` fits worse than ``before`` by more than ``points`` of fit and than two standard errors.

    The standard error is that of the difference of weighted squares over ``N_BLOCKS`` stretches of each observation,
    each in all of its rows. One in six names that say nothing about these observations reaches one standard error.
    """
    lost = (((o.data - a) ** 2 - (o.data - b) ** 2) / o.sigma**2 for o, b, a in zip(observations, before, after))
    parts = [part for o, d in zip(observations, lost) for part in _stretches(o, d)]
    error = np.std(parts, ddof=1) * np.sqrt(len(parts))
    return sum(parts) > 2.0 * error and fit_percent(observations, after) < fit_percent(observations, before) - points


def predict_reserved(case, fit, observations):
    """Predictions of ``observations`` by the fitted model; only nuisances that they own are fitted to them.

    Any model gets the same freedom (speed, time and load of a passage), so that models stay comparable. SimulationError
    if the model cannot be simulated there.
    """
    joint = Joint(case, fit.candidates, observations)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    owners = {o.name for o in observations}
    own = np.array([n.owner in owners for n in case.nuisances] + [False] * fit.psi.size, dtype=bool)
    predictions = joint.predict(theta)
    if not own.any():
        return predictions
    residuals = joint.residuals(predictions)
    cost = joint.cost(theta, residuals)
    for _ in range(FITTED_STEPS):
        step = _own_step(case, joint, theta, fit.terms, predictions, residuals, own)
        tried = (_moved(joint, theta, own, 0.5**h * step) for h in range(3))
        found = next((f for f in tried if f is not None and f[3] < cost), None)
        if found is None:
            break
        gain = cost - found[3]
        theta, predictions, residuals, cost = found
        if gain < SETTLED:
            break
    return predictions


def _own_step(case, joint, theta, terms, predictions, residuals, own):
    """Gauss-Newton step of the nuisances that the observations own, at most one prior standard deviation each."""
    white = _own_columns(case, joint, theta, terms, predictions, own)
    scale = {kind: max(1.0, v) for kind, v in joint.level(residuals).items()}
    rows, right = joint.stacked(white, residuals, scale)
    scaled = rows * joint.sd[own]
    pull = (joint.mean[own] - theta[own]) / joint.sd[own]
    step = np.linalg.solve(scaled.T @ scaled + np.eye(int(own.sum())), scaled.T @ right + pull)
    return joint.sd[own] * np.clip(step, -1.0, 1.0)


def _moved(joint, theta, own, step):
    tried = theta.copy()
    tried[own] += step
    predictions = joint.tried(tried)
    if predictions is None:
        return None
    residuals = joint.residuals(predictions)
    return tried, predictions, residuals, joint.cost(tried, residuals)


def _own_columns(case, joint, theta, terms, predictions, own):
    """Whitened derivatives by the owned nuisances, for each observation by its own alone."""
    values, found = joint.split(theta)[0], []
    owned = [n for n, mine in zip(case.nuisances, own) if mine]
    for o, p in zip(joint.observations, predictions):
        columns = np.zeros((o.data.size, len(owned)))
        mine = [k for k, n in enumerate(owned) if n.owner == o.name]
        if mine:
            columns[:, mine] = case.own_jacobian(values, terms, o, p, [owned[k].name for k in mine])
        found.append(o.whitened(columns))
    return found


def decoy(observations, predictions, reserved, reserved_predictions, n):
    """Predictions of ``reserved`` by the base model and a filter of ``n`` free taps behind it.

    The taps (on the prediction delayed and advanced) are fitted to the ``observations`` of the reserved data types.
    They show what any n free numbers gain.
    """
    kinds = {o.kind for o in reserved}
    seen = [(o, p, np.sqrt(o.effective) / o.sigma) for o, p in zip(observations, predictions) if o.kind in kinds]
    if not seen:
        return list(reserved_predictions)

    def columns(p):
        shifts = [s for k in range(1, n + 1) for s in (k, -k)][:n]
        return np.column_stack([np.roll(p, s) for s in shifts])

    rows = np.concatenate([columns(p) * weight[:, None] for _, p, weight in seen])
    right = np.concatenate([(o.data - p) * weight for o, p, weight in seen])
    taps = np.linalg.lstsq(rows, right, rcond=None)[0]
    return [p + columns(p) @ taps for p in reserved_predictions]
