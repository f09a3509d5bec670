"""Where what is missing acts, when it has no name: place, channel, wheel or clock, from independent witnesses."""

from dataclasses import dataclass, field, replace

from turnout.mismatch.spaces import weigh

HEARD = 6.0  # nats that blows must add before a channel is blamed: what is wrong with it is wrong in blows, too
AS_GOOD = 6.0  # nats within which places are not told apart: odds of 400 to 1, a model's errors taken off
EXPLAINS = 0.25  # share of the excess from which a refused candidate is heard as a witness


@dataclass(frozen=True)
class Whereabouts:
    """``frame`` and ``level`` of the strongest witness with its evidence ``nats``; ``place`` with its interval ``low``
    to ``high`` [m], ``sensor``, ``train`` and ``axle`` where it has them; ``others`` frame -> nats of the next best;
    ``measured`` first and last place of sensors and blows [m]: beyond them nothing tells one place from another."""

    frame: str
    level: object
    nats: float
    place: float | None = None
    low: float | None = None
    high: float | None = None
    sensor: str | None = None
    train: str | None = None
    axle: int | None = None
    others: dict = field(default_factory=dict)
    measured: tuple = (float("-inf"), float("inf"))

    def __str__(self):
        if self.place is not None and not self.measured[0] <= self.place <= self.measured[1]:
            before = self.place < self.measured[0]
            end = self.measured[0] if before else self.measured[1]
            return f"{'before' if before else 'beyond'} {end:.1f} m, how far cannot be told"
        if self.place is not None:
            return f"at {self.place:.1f} m, between {self.low:.1f} and {self.high:.1f} m"
        if self.axle is not None:
            return f"on axle {self.axle} of {self.train}"
        if self.frame == "train":
            return f"on {self.train}"
        if self.frame == "sensor":
            return f"in channel {self.sensor}"
        if self.frame == "clock":
            return f"in recording {self.level}, whatever the wheels do"
        return {"frequency": "along the whole track", "condition": f"in the tests of {self.level}"}.get(
            self.frame, f"locked to {self.frame} {self.level}"
        )


def whereabouts(case, fit, refused=None, cause=""):
    """Whereabouts of what ``fit`` leaves; ``refused`` is the Score of the best candidate that got no name, or None.

    Where recordings that were not fitted are the ``cause`` of the verdict, they say where. None where the case has no
    spaces to look into, or none of them holds more than sound recordings leave.
    """
    if cause == "clock":
        names = ", ".join(d.name for d in case.disturbed)
        return Whereabouts("clock", names, max(d.louder for d in case.disturbed))
    if cause == "train":
        return Whereabouts("train", case.foreign[0], 0.0, train=case.foreign[0])
    floor = {o.kind: case.control_level.get(o.kind, 1.0) for o in case.observations}
    witnesses = sorted(_alone(case, weigh(case, fit, floor)), key=lambda w: -w.nats)
    heard = refused is not None and refused.explained >= EXPLAINS
    if heard and (not witnesses or refused.gain > witnesses[0].nats):
        return replace(_of_candidate(refused), measured=case.measured)
    return replace(_of_witnesses(witnesses), measured=case.measured) if witnesses else None


def _alone(case, witnesses):
    """Witnesses that are heard: what a wheel shows less what the wheels of other trains show, which is the rail's; a
    channel where blows, if any, say so too."""
    blows = {o.name for o in case.observations if case.cheap(o)}
    for w in witnesses:
        nats = w.nats
        if w.frame == "wheel":
            nats -= max((v.nats for v in witnesses if v.frame == "wheel" and v.level[0] != w.level[0]), default=0.0)
        if w.frame == "sensor" and blows and sum(w.by.get(name, 0.0) for name in blows) < HEARD:
            continue
        if nats > 0.0:
            yield replace(w, nats=nats)


def _of_candidate(score):
    where = score.candidate.where
    place = where.get("place")
    return Whereabouts(
        score.candidate.frame, score.candidate.key, score.gain, place, place, place, where.get("sensor"),
        where.get("train"), where.get("axle"),
    )  # fmt: skip


def _of_witnesses(witnesses):
    best, others = witnesses[0], {}
    for w in witnesses:
        others.setdefault(w.frame, w.nats)
    told = {"others": {k: round(v, 1) for k, v in others.items() if k != best.frame}}
    if best.frame == "place":
        near = [w.level for w in witnesses if w.frame == "place" and best.nats - w.nats < AS_GOOD]
        told |= {"place": best.level, "low": min(near), "high": max(near)}
    elif best.frame == "wheel":
        told |= {"train": best.level[0], "axle": best.level[1]}
    elif best.frame in ("sensor", "train"):
        told[best.frame] = best.level
    return Whereabouts(best.frame, best.level, best.nats, **told)
