"""Candidates of a turnout: every effect of the catalogue at every position where it may act.

Wheelsets with a mass far from that of the file are simulated, since a derivative does not extend that far. The P2
resonance goes as the inverse root of the unsprung mass. Where it has moved by more than its width, a few per cent more
mass make the fit worse, and the derivative points the wrong way.
"""

from dataclasses import replace

import numpy as np

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.turnout.saturation import LIMIT_SD, UNLIKE_SIDES

LOOSE = 0.15  # error of an effect's size by its form; nine of another simulator: median 0.12
EXACT = 0.03  # the same of gains and delays; ten of another simulator: median 0.01
GAPS = (1.3e-4, 3e-4, 7e-4, 1.6e-3)  # m; a train closes the first at once and the last never
SEATED = (0.0, 0.4)  # share of the ballast that still bears
MOUNTINGS = tuple(np.geomspace(150.0, 1500.0, 12))  # Hz, one half-power width apart at Q = 5
DELAYS = (1e-4, 2.5e-4, *np.arange(5e-4, 5.6e-3, 5e-4))  # s, a quarter period at 500 Hz apart
LIMITS = (0.05, 0.2, 0.5)  # from the largest recorded value (0) to twice the band's peak (1)
DRIFTS = (2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)  # relative; a train passes within some seconds
RINGING = tuple(np.geomspace(90.0, 500.0, 6))  # Hz; an attached mass acts over half an octave
BENDING = tuple(np.geomspace(85.0, 760.0, 20))  # Hz, two widths of the resonance apart
DIP_STEP = 0.6  # m, between dip positions; the shift parameter covers positions in between
# Smallest size that is reported, in the unit of the first parameter: a smaller effect needs no action.
LEAST = {
    "high_pass": 2.0, "sensor_gain": 0.04, "sensor_position": 0.05, "time_offset": 5e-5, "clock_drift": 2e-4,
    "local_pad": 0.15, "local_ballast": 0.15, "hanging_sleeper": 5e-5, "surface_dip": 3e-5, "pad_temperature": 1e-3,
    "unsprung_mass": 0.07, "contact_stiffness": 0.1, "rail_shear": 0.9, "mount_resonance": 1 / 2000.0,
    "zener_pad": 0.1, "dry_friction": 500.0, "attached_resonator": 5.0,
    "ballast_hardening": 0.3, "pad_preload": 500.0, "low_pass": 1 / 2000.0, "sleeper_mode": 0.05,
    "ballast_inertia": 20.0,
}  # fmt: skip
STRETCHES = (1, 2, 4)  # sleepers to either side that harden alike
LIMIT = {"local_ballast": "hanging_sleeper"}  # ballast without stiffness acts as a gap that no train closes


def library(case, families=None):
    """All candidates of a case, or those of some ``families``."""
    found = [*_supports(case), *_whole_track(case), *_sensors(case), *_surface(case), *_wheels(case)]
    return tuple(c for c in found if families is None or c.family in families)


def _candidate(term, make, starts, where=None, scanned=1, base=True, parameters=None, always="", **more):
    chosen = tuple(p for p in term.parameters if parameters is None or p.name in parameters)
    frame = getattr(term, "frame", "place")
    return Candidate(
        term.name, chosen, make, starts, where or {}, frame, scanned, base, always,
        **{"loose": LOOSE, "least": LEAST.get(term.name, 0.0), **more},
    )  # fmt: skip


def _supports(case):
    """One candidate per effect and support of the zone's ``effect_supports``."""
    places, n = case.track().support, len(case.zone.asked)
    for j in case.zone.asked:  # ballast first: a hanging sleeper looks like soft ballast to a hammer
        where = {"sleeper": j, "place": round(float(places[j]), 3)}
        for term, alike in ((physics.LocalBallast, "ballast"), (physics.LocalPad, "pad")):
            yield _candidate(term, lambda p, j=j, t=term: t(j, **p), ((0.4,), (2.5,)), where, n, always=alike,
                             twin=f"{alike}_{j}", kin=alike, limit=LIMIT.get(term.name, ""))  # fmt: skip
        yield _candidate(physics.HangingSleeper, lambda p, j=j: physics.HangingSleeper(j, **p),
                         tuple((g, s) for s in SEATED for g in GAPS), where, n, base=False,
                         always="ballast", kin="ballast", plain=("local_ballast", 1),
                         open_as="local_ballast")  # fmt: skip
        yield _candidate(physics.AttachedResonator, lambda p, j=j: physics.AttachedResonator(j, **p),
                         tuple((15.0, f, 0.03) for f in RINGING), where, n, sure=1.0)  # fmt: skip
        if case.rollings:  # for impacts of one force friction is a damper: only trains distinguish it
            yield _candidate(physics.DryFriction, lambda p, j=j: physics.DryFriction(j, **p), ((1500.0,),), where, n,
                             told_by="passage")  # fmt: skip
        for half in STRETCHES if case.rollings else ():
            if case.zone.first <= j - half and j + half <= case.zone.last:
                yield _candidate(physics.BallastHardening,
                                 lambda p, a=j - half, b=j + half: physics.BallastHardening(a, b, **p), ((2.0,),),
                                 {**where, "sleepers": 2 * half + 1}, len(STRETCHES) * n,
                                 kin="ballast")  # fmt: skip


def _whole_track(case):
    """Effects of the whole track.

    Common values of the base model bend first to hide them: they are tested on hammer tests whatever the residual.
    """

    def everywhere(term, starts, **more):
        return _candidate(term, lambda p: term(**p), starts, always=term.name, **more)

    yield everywhere(physics.PadTemperature, ((0.01,),))
    if case.rollings:
        yield _candidate(physics.PadPreload, lambda p: physics.PadPreload(**p), ((3e3,),))
    yield everywhere(physics.ZenerPad, ((0.4,),))
    rail = case.nominal.turnout.track.rail
    own = 0.0 if rail.beam == "euler" else 1e9 / rail.shear_stiffness
    yield everywhere(physics.RailShear, ((1.5,), (3.5,), (6.0,), (9.0,), (-1.5,)), whole=True,
                     twin="rail_shear", twin_sd=0.5, from_twin=lambda v: own * np.expm1(-v))  # fmt: skip
    yield everywhere(physics.BallastInertia, ((120.0, 0.0),))
    yield everywhere(physics.SleeperMode, tuple((0.25, f) for f in BENDING))


def _sensors(case):
    n = len(case.campaign.sensors)
    for sensor in case.campaign.sensors:
        name = sensor.name
        where = {"sensor": name}

        struck = tuple(pair.name for pair in case.pairs.values() if pair.channel == name)  # hammer tests

        def per(term, starts, name=name, where=where, **more):
            return _candidate(term, lambda p: term(name, **p), starts, where, n, **more)

        yield per(physics.SensorGain, ((0.8,), (1.25,), (-1.0,)), twin=f"gain_{name}", twin_sd=0.3,
                  from_twin=lambda gain: 1.0 + gain, loose=EXACT, exact=True,
                  unopposed=struck)  # fmt: skip
        yield per(physics.MountResonance, tuple((1.0 / f, 5.0) for f in MOUNTINGS), whole=True, kin="channel")
        yield per(physics.TimeOffset, tuple((sign * d,) for d in DELAYS for sign in (1.0, -1.0)), whole=True,
                  loose=EXACT, exact=True, kin="channel")  # fmt: skip
        yield per(physics.SensorPosition, ((0.15,), (-0.15,), (0.4,), (-0.4,)), even=True,
                  twin=f"seat_{name}", twin_sd=0.3, from_twin=float, exact=True)  # fmt: skip
        yield per(physics.LowPass, ((1 / 500.0,),), kin="channel")
        yield per(physics.HighPass, ((12.0,),), sure=1.0)
        if case.rollings:
            yield per(physics.ClockDrift, tuple((sign * d,) for d in DRIFTS for sign in (1.0, -1.0)), whole=True,
                      leaves_nothing=True)  # fmt: skip
            peak = case.peak(name)
            if peak > 0.0:
                yield from _clipping(per, peak, case.highest(name))
                least = case.settings.materiality * peak
                yield per(physics.Hum, ((0.1 * peak, 0.0),), least=least, sized=2)
    for name, ceiling in case.ceilings.items():
        yield _clipped(name, ceiling)


def _clipping(per, peak, highest):
    """A clipping limit below the channel's peak in the band [m/s²].

    At twice that peak it has no effect; it is never below a value that the channel has recorded.
    """
    least, none = UNLIKE_SIDES * highest, 2.0 * peak
    if least >= none:
        return
    limit = replace(physics.Clipping.parameters[0], neutral=none, bounds=(least, none), prior=(peak, 0.4 * peak))
    starts = tuple((least + share * (none - least),) for share in LIMITS)
    yield replace(per(physics.Clipping, starts, loose=0.0, whole=True), parameters=(limit,))


def _clipped(name, ceiling):
    """A saturated channel, which is not used; its limit is known from the peaks, not from a fit."""
    limit = replace(physics.Clipping.parameters[0], prior=(ceiling.limit, LIMIT_SD * ceiling.limit))
    return Candidate(
        physics.Clipping.name, (limit,), lambda p: physics.Clipping(name, **p), ((ceiling.limit,),),
        {"sensor": name}, physics.Clipping.frame, promise=ceiling.gain, aside=ceiling.gain,
    )  # fmt: skip


def _surface(case):
    if not case.rollings:
        return
    places = [s.place for s in case.campaign.sensors]
    grid = np.arange(min(places) - 1.8, max(places) + 1.81, DIP_STEP)
    for x in grid:
        where = {"place": round(float(x), 3)}
        starts = ((6e-4, 0.5, 0.5, 0.0), (-4e-4, 0.5, 0.5, 0.0))
        yield _candidate(physics.SurfaceDip, lambda p, x=float(x): physics.SurfaceDip(x, **p), starts, where, grid.size)
    for length in (0.3, 0.6):
        low, high = min(places) - 3.0, max(places) + 3.0
        yield _candidate(physics.RailCorrugation,
                         lambda p, a=low, b=high: physics.RailCorrugation(a, b, **p),
                         ((3e-5, 0.0, length),), {"wavelength": length}, 4)  # fmt: skip


def _wheels(case):
    if not case.rollings:
        return
    yield _candidate(physics.ContactStiffness, lambda p: physics.ContactStiffness(**p), ((0.5,),))
    for train in case.trains:
        where = {"train": train}
        yield _candidate(physics.UnsprungMass, lambda p, t=train: physics.UnsprungMass(train=t, **p),
                         ((1.4,), (0.7,)), where, len(case.trains), twin=f"wheels_{train}", twin_sd=0.3)  # fmt: skip


MASSES = (0.65, 1.3, 1.6, 2.0)  # times the mass of the file: the P2 frequency changes by an eighth


def distant_wheels(case, fit):
    """(candidate, start) of masses to simulate, for trains whose residual exceeds the control level."""
    level = case.control_level["passage"]
    heavy = [c for c in case.candidates if c.family == "unsprung_mass"]
    loud = [c for c in heavy if left_by(case, fit, c.where["train"]) > level]
    return [(c, (mass,)) for c in loud for mass in MASSES]


def left_by(case, fit, train):
    """Weighted mean square residual of ``fit`` in the passages of a train; 0 without one."""
    mine = [
        (o.n_effective, o.effective * float(np.sum(np.square(w))))
        for o, w in zip(case.observations, fit.white)
        if o.name in case.rollings and case.said(case.rollings[o.name])["train"] == train
    ]
    return sum(left for _, left in mine) / sum(n for n, _ in mine) if mine else 0.0
