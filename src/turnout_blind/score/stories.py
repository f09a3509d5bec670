"""Cases told: what was concealed, what could be heard of it, what was said, and what it was worth."""

from pathlib import Path

import numpy as np

from turnout_blind.campaign import stage
from turnout_blind.effect import load_effects
from turnout_blind.march import STEP
from turnout_blind.record import RATE, passage_motion, sensor_places
from turnout_blind.reveal import revealed
from turnout_blind.run import strike
from turnout_blind.score.answers import answers_of
from turnout_blind.score.judged import judge
from turnout_blind.score.pictures import changes, furthest, outcome, pyplot, save, spectrum
from turnout_blind.strata import CasePlan


def choose(judged):
    """Ids of three cases: the least plain single named rightly, two effects, and the plainest failure."""
    right = [j for j in judged if j.stratum == "single" and j.clear and outcome(j) == "right"]
    double = [j for j in judged if j.stratum == "double"]
    failed = [j for j in judged if j.kinds and j.clear and outcome(j) in ("wrong", "none", "unknown")]
    failed = [j for j in failed if j.stratum in ("single", "double") or j.wrong]
    found = [min(right, key=lambda j: j.gain)] if right else []
    found += [max(double, key=lambda j: (sum(h == "named" for h in j.hits), j.gain))] if double else []
    found += [max(failed, key=lambda j: (bool(j.wrong), j.gain))] if failed else []
    return list(dict.fromkeys(j.case for j in found))


def tell(out, folder, cases=None, more=None, oracle=None, effects=()):
    """Markdown of stories; a picture per case goes to ``folder``. ``cases``: ids, else three are chosen.

    The recordings without the effect are made by the generator from the seed that the truth holds.
    """
    truths, rows, _ = revealed(out)
    judged = {case: judge(truths[case], answers_of(rows[case]), more) for case in truths}
    parts = []
    for case in cases or choose(list(judged.values())):
        name = f"blind_story_{case}.svg"
        draw(
            truths[case],
            rows[case],
            (oracle or {}).get(case, (None, None))[1],
            Path(folder) / name,
            load_effects(*effects),
        )
        parts.append(f"### {_title(truths[case])}\n\n{words(truths[case], rows[case])}\n\n![{case}]({name})")
    return "\n\n".join(parts)


def _title(truth):
    return f"{truth['case']}: " + (" and ".join(e["kind"].replace("_", " ") for e in truth["effects"]) or "nothing")


def words(truth, rows):
    """Concealed and said, in sentences."""
    concealed = "; ".join(
        f"{e['kind'].replace('_', ' ')} ({_numbers({**e['where'], **e['parameters']})})" for e in truth["effects"]
    )
    seen = truth["visible"]
    said = " ".join(f"*{_said(row)}*" for row in rows) if rows else "*no answer*"
    return (
        f"Concealed: {concealed or 'nothing'}. It makes up {seen['hammer_pct']:.0f} % of the blows' and "
        f"{seen['passage_pct']:.0f} % of the passages' response at the sensor that shows it most. Said: {said}"
    )


def _said(row):
    sure = row.get("probability")
    told = row.get("sentence") or row.get("term") or ""
    return f"{row['verdict'].replace('_', ' ')}{'' if sure is None else f' (probability {sure:.2f})'}: {told}"


def _numbers(held):
    return ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in held.items())


def draw(truth, rows, oracle, path, effects):
    """With and without the effect, blow and train; the track with what was there and what was said; the fits."""
    plt = pyplot()
    plan = CasePlan(truth["stratum"], tuple((e["kind"], e["rung"]) for e in truth["effects"]), tuple(truth["seed"]))
    _, site, world, _ = stage(plan, effects)
    figure, axes = plt.subplots(2, 2, figsize=(8.5, 5.6), layout="constrained")
    for axis, (title, before, after, top, window) in zip(axes[0], (_blow(site, world), _train(site, world))):
        k = furthest(before, after)
        for signals, label in ((before, "without"), (after, "with")):
            f, density = spectrum(signals, RATE, window)
            axis.semilogy(f, np.sqrt(density[k]), lw=1, label=f"{label} the effect")
        axis.set_xlim(0.0, top)
        inside = (f > 5.0) & (f < top)
        axis.set_ylim(bottom=0.3 * np.sqrt(density[k][inside].min()))
        axis.set_title(f"{title}, sensor {site.names()[k]}", fontsize=9)
        axis.set_xlabel("frequency [Hz]")
    axes[0, 0].set_ylabel("acceleration [m/s²/√Hz]")
    axes[0, 0].legend()
    _map(axes[1, 0], truth, rows, site)
    _bars(axes[1, 1], rows, oracle)
    return save(figure, path)


def _blow(site, world):
    """(title, without, with, top [Hz], window) of a blow at the place whose sensors show the effect most."""

    def sides(place):
        for w in (site.world, world):
            warm = site.temperatures[1]
            _, a, _ = strike(w, sensor_places(site, w), place, [0.005], [0.95], 0.25, warm, tip=site.tip)
            yield _shown(site, w, a, "hammer")

    place, before, after = _plainest((x, *sides(x)) for x in site.blows)
    return f"a blow at {place:.1f} m", before, after, 900.0, "boxcar"


def _train(site, world):
    """(title, without, with, top [Hz], window) of the passage whose sensors show the effect most."""

    def sides(k):
        for w in (site.world, world):
            yield _shown(site, w, passage_motion(site, w, k, np.random.default_rng(k)), "passage")

    k, before, after = _plainest((k, *sides(k)) for k in range(len(site.passages)))
    p = site.passages[k]
    return f"{p.train}, {3.6 * p.speed:.0f} km/h", before, after, 250.0, "hann"


def _plainest(shown):
    """The (what, without, with) that differs most."""
    return max(shown, key=lambda s: changes(*s[1:]).max())


def _shown(site, world, motion, kind):
    """Through the sensors' faults, as the recorder of a "hammer" test or a "passage" has it."""
    rows = []
    for x, chain in zip(motion, site.chains):
        for fault in world.channels.get(chain.name, ()):
            x = fault(kind, np.random.default_rng(0))(x, 1.0 / STEP)
        rows.append(x)
    return np.array(rows)


def _map(axis, truth, rows, site):
    """Sensors, blows, what was there (filled) and what was said (open) along the rail."""
    axis.set_xlim(min(site.sensors) - 2.5, max(site.sensors) + 2.5)
    axis.plot(site.sensors, np.zeros(len(site.sensors)), "^", color="0.4", label="sensor")
    axis.plot(site.blows, np.zeros(len(site.blows)), "v", color="0.7", label="blow")
    for name, x in zip(site.names(), site.sensors):
        axis.annotate(name, (x, 0.0), xytext=(0, -14), textcoords="offset points", ha="center", fontsize=8)
    for effect in truth["effects"]:
        x = effect["where"].get("position", truth["sensors"].get(effect["where"].get("sensor")))
        if x is not None:
            axis.plot(x, 1.0, "o", color="black")
            _note(axis, x, 1.0, effect["kind"])
    for row in rows or ():
        x = row.get("position_m")
        x = truth["sensors"].get(row.get("channel")) if x is None else x
        if x is not None:
            axis.plot(x, 2.0, "o", mfc="none", color="C3")
            _note(axis, x, 2.0, str(row.get("term") or row["verdict"]))
    axis.set_yticks([0, 1, 2], ["track", "concealed", "said"])
    axis.set_ylim(-0.8, 3.2)
    axis.set_xlabel("place [m]")
    axis.legend(loc="upper left", ncols=2, fontsize=7)


def _note(axis, x, y, words):
    """Beside the point, towards the middle of the axis."""
    low, high = axis.get_xlim()
    side = "right" if x > 0.5 * (low + high) else "left"
    axis.annotate(words.replace("_", " "), (x, y), xytext=(-5 if side == "right" else 5, 5),
                  textcoords="offset points", fontsize=8, ha=side)  # fmt: skip


def _bars(axis, rows, oracle):
    """Held-out fits."""
    row = (rows or [{}])[0]
    found = {name: row.get(f"fit_{name}_pct") for name in ("before", "decoy", "rival", "after")} | {"oracle": oracle}
    found = {name: value for name, value in found.items() if value is not None}
    axis.barh(list(found), list(found.values()), color="C0")
    axis.set_xlabel("fit on recordings never used [%]")
    if not found:
        axis.text(0.5, 0.5, "no fit was given", ha="center", transform=axis.transAxes)
