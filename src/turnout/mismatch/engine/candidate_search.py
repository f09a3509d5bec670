"""Selection of the candidates that are refitted jointly, and of their starts.

Scores order the queue and decide nothing.

The size and evidence of an effect that a nuisance parameter may have absorbed follow in closed form from the base fit.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case_check import checked_predictions
from turnout.mismatch.engine.component_evidence import evidence_by_position, local_changes
from turnout.mismatch.engine.hammer_prescreen import prescreen
from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.search import Search


class Entry(NamedTuple):
    """A candidate with the ``gain`` [nats] that it promises from ``start`` (n_term,) and nuisance ``values``.

    Without ``values`` a refit starts at the nuisances of the base fit.
    """

    gain: float
    candidate: Candidate
    start: np.ndarray
    values: dict[str, float]


def masked_candidates(case: Case, fit: Fit) -> list[Entry]:
    """Every candidate with a masking parameter among the nuisances.

    The estimate of the masking parameter is the effect, drawn towards the prior. The values of an entry are all
    nuisance parameters with the masking parameter back at its mean and the effect in its place.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    list of Entry
    """
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    entries = []
    for candidate in case.candidates:
        k = index.get(candidate.site.masking_parameter)
        if k is None:
            continue
        masking = case.nuisances[k]
        m, s = fit.values[masking.name] - masking.mean, float(np.sqrt(fit.covariance[k, k]))
        gain_and_size = gain_with_wide_prior(m, s, masking.sd, candidate.site.masking_sd)
        if gain_and_size is None:
            continue
        gain, size = gain_and_size
        shift = fit.covariance[: len(index), k] / s**2 * (size - m)
        values = {
            n.name: float(np.clip(fit.values[n.name] + d, *n.bounds)) for n, d in zip(case.nuisances, shift)
        }  # fmt: skip
        low, high = candidate.parameters[0].bounds
        start = np.clip([(candidate.site.from_masking or np.exp)(size)], low, high)
        values[masking.name] = masking.mean
        entries.append(Entry(gain - np.log(candidate.site.n_scanned), candidate, start, values))
    return entries


def gain_with_wide_prior(m: float, s: float, tau: float, wide_sd: float) -> tuple[float, float] | None:
    r"""Gain when a prior N(0, τ²), under which the posterior is N(m, s²), becomes N(0, T²).

    .. math:: s'^{-2} = s^{-2} - \tau^{-2}, \quad m' = m\, s'^2 / s^2, \quad
              g = \ln N(m'; 0, s'^2 + T^2) - \ln N(m'; 0, s'^2 + \tau^2)

    Parameters
    ----------
    m, s : float
        Mean and standard deviation of the posterior.
    tau : float
        Standard deviation of the prior.
    wide_sd : float
        T, that of the wide prior.

    Returns
    -------
    gain : float
        [nats]
    estimate : float
        That under the wide prior, :math:`m' T^2 / (s'^2 + T^2)`. None instead of both if the data add nothing to the
        prior.

    Examples
    --------
    >>> gain_with_wide_prior(0.0, 0.1, 0.1, 0.7) is None
    True
    """
    if s >= THRESHOLDS.uninformed_sd_share * tau:
        return None
    data_variance = 1.0 / (1.0 / s**2 - 1.0 / tau**2)
    data_mean = m * data_variance / s**2
    narrow_variance, wide_variance = data_variance + tau**2, data_variance + wide_sd**2
    gain = 0.5 * np.log(narrow_variance / wide_variance) + 0.5 * data_mean**2 * (
        1.0 / narrow_variance - 1.0 / wide_variance
    )
    return float(gain), float(data_mean * wide_sd**2 / wide_variance)


@dataclass(frozen=True)
class RefitTask:
    """A ``candidate`` to refit from ``start`` (n_term,) and nuisance ``values``.

    ``promise`` is the gain that it was selected for, and ``hammer_gain`` that from the hammer tests alone [nats].
    A ``rival`` is refitted only if another effect of its component gains something.
    """

    candidate: Candidate
    start: np.ndarray
    values: dict[str, float]
    promise: float = 0.0
    hammer_gain: float = 0.0
    rival: bool = False


def shortlist(search: Search, fit: Fit, prescreened: Sequence[Entry] = ()) -> list[RefitTask]:
    """Candidates to refit on top of a fit.

    In a small case, every family is refitted from every start. In a large case, families that show in
    the hammer tests are ``prescreened``. The others are scored by the columns of their starts (``Case.screen``),
    or by a prediction if there is no column.

    Parameters
    ----------
    search : Search
    fit : Fit
    prescreened : sequence of Entry
        Those of ``prescreened_entries``.

    Returns
    -------
    list of RefitTask
        In order of promise.
    """
    case = search.case
    candidates = [
        c
        for c in (*case.candidates, *case.residual_candidates(fit))
        if not any(is_same_site(c, k) for k in fit.candidates)
    ]
    if not case.is_large:
        return [RefitTask(c, np.asarray(s, dtype=float), {}) for c in candidates for s in c.starts]
    prescreened = [e for e in prescreened if e.candidate in candidates]
    masked = [e for e in masked_candidates(case, fit) if e.candidate in candidates]
    by_family: dict[str, list[Entry]] = {}
    for entry in (*prescreened, *masked, *_screened_entries(case, fit, candidates)):
        by_family.setdefault(entry.candidate.family, []).append(entry)
    prescreen_gains = {e.candidate.key: e.gain for e in prescreened}
    selected = [
        entry
        for entry in _most_promising(by_family, search.settings)
        if entry.gain > required_promise(entry, fit, prescreen_gains, search.settings)
    ]
    min_gain = THRESHOLDS.min_promise_share * max((entry.gain for entry in selected), default=0.0)
    chosen = [e for rank, e in enumerate(selected) if rank < THRESHOLDS.n_always_refitted or e.gain > min_gain]
    if not fit.candidates:  # beside another effect the residual is also an error in its shape
        chosen += entries_of_parts(changed_parts(case, fit, search.settings), chosen, by_family)
    tasks = [(e, False) for e in chosen] + [(e, True) for e in component_rivals(chosen, by_family)]
    fitted = [(with_fitted_start(e, by_family), e.gain, rival) for e, rival in tasks]
    return [RefitTask(*e[1:], gain, prescreen_gains.get(e.candidate.key, 0.0), rival) for e, gain, rival in fitted]


def prescreened_entries(search: Search, fit: Fit, promising: Collection[str] | None = ()) -> list[Entry]:
    """Candidates of a large case, fitted to its hammer tests beside the effects of a fit.

    They are fitted from the priors, so they do not depend on the nuisances of the fit.

    Parameters
    ----------
    search : Search
    fit : Fit
    promising : collection of str or None
        Families that are tried on top of a first effect, beside those of the whole track, which the common parameters
        mask; None: all. For others the residual is small enough for columns.

    Returns
    -------
    list of Entry
        The best of each family. [] for a small case.
    """
    if not search.case.is_large:
        return []
    families = None
    if fit.candidates and promising is not None:
        families = {
            *promising,
            *(c.family for c in search.case.candidates if c.refit.prescreen_group and c.site.n_scanned == 1),
        }
    return [Entry(trial.gain, trial.candidate, trial.psi, trial.values) for trial in prescreen(search, fit, families)]


def _screened_entries(case: Case, fit: Fit, candidates: Sequence[Candidate]) -> Iterator[Entry]:
    """Starts scored by the change that they make: distant ones and those without a column are predicted."""
    projector, columns = Projector(case, fit), case.screen(fit)
    for candidate, distant in case.distant_starts(fit):
        if candidate in candidates:
            at_start = replace(candidate, refit=replace(candidate.refit, points=(distant,), nonlinear_in_size=True))
            yield _distant_entry(case, fit, projector, at_start, candidate)
    for candidate in candidates:
        if candidate.refit.promise is not None:
            start = np.asarray(candidate.starts[0])
            yield Entry(candidate.refit.promise, candidate, start, dict(candidate.refit.nuisances))
    chosen = [(c, k) for c in candidates if c.refit.promise is None for k in range(len(c.starts))]
    changes = [columns.get((c.key, k)) or _predicted_change(case, fit, c, k) for c, k in chosen]
    for (candidate, k), (gain, share) in zip(chosen, projector.scores(changes, *zip(*chosen)) if chosen else ()):
        yield Entry(0.5 * gain - np.log(candidate.site.n_scanned), candidate, candidate.scaled_start(k, share), {})


def _distant_entry(case: Case, fit: Fit, projector: Projector, at_start: Candidate, candidate: Candidate) -> Entry:
    """Entry of a ``candidate`` simulated ``at_start``, with its masking parameter at the mean: no change is small."""
    reset_values = {n.name: n.mean for n in case.nuisances if n.name == candidate.site.masking_parameter}
    changes = _predicted_change(case, replace(fit, values={**fit.values, **reset_values}), at_start, 0)
    gain, _ = projector.score(changes, at_start, 0)
    return Entry(0.5 * gain - np.log(candidate.site.n_scanned), candidate, np.array(at_start.starts[0]), reset_values)


def required_promise(entry: Entry, fit: Fit, prescreen_gains: Mapping[str, float], settings: MismatchSettings) -> float:
    """Promise from which an entry is refitted. Beside a first effect it must be that of a separate name.

    Parameters
    ----------
    entry : Entry
    fit : Fit
        Without the candidate of the entry.
    prescreen_gains : mapping
        Key of a candidate -> its gain in the hammer tests. [nats]
    settings : MismatchSettings

    Returns
    -------
    float
        [nats]
    """
    if not fit.candidates:
        return settings.promise
    is_hammer_gain = entry.gain == prescreen_gains.get(entry.candidate.key)
    return settings.threshold * (THRESHOLDS.hammer_promise_share if is_hammer_gain else 1.0)


def with_fitted_start(entry: Entry, by_family: Mapping[str, Sequence[Entry]]) -> Entry:
    """The entry, with start and nuisance parameters of the best fit of the same candidate, if there is one.

    A column is linear, and from it all nuisance parameters would have to return.

    Parameters
    ----------
    entry : Entry
    by_family : mapping
        Family -> its entries.

    Returns
    -------
    Entry
    """
    candidate = entry.candidate
    fitted = [e for e in by_family[candidate.family] if e.candidate.key == candidate.key and e.values]
    return max(fitted, key=lambda e: e.gain, default=entry)


def changed_parts(case: Case, fit: Fit, settings: MismatchSettings) -> set[tuple[str, Any]]:
    """Parts at the position where the components differ most between passages and hammer tests.

    What depends on load acts on trains alone. The base fit imitates a large effect of this kind by other stiffnesses
    and lighter wheels, and no small effect then promises anything.

    Parameters
    ----------
    case : Case
    fit : Fit
        Without effects, with its Jacobian.
    settings : MismatchSettings
        The difference must gain as much as an effect must promise.

    Returns
    -------
    set of (component, position)
        ``Candidate.part`` of the effects there; empty where nothing differs.
    """
    ranked = evidence_by_position(local_changes(case, fit))
    if not ranked or ranked[0].nats <= settings.promise:
        return set()
    frame, level = ranked[0].frame, ranked[0].level
    return {c.part for c in case.candidates if c.effect.component and _distance(c.where.get(frame), level) == 0.0}


def component_rivals(chosen: Sequence[Entry], by_family: Mapping[str, Sequence[Entry]]) -> list[Entry]:
    """Best starts of other effects on the components of the first two chosen: columns hardly separate them.

    Parameters
    ----------
    chosen : sequence of Entry
        In order of promise.
    by_family : mapping
        Family -> its entries.

    Returns
    -------
    list of Entry
    """
    return entries_of_parts([e.candidate.part for e in chosen if e.candidate.effect.component][:2], chosen, by_family)


def entries_of_parts(
    parts: Collection[tuple[str, Any]], chosen: Sequence[Entry], by_family: Mapping[str, Sequence[Entry]]
) -> list[Entry]:
    """Best start of every effect of some parts that is not among the chosen.

    Parameters
    ----------
    parts : collection of (component, position or sensor)
    chosen : sequence of Entry
    by_family : mapping
        Family -> its entries.

    Returns
    -------
    list of Entry
    """
    chosen_effects = {(e.candidate.family, e.candidate.part) for e in chosen}
    best_entries: dict[tuple, Entry] = {}
    for entry in sorted((e for entries in by_family.values() for e in entries), key=lambda e: e.gain):
        effect = entry.candidate.family, entry.candidate.part
        if entry.candidate.part in parts and effect not in chosen_effects:
            best_entries[effect] = entry
    return list(best_entries.values())


def is_same_site(candidate: Candidate, accepted: Candidate) -> bool:
    """Whether a second effect at the position, sensor or train of an accepted one would only correct its shape.

    Not so for two exact effects, nor for an effect of all wheels beside one of a single wheel that is known by its
    impacts.

    Parameters
    ----------
    candidate, accepted : Candidate

    Returns
    -------
    bool
    """
    if candidate.key == accepted.key:
        return True
    a, b = candidate.where, accepted.where
    of_one_wheel = {(c.naming.evidence_suffices, "axle" in c.where) for c in (candidate, accepted)}
    if (candidate.effect.exact and accepted.effect.exact) or of_one_wheel == {(True, True), (False, False)}:
        return False
    is_same_effect = candidate.family == accepted.family
    max_distance = THRESHOLDS.same_effect_distance if is_same_effect else THRESHOLDS.same_site_distance
    is_near = "place" in a and "place" in b and _distance(a["place"], b["place"]) < max_distance
    return is_near or any(k in a and a[k] == b.get(k) for k in ("sensor", "train"))


def _distance(first: Any, second: Any) -> float:
    """Distance between two positions [m]. Positions in words are equal, or infinitely far from each other."""
    if isinstance(first, (int, float)) and isinstance(second, (int, float)):
        return abs(first - second)
    return 0.0 if first == second else np.inf


def _predicted_change(case: Case, fit: Fit, candidate: Candidate, k: int) -> list[np.ndarray] | None:
    """Change of the prediction at a start. None if the effect cannot be simulated at this size."""
    try:
        terms = (*fit.terms, candidate.term(candidate.starts[k]))
        new = checked_predictions(case.observations, case.predict(fit.values, terms, case.observations))
    except SimulationError:
        return None
    return [a - b for a, b in zip(new, fit.predictions)]


def _most_promising(by_family: Mapping[str, Sequence[Entry]], settings: MismatchSettings) -> list[Entry]:
    """The best start of each of the first ``refits`` families. Of the first few also their second best site."""
    ranked = [sorted(entries, key=lambda e: -e.gain) for entries in by_family.values()]
    ranked.sort(key=lambda entries: -entries[0].gain)
    chosen = []
    for rank, (leader, *others) in enumerate(ranked[: settings.refits]):
        chosen.append(leader)
        if rank < THRESHOLDS.n_families_with_sites:
            chosen += [e for e in others if e.candidate.key != leader.candidate.key][: settings.joint_starts - 1]
    return chosen
