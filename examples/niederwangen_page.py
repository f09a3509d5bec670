"""The page about Bern-Niederwangen: its tables, its picture and its fixed text."""

import numpy as np
from examples.decay_case import CHANGES, DIRECTIONS, Change
from examples.decay_model import BANDS
from examples.niederwangen import DAMPING_EFFECTS, LEFT_OUT_CAMPAIGNS, bands_changed, conclusion
from examples.recorded import plotting, save, table


def what_in_words(names):
    """What the names have in common, and whether a single one remains."""
    texts = {name: CHANGES[name][0] for name in names}
    if not names:
        return "nothing"
    if set(names) <= DAMPING_EFFECTS:
        alternatives = " or ".join(texts.values())
        also = "" if len(names) == 1 else "; not distinguished"
        return f"**added: damping of the rail** ({alternatives}{also})"
    return "open: " + " or ".join(texts.values())


def band_words(changes):
    """Bands whose mean factor over all later campaigns exceeds three standard deviations."""
    texts = []
    for direction, (factor, sd) in changes.items():
        mean = factor.mean(axis=0)
        bands = [f"{b:.0f} (×{np.exp(m):.1f})" for b, m, s in zip(BANDS, mean, sd) if abs(m) > 3.0 * s]
        if bands:
            texts.append(f"{direction} {', '.join(bands)}")
    return "; ".join(texts) or "none"


def section_rows(measured, results):
    """A row per section: conclusion, date, change, bands, and the fits on campaigns left out."""
    for m in measured:
        priors, runs, by_date = results[m.section]
        answer, names = conclusion(runs)
        gains = by_date[LEFT_OUT_CAMPAIGNS[0]]
        when = max(gains, key=gains.get) if gains else None
        date = f"after {m.campaigns[m.campaigns.index(when) - 1]}, by {when}" if when else "–"
        change = what_in_words(names) if answer == "changed" else "–" if answer == "not changed" else "**left open**"
        yield [m.section, f"**{answer}**", date, change, band_words(bands_changed(m, priors)), *_fits(runs)]


def _fits(runs):
    for _, d in runs.values():
        v = d.verification
        after = "–" if v.after is None else f"{v.after:.0f}"
        rival = "–" if v.rival is None else f"{v.rival:.0f}"
        yield f"{v.before:.0f} → {after} (rival {rival})"


def term_rows(measured, results):
    """A row per section, run and model: gain, level, parameters."""
    for m in measured:
        for campaign, (_, d) in results[m.section][1].items():
            for score in d.verdict.scores[:4]:
                change = Change(score.family, score.candidate.where["since"], tuple(score.fit.psi[-_n(score) :]))
                yield [
                    m.section, campaign, score.family.replace("_", " "), f"{score.gain:z.0f}", f"{score.explained:.0%}",
                    numbers(change, score.fit.psi_se[-_n(score) :]),
                ]  # fmt: skip


def _n(score):
    return len(score.candidate.parameters)


def numbers(change, errors):
    """Parameters of a change with 95 % intervals, frequencies in Hz."""
    texts = [f"by {change.since}"]
    for p, value, se in zip(CHANGES[change.family][1], change.amounts, errors):
        if p.unit == "ln(Hz)":
            texts.append(f"{p.name} {np.exp(value):.0f} Hz (×/÷ {np.exp(1.96 * se):.2f})")
        elif p.name == "log_factor":
            texts.append(f"factor {np.exp(value):.2f} (×/÷ {np.exp(1.96 * se):.2f})")
        else:
            texts.append(f"{p.name} {value:.3g} ± {1.96 * se:.2g} {p.unit}".removesuffix(" -"))
    return ", ".join(texts)


def date_rows(measured, results):
    """A row per section with a change: gain of the leading change at each date."""
    for m in measured:
        _, runs, gains = results[m.section]
        for campaign, (_, d) in runs.items():
            if gains[campaign]:
                text = ", ".join(f"by {c}: {g:z.0f}" for c, g in gains[campaign].items())
                yield [m.section, campaign, d.verdict.scores[0].family.replace("_", " "), text]


def draw(measured, results, path):
    """Draw recorded over calibrated decay rates per band and campaign, with the leading change."""
    plt = plotting()
    figure, axes = plt.subplots(len(measured), 2, figsize=(9, 11), sharex=True, sharey=True, layout="constrained")
    x = np.arange(BANDS.size)
    for row, m in zip(axes, measured):
        priors, runs, _ = results[m.section]
        case, d = runs[LEFT_OUT_CAMPAIGNS[0]]
        changes = bands_changed(m, priors)
        for axis, direction in zip(row, DIRECTIONS):
            factor, sd = changes[direction]
            axis.fill_between(x, np.exp(-2.0 * sd), np.exp(2.0 * sd), color="0.85", lw=0, label="±2 sd")
            for values, campaign, mark in zip(factor, m.campaigns[1:], "ovs"):
                axis.plot(x, np.exp(values), mark, ms=3, label=campaign)
            answer = conclusion(runs)[0]
            if answer == "changed":
                answer += f", {_draw_term(axis, x, case, d, direction)}"
            axis.set_yscale("log")
            axis.set_title(f"{m.section} {direction}: {answer}", fontsize=9)
        row[0].set_ylabel("recorded / calibrated")
    for axis in axes[-1]:
        axis.set_xticks(x[::2], [f"{b:.0f}" for b in BANDS[::2]], rotation=60)
        axis.set_xlabel("third-octave band [Hz]")
    keys = {label: line for axis in axes.flat for line, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(keys.values(), keys.keys(), loc="outside upper center", ncols=len(keys), fontsize=8)
    save(figure, path)


def _draw_term(axis, x, case, diagnosis, direction):
    """Draw the factor of the leading change at the temperature of the left-out campaign; returns its name."""
    score, o = diagnosis.verdict.scores[0], next(r for r in case.reserved if r.data_type == direction)
    change = Change(score.family, score.candidate.where["since"], tuple(score.fit.psi[-_n(score) :]))
    with_it, without = (case.logarithm(score.fit.values, terms, o) for terms in ((change,), ()))
    axis.plot(x, np.exp(with_it - without), color="black", lw=1, label="the change that leads")
    return score.family.replace("_", " ")


PAGE = """# Bern-Niederwangen: what was changed at the track, by diagnosis

This page shows which change the diagnosis finds on a measured track.

*Made by `python -m examples.niederwangen [FOLDER]`; every number comes from that run. Measurements: repository
mic-haf/SDWirkungNi (SBB; Scossa-Romano and Oertli), CC0 1.0. What was done at the track is not in the folder and was
not looked up. `docs/niederwangen_decay_rate.md` evaluates the same measurements without a model.*

Track decay rates, vertical and lateral, in 18 third octaves, at five sections in four campaigns at 1 to 38 °C. The
track model is calibrated, section by section, on the first campaign alone. The diagnosis then seeks what it lacks
in the others, with {n_changes} changes as rivals, each possible from any later campaign on, and with the
dependence of pad stiffness and pad damping on temperature as free parameters. It runs twice: once
with 2015-09 (cool) and once with 2013-07 (hot) held out for the verification.

## Answer

{answers}

Fit: share of the variation over bands that is predicted of the campaign left out [%], in units of its errors, before →
after (best rival).
Bands: recorded over the calibrated model, mean of the later campaigns, beyond three standard deviations. A section
counts as changed only if both runs name something and both predict the held-out campaign better with it. It
counts as not changed if both answer "none".

![Recorded over calibrated, and the leading change](niederwangen_mismatch.svg)

## Rivals

{terms}

Gain: evidence over the calibrated model less the logarithm of the number of dates [nats]; a name needs 12.

{dates}

The same change at other dates: gain of the density with which campaigns are predicted from the others [nats], for
both runs. It depends on the date more than the evidence above, and is larger.

## How to read it

- **Named as far as the data allow.** The change raises the lateral decay rate many times over from 500 Hz up, where
  the fastening no longer holds the rail, and hardly changes it below: it dissipates energy of the rail itself. Other
  pads, damping of pads, ballast, sleepers or another way of measuring do not have this effect. Third octaves of
  the decay rate do not distinguish tuned masses from a damping layer: within the margin, both names are given. A
  loss factor of the rail of 0.1 would be a very thick layer and the masses found would be ordinary ones; that is
  engineering knowledge and does not follow from these data. A hammer test at one rail seat with 1 Hz resolution would
  distinguish them: a tuned mass splits the response near its frequency.
- **Temperature.** {warmth} A change is named on top of it, and holds at 24 to 38 °C when fitted at 1 to 15 °C.
- **What the model is.** A Timoshenko rail on discrete supports of the library's closed form; the meshed track of
  `turnout simulate` gives the same vertical decay rates within 4 %, but for the depth of the pinned-pinned line
  (`tests/blind/test_real_niederwangen.py`). Lateral: the same beam with the rail's lateral bending; it has no
  torsion and no bending of the web. Each band therefore has an error of the model of its own, the same in all
  campaigns (sd 0.5 of the logarithm to 1600 Hz, 1.0 above), estimated from the first campaign.
- **Noise.** From rail to rail {spread_v:.2f} vertical, {spread_l:.2f} lateral (median of the logarithm's sd); from
  section to section in the first campaign {repeat_v:.2f} and {repeat_l:.2f}, taken as the repeatability of one
  campaign, smooth over half an octave.
- **What stays open.** S3 rose in the cold campaign and fell back. With 2015-09 left out rail damping is named,
  by little (table); with 2013-07 left out nothing reaches 12 nats; and the campaign left out is predicted worse with
  it: no name is given. Another campaign in cold weather would decide.
- **What was changed after a first result.** Two things. The errors that bands share were first a share of independent
  bands (0.23) and became what the first campaign's sections show, after S5 had been run: with the former
  12 nats cannot be reached. The masses tuned an octave apart joined the library after all five had been run. The
  verdicts by section were the same before and after the latter; the rule for "changed" was written after
  the first had been run.
"""


def page(measured, results):
    """The page as text."""
    head = ["section", "", "when", "what", "bands (factor)", "fit, 2015-09 left out", "fit, 2013-07 left out"]
    warm = [results[m.section][1][LEFT_OUT_CAMPAIGNS[0]][1].fit.values for m in measured]
    soft, calm = ([100.0 * v[n] for v in warm] for n in ("softening", "calming"))
    spread = {d: float(np.median(measured[0].spread[d])) for d in DIRECTIONS}
    repeat = {d: float(np.median(measured[0].repeat[d])) for d in DIRECTIONS}
    return PAGE.format(
        n_changes=len(CHANGES),
        answers=table(head, section_rows(measured, results)),
        terms=table(["section", "left out", "change", "gain", "explained", "numbers"], term_rows(measured, results)),
        dates=table(["section", "left out", "change", "gain by date"], date_rows(measured, results)),
        warmth=f"Pads are found to soften by {min(soft):.1f} to {max(soft):.1f} % and their loss factor to change by "
        f"{-max(calm):+.1f} to {-min(calm):+.1f} % per kelvin, section by section.",
        spread_v=spread["vertical"], spread_l=spread["lateral"], repeat_v=repeat["vertical"],
        repeat_l=repeat["lateral"],
    )  # fmt: skip
