"""Candidates of a turnout: every effect of the catalogue at every position where it may act.

Wheelsets with a mass far from that of the file are simulated, since a derivative does not extend that far. The P2
resonance goes as the inverse root of the unsprung mass. Where it has moved by more than its width, a few per cent more
mass make the fit worse, and the derivative points the wrong way.
"""

from dataclasses import replace

import numpy as np

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.turnout.saturation import LIMIT_SD, MIN_SIDE_RATIO

MODEL_ERROR_SHARE = 0.15  # error of an effect's size by its form; nine of another simulator: median 0.12
EXACT_ERROR_SHARE = 0.03  # the same of gains and delays; ten of another simulator: median 0.01
GAP_STARTS = (1.3e-4, 3e-4, 7e-4, 1.6e-3)  # m; a train closes the first at once and the last never
BEARING_SHARES = (0.0, 0.4)  # share of the ballast that still bears
MOUNT_FREQUENCIES = tuple(np.geomspace(150.0, 1500.0, 12))  # Hz, one half-power width apart at Q = 5
DELAY_STARTS = (1e-4, 2.5e-4, *np.arange(5e-4, 5.6e-3, 5e-4))  # s, a quarter period at 500 Hz apart
CLIPPING_SHARES = (0.05, 0.2, 0.5)  # from the largest recorded value (0) to twice the band's peak (1)
DRIFT_STARTS = (2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)  # relative; a train passes within some seconds
RESONATOR_FREQUENCIES = tuple(np.geomspace(90.0, 500.0, 6))  # Hz; an attached mass acts over half an octave
BENDING_FREQUENCIES = tuple(np.geomspace(85.0, 760.0, 20))  # Hz, two widths of the resonance apart
DIP_STEP = 0.6  # m, between dip positions; the shift parameter covers positions in between
# Smallest size that is reported, in the unit of the first parameter: a smaller effect needs no action.
SMALLEST_REPORTABLE = {
    "high_pass": 2.0, "sensor_gain": 0.04, "sensor_position": 0.05, "time_offset": 5e-5, "clock_drift": 2e-4,
    "local_pad": 0.15, "local_ballast": 0.15, "hanging_sleeper": 5e-5, "surface_dip": 3e-5, "pad_temperature": 1e-3,
    "unsprung_mass": 0.07, "contact_stiffness": 0.1, "rail_shear": 0.9, "mount_resonance": 1 / 2000.0,
    "zener_pad": 0.1, "dry_friction": 500.0, "attached_resonator": 5.0,
    "ballast_hardening": 0.3, "pad_preload": 500.0, "low_pass": 1 / 2000.0, "sleeper_mode": 0.05,
    "ballast_inertia": 20.0,
}  # fmt: skip
HARDENING_HALF_LENGTHS = (1, 2, 4)  # sleepers to either side that harden alike
LIMIT_FORMS = {"local_ballast": "hanging_sleeper"}  # ballast without stiffness acts as a gap that no train closes


def list_candidates(case, families=None):
    """All candidates of a case, or those of some ``families``."""
    candidates = [
        *_support_candidates(case),
        *_whole_track_candidates(case),
        *_sensor_candidates(case),
        *_surface_candidates(case),
        *_wheel_candidates(case),
    ]
    return tuple(c for c in candidates if families is None or c.family in families)


def _candidate(term, make, starts, where=None, scanned=1, base=True, parameters=None, always="", **more):
    chosen = tuple(p for p in term.parameters if parameters is None or p.name in parameters)
    frame = getattr(term, "frame", "place")
    return Candidate(
        term.name,
        chosen,
        make,
        starts,
        where or {},
        frame,
        scanned,
        base,
        always,
        **{
            "model_error_share": MODEL_ERROR_SHARE,
            "smallest_reportable": SMALLEST_REPORTABLE.get(term.name, 0.0),
            **more,
        },
    )


def _support_candidates(case):
    """One candidate per effect and support of the zone's ``effect_supports``."""
    positions, n = case.track().support, len(case.zone.effect_supports)
    for j in case.zone.effect_supports:  # ballast first: a hanging sleeper looks like soft ballast to a hammer
        where = {"sleeper": j, "place": round(float(positions[j]), 3)}
        for term, component in ((physics.LocalBallast, "ballast"), (physics.LocalPad, "pad")):
            yield _candidate(
                term,
                lambda p, j=j, t=term: t(j, **p),
                ((0.4,), (2.5,)),
                where,
                n,
                always=component,
                masking_parameter=f"{component}_{j}",
                component=component,
                limit_form=LIMIT_FORMS.get(term.name, ""),
            )
        yield _candidate(physics.HangingSleeper, lambda p, j=j: physics.HangingSleeper(j, **p),
                         tuple((g, s) for s in BEARING_SHARES for g in GAP_STARTS), where, n, base=False,
                         always="ballast", component="ballast", simpler_form=("local_ballast", 1),
                         unbounded_form="local_ballast")  # fmt: skip
        yield _candidate(
            physics.AttachedResonator,
            lambda p, j=j: physics.AttachedResonator(j, **p),
            tuple((15.0, f, 0.03) for f in RESONATOR_FREQUENCIES),
            where,
            n,
            min_significance=1.0,
        )
        if case.aligned_passages:  # for impacts of one force friction is a damper: only trains distinguish it
            yield _candidate(physics.DryFriction, lambda p, j=j: physics.DryFriction(j, **p), ((1500.0,),), where, n,
                             required_data_type="passage")  # fmt: skip
        for half in HARDENING_HALF_LENGTHS if case.aligned_passages else ():
            if case.zone.first <= j - half and j + half <= case.zone.last:
                yield _candidate(physics.BallastHardening,
                                 lambda p, a=j - half, b=j + half: physics.BallastHardening(a, b, **p), ((2.0,),),
                                 {**where, "sleepers": 2 * half + 1}, len(HARDENING_HALF_LENGTHS) * n,
                                 component="ballast")  # fmt: skip


def _whole_track_candidates(case):
    """Effects of the whole track.

    Common values of the base model bend first to hide them: they are tested on hammer tests whatever the residual.
    """

    def everywhere(term, starts, **more):
        return _candidate(term, lambda p: term(**p), starts, always=term.name, **more)

    yield everywhere(physics.PadTemperature, ((0.01,),))
    if case.aligned_passages:
        yield _candidate(physics.PadPreload, lambda p: physics.PadPreload(**p), ((3e3,),))
    yield everywhere(physics.ZenerPad, ((0.4,),))
    rail = case.nominal.turnout.track.rail
    file_flexibility = 0.0 if rail.beam == "euler" else 1e9 / rail.shear_stiffness
    yield everywhere(
        physics.RailShear,
        ((1.5,), (3.5,), (6.0,), (9.0,), (-1.5,)),
        nonlinear_in_size=True,
        masking_parameter="rail_shear",
        masking_sd=0.5,
        from_masking=lambda v: file_flexibility * np.expm1(-v),
    )
    yield everywhere(physics.BallastInertia, ((120.0, 0.0),))
    yield everywhere(physics.SleeperMode, tuple((0.25, f) for f in BENDING_FREQUENCIES))


def _sensor_candidates(case):
    n = len(case.campaign.sensors)
    for sensor in case.campaign.sensors:
        name = sensor.name
        where = {"sensor": name}

        impact_pairs = tuple(pair.name for pair in case.frf_pairs.values() if pair.channel == name)  # hammer tests

        def per(term, starts, name=name, where=where, **more):
            return _candidate(term, lambda p: term(name, **p), starts, where, n, **more)

        yield per(physics.SensorGain, ((0.8,), (1.25,), (-1.0,)), masking_parameter=f"gain_{name}", masking_sd=0.3,
                  from_masking=lambda gain: 1.0 + gain, model_error_share=EXACT_ERROR_SHARE, exact=True,
                  must_not_oppose=impact_pairs)  # fmt: skip
        yield per(
            physics.MountResonance,
            tuple((1.0 / f, 5.0) for f in MOUNT_FREQUENCIES),
            nonlinear_in_size=True,
            component="channel",
        )
        yield per(
            physics.TimeOffset,
            tuple((sign * d,) for d in DELAY_STARTS for sign in (1.0, -1.0)),
            nonlinear_in_size=True,
            model_error_share=EXACT_ERROR_SHARE,
            exact=True,
            component="channel",
        )
        yield per(
            physics.SensorPosition,
            ((0.15,), (-0.15,), (0.4,), (-0.4,)),
            sign_ambiguous=True,
            masking_parameter=f"seat_{name}",
            masking_sd=0.3,
            from_masking=float,
            exact=True,
        )
        yield per(physics.LowPass, ((1 / 500.0,),), component="channel")
        yield per(physics.HighPass, ((12.0,),), min_significance=1.0)
        if case.aligned_passages:
            yield per(
                physics.ClockDrift,
                tuple((sign * d,) for d in DRIFT_STARTS for sign in (1.0, -1.0)),
                nonlinear_in_size=True,
                must_reach_control_level=True,
            )
            peak = case.band_peak(name)
            if peak > 0.0:
                yield from _clipping_candidates(per, peak, case.raw_peak(name))
                smallest = case.settings.materiality * peak
                yield per(physics.Hum, ((0.1 * peak, 0.0),), smallest_reportable=smallest, n_size_parameters=2)
    for name, estimate in case.saturated.items():
        yield _saturation_candidate(name, estimate)


def _clipping_candidates(per, peak, raw_peak):
    """A clipping limit below the channel's peak in the band [m/s²].

    At twice that peak it has no effect; it is never below a value that the channel has recorded.
    """
    lowest, unlimited = MIN_SIDE_RATIO * raw_peak, 2.0 * peak
    if lowest >= unlimited:
        return
    limit = replace(
        physics.Clipping.parameters[0], neutral=unlimited, bounds=(lowest, unlimited), prior=(peak, 0.4 * peak)
    )
    starts = tuple((lowest + share * (unlimited - lowest),) for share in CLIPPING_SHARES)
    yield replace(per(physics.Clipping, starts, model_error_share=0.0, nonlinear_in_size=True), parameters=(limit,))


def _saturation_candidate(name, estimate):
    """A saturated channel, which is not used; its limit is known from the peaks, not from a fit."""
    limit = replace(physics.Clipping.parameters[0], prior=(estimate.limit, LIMIT_SD * estimate.limit))
    return Candidate(
        physics.Clipping.name, (limit,), lambda p: physics.Clipping(name, **p), ((estimate.limit,),),
        {"sensor": name}, physics.Clipping.frame, promise=estimate.gain, external_evidence=estimate.gain,
    )  # fmt: skip


def _surface_candidates(case):
    if not case.aligned_passages:
        return
    positions = [s.place for s in case.campaign.sensors]
    grid = np.arange(min(positions) - 1.8, max(positions) + 1.81, DIP_STEP)
    for x in grid:
        where = {"place": round(float(x), 3)}
        starts = ((6e-4, 0.5, 0.5, 0.0), (-4e-4, 0.5, 0.5, 0.0))
        yield _candidate(physics.SurfaceDip, lambda p, x=float(x): physics.SurfaceDip(x, **p), starts, where, grid.size)
    for length in (0.3, 0.6):
        low, high = min(positions) - 3.0, max(positions) + 3.0
        yield _candidate(physics.RailCorrugation,
                         lambda p, a=low, b=high: physics.RailCorrugation(a, b, **p),
                         ((3e-5, 0.0, length),), {"wavelength": length}, 4)  # fmt: skip


def _wheel_candidates(case):
    if not case.aligned_passages:
        return
    yield _candidate(physics.ContactStiffness, lambda p: physics.ContactStiffness(**p), ((0.5,),))
    for train in case.trains:
        where = {"train": train}
        yield _candidate(
            physics.UnsprungMass,
            lambda p, t=train: physics.UnsprungMass(train=t, **p),
            ((1.4,), (0.7,)),
            where,
            len(case.trains),
            masking_parameter=f"wheels_{train}",
            masking_sd=0.3,
        )


MASS_STARTS = (0.65, 1.3, 1.6, 2.0)  # times the mass of the file: the P2 frequency changes by an eighth


def distant_mass_starts(case, fit):
    """(candidate, start) of masses to simulate, for trains whose residual exceeds the control level."""
    level = case.control_level["passage"]
    candidates = [c for c in case.candidates if c.family == "unsprung_mass"]
    excessive = [c for c in candidates if residual_of_train(case, fit, c.where["train"]) > level]
    return [(c, (mass,)) for c in excessive for mass in MASS_STARTS]


def residual_of_train(case, fit, train):
    """Weighted mean square residual of ``fit`` in the passages of a train; 0 without one."""
    squares = [
        (o.n_effective, o.effective * float(np.sum(np.square(w))))
        for o, w in zip(case.observations, fit.white)
        if o.name in case.aligned_passages and case.conditions_of(case.aligned_passages[o.name])["train"] == train
    ]
    return sum(total for _, total in squares) / sum(n for n, _ in squares) if squares else 0.0
