"""Candidates of a turnout: every effect of ``turnout.physics`` at every site where it may act.

Wheelsets with a mass far from that of the file are simulated, since a derivative does not extend that far. The P2
resonance goes as the inverse root of the unsprung mass. Where it has moved by more than its width, a few per cent more
mass make the fit worse, and the derivative points the wrong way.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate, Effect, EffectSite, NamingRules, RefitStarts
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.priors import SATURATION
from turnout.physics.hypothesis import (
    BaySite,
    BladeSite,
    ChannelSite,
    ContactSite,
    Hypothesis,
    SaturatedChannelSite,
    Site,
    SupportSite,
    TrackSite,
    TrainSite,
)
from turnout.simulate.blade import transfer_position

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.case_data import CaseData


def list_candidates(data: CaseData, families: Collection[str] | None = None) -> tuple[Candidate, ...]:
    """All candidates of a case.

    Parameters
    ----------
    data : CaseData
        Its track, sensors, recordings and trains define the sites.
    families : collection of str or None
        Effects to which the candidates are restricted; None: all.

    Returns
    -------
    tuple of Candidate
        By site, and at each site in the order of ``physics.TERMS``.
    """
    effects = [effect for effect in physics.TERMS if families is None or effect.name in families]
    candidates = (candidate for site in sites_of(data) for candidate in _candidates_at(site, effects))
    if families is None:
        return tuple(candidates)
    return tuple(replace(candidate, effect=candidate.effect.within(families)) for candidate in candidates)


def _candidates_at(site: Site, effects: Iterable[type[physics.PhysicsTerm]]) -> Iterator[Candidate]:
    for effect in effects:
        if isinstance(site, effect.site_types):
            yield from (candidate_of(effect, hypothesis) for hypothesis in effect.hypotheses(site))


def candidate_of(effect: type[physics.PhysicsTerm], hypothesis: Hypothesis) -> Candidate:
    """The candidate that tests an effect at one site.

    Parameters
    ----------
    effect : type
        Class of the effect.
    hypothesis : Hypothesis
        The site, and what is assumed of the effect there.

    Returns
    -------
    Candidate
    """
    size, masking = hypothesis.smallest_reportable, hypothesis.masking
    return Candidate(
        Effect(
            effect.name,
            effect.parameters if hypothesis.parameters is None else hypothesis.parameters,
            make=lambda psi: effect(**hypothesis.fixed, **psi),
            component=effect.component,
            exact=effect.exact,
            model_error_share=effect.model_error_share,
            limit_form=effect.limit_form,
            simpler_form=effect.simpler_form,
            unbounded_form=effect.unbounded_form,
            general_form=effect.general_form,
        ),
        RefitStarts(
            hypothesis.starts,
            from_base=effect.start_from_base,
            prescreen_group=effect.prescreen_group,
            promise=hypothesis.promise,
            nuisances=hypothesis.start_nuisances,
            sign_ambiguous=effect.sign_ambiguous,
            nonlinear_in_size=effect.nonlinear_in_size,
        ),
        EffectSite(
            hypothesis.where,
            effect.frame,
            hypothesis.n_scanned,
            masking.parameter,
            masking.sd,
            masking.size,
            masking.same_quantity,
            hypothesis.rival_axles,
        ),
        NamingRules(
            smallest_reportable=effect.smallest_reportable if size is None else size,
            n_size_parameters=effect.n_size_parameters,
            min_significance=effect.min_significance,
            must_reach_control_level=effect.must_reach_control_level,
            external_evidence=hypothesis.external_evidence,
            evidence_suffices=effect.evidence_suffices,
            required_data_type=effect.required_data_type,
            must_not_oppose=hypothesis.must_not_oppose,
        ),
    )


def rival_axles(evidence: Mapping[int, float], wheel: int) -> tuple[int, ...]:
    """Axles, 1 first, of a train that may have the effect of a wheel instead: their evidence is hardly smaller.

    Parameters
    ----------
    evidence : mapping of int to float
        Wheel of the train, 0 first -> evidence that it has the effect. [nats]
    wheel : int
        The one that is tested.

    Returns
    -------
    tuple of int
        The likeliest first.

    Examples
    --------
    >>> rival_axles({0: 34.3, 1: 34.6, 2: 31.0, 3: 4.0}, 1)
    (1, 3)
    """
    close = [w for w, nats in evidence.items() if w != wheel and nats > evidence[wheel] - THRESHOLDS.position_margin]
    return tuple(w + 1 for w in sorted(close, key=lambda w: -evidence[w]))


def parameters_with(effect: type[physics.PhysicsTerm], **priors: tuple[float, float]) -> tuple[physics.Parameter, ...]:
    """Parameters of an effect with priors about the values of a scan or a fit, whose cost is already counted.

    Parameters
    ----------
    effect : type
        Class of the effect.
    **priors : tuple of float
        Mean and standard deviation, by the name of the parameter.

    Returns
    -------
    tuple of Parameter
    """
    return tuple(replace(p, prior=priors[p.name]) if p.name in priors else p for p in effect.parameters)


def sites_of(data: CaseData) -> Iterator[Site]:
    """Every site at which a case can test effects: supports, track, channels, contact of the wheels, trains.

    Parameters
    ----------
    data : CaseData
        Observations and site of a case.

    Yields
    ------
    Site
    """
    yield from _support_sites(data)
    yield from _bay_sites(data)
    yield TrackSite(data.site.nominal.turnout.track.rail, bool(data.aligned_passages))
    yield from channel_sites(data)
    yield from _blade_sites(data)
    if data.aligned_passages:
        yield ContactSite(tuple(s.place for s in data.campaign.sensors))
        for train in data.site.trains:
            yield TrainSite(train, len(data.site.trains))


def _support_sites(data: CaseData) -> Iterator[SupportSite]:
    zone = data.site.nominal
    positions = zone.turnout.track_of("main").support
    for j in zone.effect_supports:
        place = round(float(positions[j]), 3)
        yield SupportSite(j, place, len(zone.effect_supports), zone.first, zone.last, bool(data.aligned_passages))


def _bay_sites(data: CaseData, shares: Sequence[float] = (0.5,), n_positions: int = 2) -> Iterator[BaySite]:
    """Places between the supports that are tested, by their ``shares`` of the bay; by default the middles."""
    zone = data.site.nominal
    positions = zone.turnout.track_of("main").support
    for j, k in pairwise(zone.effect_supports):
        for share in shares:
            place = round(float((1.0 - share) * positions[j] + share * positions[k]), 3)
            yield BaySite(j, place, len(zone.effect_supports), share, n_positions)


def finer_candidates(data: CaseData, candidate: Candidate) -> tuple[Candidate, ...]:
    """The effect of a candidate at a quarter and three quarters of the bays that it lies in or ends.

    Parameters
    ----------
    data : CaseData
        Its track.
    candidate : Candidate
        A candidate of ``list_candidates``.

    Returns
    -------
    tuple of Candidate
        None for an effect that is not tested between supports.
    """
    effect = physics.effects_by_name().get(candidate.family)
    if effect is None or BaySite not in effect.site_types or candidate.position is None:
        return ()
    ends = np.round(data.site.nominal.turnout.track_of("main").support, 3)  # as positions of candidates
    sites = _bay_sites(data, (0.25, 0.75), 4)
    beside = [s for s in sites if ends[s.support] <= candidate.position <= ends[s.support + 1]]
    return tuple(finer for site in beside for finer in _candidates_at(site, [effect]))


def _blade_sites(data: CaseData) -> Iterator[BladeSite]:
    """The blade on the route of the passages, with its supports near the sensors."""
    zone = data.site.nominal
    route = next((p.passage.route for p in data.aligned_passages.values()), "main")
    track = zone.turnout.track_of(route)
    if track.blade is None:
        return
    near, slide_chairs = set(zone.effect_supports), track.blade.slide_chairs(track)
    fastened = [j for j in track.blade.chairs(track) if j not in slide_chairs]

    def near_sensors(supports: Iterable[int]) -> tuple[tuple[int, float], ...]:
        return tuple((j, round(float(track.support[j]), 3)) for j in supports if j in near)

    transfer = transfer_position(zone.turnout.surfaces(route), track.blade)
    yield BladeSite(near_sensors(slide_chairs), near_sensors(fastened), transfer, bool(data.aligned_passages))


def channel_sites(data: CaseData) -> Iterator[ChannelSite | SaturatedChannelSite]:
    """Every channel in use, and after these every one that is saturated.

    Parameters
    ----------
    data : CaseData
        Observations and site of a case.

    Yields
    ------
    ChannelSite or SaturatedChannelSite
    """
    for sensor in data.campaign.sensors:
        name = sensor.name
        pairs = tuple(pair.name for pair in data.frf_pairs.values() if pair.channel == name)
        peak = data.band_peak(name) if data.aligned_passages else 0.0
        lowest_limit = SATURATION.min_side_ratio * data.raw_peak(name) if peak > 0.0 else 0.0
        material = data.settings.materiality * peak
        yield ChannelSite(
            name, len(data.campaign.sensors), pairs, bool(data.aligned_passages), peak, lowest_limit, material
        )
    for name, estimate in data.saturated.items():
        yield SaturatedChannelSite(name, estimate.limit, SATURATION.limit_sd * estimate.limit, estimate.gain)


def recorded_quantities(data: CaseData) -> dict[str, list[Any]]:
    """Quantities of the recordings of a case that effects may require (``Requirement.quantity``).

    Passages in reserve suggest no effect: trains and speeds are those of the fitted ones.

    Parameters
    ----------
    data : CaseData
        Its recordings.

    Returns
    -------
    dict
        Quantity -> value of each recording, None where it is not known.
    """
    fitted = [data.aligned_passages[o.name] for o in data.observations if o.name in data.aligned_passages]
    conditions = [pair.conditions for pair in data.frf_pairs.values()]
    conditions += [aligned.conditions for aligned in data.aligned_passages.values()]
    return {
        "passage": list(data.aligned_passages),
        "hammer_test": [pair.name for pair in data.frf_pairs.values()],
        "train": [aligned.passage.train or None for aligned in fitted],
        "speed": [aligned.speed for aligned in fitted if aligned.passage.train],
        "rail_temperature": [c.get("rail_temperature") for c in conditions],
    }


def is_testable(data: CaseData, candidate: Candidate) -> bool:
    """Whether the recordings have all that the effect strictly requires (``PhysicsTerm.requirements``).

    Otherwise the effect could explain any difference between recordings.

    Parameters
    ----------
    data : CaseData
        Its recordings.
    candidate : Candidate
        A candidate of ``list_candidates``.

    Returns
    -------
    bool
    """
    requirements = physics.effects_by_name()[candidate.family].requirements
    recorded = recorded_quantities(data)
    return all(r.is_met(recorded) for r in requirements if r.is_strict and not r.part)


def distant_starts(case: TrackCase, fit: Fit) -> list[tuple[Candidate, tuple[float, ...]]]:
    """Sizes to simulate, for trains whose residual exceeds the control level.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        Base fit of the case.

    Returns
    -------
    list of (Candidate, tuple of float)
    """
    level, effects = case.control_level["passage"], physics.effects_by_name()
    sizes = [(c, effects[c.family].distant_starts) for c in case.candidates if c.family in effects]
    excessive = [(c, s) for c, s in sizes if s and residual_of_train(case, fit, str(c.where["train"])) > level]
    return [(c, (size,)) for c, s in excessive for size in s]


def residual_of_train(case: TrackCase, fit: Fit, train: str) -> float:
    """Weighted mean square residual of ``fit`` in the passages of a train; 0 without one.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    train : str
        Type or number of the train.

    Returns
    -------
    float
        [-]
    """
    squares = [
        (o.n_effective, o.effective * float(np.sum(np.square(w))))
        for o, w in zip(case.observations, fit.white)
        if o.name in case.aligned_passages and case.aligned_passages[o.name].conditions["train"] == train
    ]
    return sum(total for _, total in squares) / sum(n for n, _ in squares) if squares else 0.0
