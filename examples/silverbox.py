"""Diagnose the Silverbox: a recorded oscillator with a cubic spring that is unknown to the base model.

python -m examples.silverbox [FOLDER]     writes docs/silverbox.md and its pictures; 10 CPU s

FOLDER holds SNLS80mV.csv. Every number in the page comes from the run; its text is fixed.
"""

import sys

import numpy as np
from examples.oscillator_case import LAWS, OscillatorCase
from examples.recorded import DOCS, folder_of, plotting, save, table

from turnout.mismatch import diagnose
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.latent_force import latent_law
from turnout.mismatch.engine.reserved_data import predict_reserved
from turnout.report.formatting import with_half_width

RATE = 1e7 / 2**14  # [Hz]
ARROW, START, LENGTH = 40000, 40650, 8692  # samples of the arrow; the first multisine and the length of each
FITTED, HELD_OUT = range(5), 8  # realisations of the multisine that are fitted, and the one that is reserved
PRIORS = {"frequency": (60.0, 30.0), "damping": (0.1, 0.1), "gain": (1.0, 1.0)}


def recordings(folder):
    """(recordings to fit, reserved recordings), each (name, condition, input, output).

    Five multisines are fitted; another one and the arrow are reserved.
    """
    u, y = np.loadtxt(folder / "SNLS80mV.csv", delimiter=",", skiprows=1, usecols=(0, 1)).T
    segments = [slice(START + k * LENGTH, START + (k + 1) * LENGTH) for k in range(10)]
    sines = [(f"multisine {k}", f"multisine {k}", u[p], y[p]) for k, p in enumerate(segments)]
    return [sines[k] for k in FITTED], [sines[HELD_OUT], ("arrow", "arrow", u[:ARROW], y[:ARROW])]


def case_of(folder, without=()):
    """The case: priors of a linear oscillator, an unknown sensor offset, and all laws but those in ``without``."""
    return OscillatorCase(*recordings(folder), RATE, **PRIORS, without=without)


def held_out(case, fit):
    """[(fit in percent, residual in mV)] of the reserved multisine and of the arrow."""
    predictions = predict_reserved(case, fit, case.reserved)
    missed = [1e3 * float(np.sqrt(np.mean((o.data - p) ** 2))) for o, p in zip(case.reserved, predictions)]
    return [(fit_percent([o], [p]), r) for o, p, r in zip(case.reserved, predictions, missed)]


def analyse(folder):
    """(case, diagnosis) of both runs: "without prior knowledge" has all laws, "law removed" lacks the right one."""
    cases = {"without prior knowledge": case_of(folder), "law removed": case_of(folder, ("cubic_spring",))}
    return {name: (case, diagnose(case)) for name, case in cases.items()}


def law_rows(case, diagnosis):
    """A row per model: the linear base, then the laws by held-out gain."""

    def fit_texts(fit):
        return [f"{percent:.1f} % ({missed:.2f} mV)" for percent, missed in held_out(case, fit)]

    yield ["linear base", "0", "", *fit_texts(diagnosis.base)]
    for score in diagnosis.scores or diagnosis.verdict.scores:
        amount = with_half_width(float(score.fit.psi[0]), 1.96 * float(score.fit.psi_se[0]), 3)
        yield [score.family.replace("_", " "), f"{score.gain:z.0f}", amount, *fit_texts(score.fit)]


def missing_force(case, fit):
    """Nonparametric law of the force that ``fit`` lacks."""
    latent = case.latent_covariates(fit)
    return latent_law(latent["force"], {k: latent[k] for k in ("displacement", "velocity", "time")}, latent["unit"])


def draw_latent(results, path):
    """Draw the missing force against displacement: without the right law, and after it was named."""
    plt = plotting()
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 3.6), sharey=True, layout="constrained")
    case, full = results["without prior knowledge"]
    reduced_case, reduced = results["law removed"]
    panels = (
        ("law removed: unknown", reduced_case, reduced.base),
        ("without prior knowledge: with the cubic spring", case, full.fit),
    )
    for axis, (title, of, fit) in zip(axes, panels):
        centre, force, error = missing_force(of, fit).curves["displacement"]
        axis.errorbar(1e3 * centre, 1e3 * force, 1.96e3 * error, fmt="o", ms=3, lw=1)
        fine, cubic = np.linspace(centre[0], centre[-1], 101), np.polyfit(centre, force, 3)
        axis.plot(1e3 * fine, 1e3 * np.polyval(cubic, fine), lw=1, label="a cubic through the points")
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("displacement [mV]")
    axes[0].set_ylabel("force that the model lacks [mV of spring]")
    axes[0].legend()
    save(figure, path)


def draw_arrow(case, diagnosis, path):
    """Draw the reserved arrow: its recording and the residuals of two models."""
    plt = plotting()
    arrow = case.reserved[1]
    figure, axis = plt.subplots(figsize=(8.5, 3.2), layout="constrained")
    edges = np.arange(0, arrow.data.size, 200)  # envelopes, since 40000 samples are too many to draw
    time = edges / RATE
    rows = {"recording": arrow.data}
    for name, fit in (("missed by the linear base", diagnosis.base), ("missed with the cubic spring", diagnosis.fit)):
        rows[name] = arrow.data - predict_reserved(case, fit, case.reserved)[1]
    for name, row in rows.items():
        axis.semilogy(time, 1e3 * np.maximum.reduceat(np.abs(row), edges), lw=1, label=name)
    axis.set_xlabel("time [s]")
    axis.set_ylabel("largest in 0.3 s [mV]")
    axis.set_ylim(top=1.25 * axis.get_ylim()[1])  # room for the legend
    axis.legend(loc="upper left", ncols=3)
    save(figure, path)


PAGE = """# A real oscillator, without prior knowledge: the Silverbox

This page shows that the diagnosis finds the nonlinear spring of a measured oscillator.

*Made by `python -m examples.silverbox [FOLDER]`; every number comes from that run. Recording: Wigren and Schoukens
2013, Three free data sets for development and benchmarking in nonlinear system identification; SNLS80mV.csv.*

An electronic circuit that behaves as a mass on a hardening spring. The diagnosis gets the data of a measuring
campaign (input, output, a linear second-order model with wide priors) and a library of {n_laws} laws, one of which
is right. It is fitted to five realisations of a multisine. Two recordings are reserved for the
verification: another multisine, and the *arrow*, a sweep that grows beyond whatever was fitted.

## Without prior knowledge

Answer: **{answer}: {names}**, grade {grade}, probability {probability:.3f}. {sentence}

| fit on the two reserved recordings together | |
|---|---|
| before (linear base) | {before:.1f} % |
| after | **{after:.1f} %** |
| best rival | {rival:.1f} % |
| decoy: a filter with as many free numbers | {decoy:.1f} % |

| bar | wanted | reached |
|---|---|---|
| the cubic law among at least 8 | yes | {cubic}, among {n_laws} |
| held-out multisine | >= 98 % | {sine:.1f} % |
| arrow, beyond the range | >= 96 % | {arrow:.1f} % |

{laws}

Gain: log predictive density of left-out realisations over the linear base, in nats. Amount: force at the scale of the
motion over the linear spring's, with its 95 % interval.

![What is missed of the arrow](silverbox_arrow.svg)

## With the right law taken out of the library

Answer: **{answer_2}** ({reason_2}). Nothing is named.
Best of the laws left: {best_2}, {best_fit}.
What is shown instead is the force that the linear model lacks, without a law: displacement explains {r2_y:.0%} of its
variance on stretches not used for it, velocity {r2_v:.0%}, time {r2_t:.0%}. It is odd and hardens - an engineer
reads a cubic spring from the left picture (the linear spring has taken the slope, so the curve falls in the middle).

![Missing force against displacement](silverbox_latent.svg)

Left: the library without the cubic law. Right: what is missing after the first run named it. That is even and not
nothing: the circuit is a little stiffer to one side. With the cubic spring the fit has reached the control level
(1 % of the recording), so the diagnosis stops there and does not name it.

## What it does not show

One oscillator with one effect: the diagnosis did not have to find a position, a train or a temperature.
`docs/blind.md` does that on simulated tracks, `docs/niederwangen_mismatch.md` on a real one. The offset of the sensor
is a nuisance parameter. Without it every law absorbs a part of the offset, and one-sided springs gain evidence
(`tests/published/test_mismatch_silverbox.py`).
"""


def page(results):
    """The page as text."""
    case, full = results["without prior knowledge"]
    reduced_case, reduced = results["law removed"]
    (sine, _), (arrow, _) = held_out(case, full.fit)
    best_score = reduced.verdict.scores[0]
    fits = held_out(reduced_case, best_score.fit)
    check, r2 = full.verification, missing_force(reduced_case, reduced.base).r2
    return PAGE.format(
        n_laws=len(LAWS), answer=full.verdict.answer, names=", ".join(full.names).replace("_", " "),
        grade=full.verdict.grade, probability=full.verdict.probability, before=check.before, after=check.after,
        sentence=" ".join(f"The linear model lacks an effect: {t.sentence()}." for t in full.fit.terms),
        rival=check.rival, decoy=check.decoy, cubic="yes" if full.names == ("cubic_spring",) else "no", sine=sine,
        arrow=arrow, answer_2=reduced.verdict.answer, reason_2=reduced.verdict.reason.replace("_", " "),
        best_2=best_score.family.replace("_", " "),
        best_fit=f"{fits[0][0]:.1f} % of the multisine and {fits[1][0]:.1f} % of the arrow",
        r2_y=r2["displacement"], r2_v=max(0.0, r2["velocity"]), r2_t=max(0.0, r2["time"]),
        laws=table(["model", "gain [nats]", "amount", "held-out multisine", "arrow"], law_rows(case, full)),
    )  # fmt: skip


def main(arguments):
    """Write the page and its pictures."""
    results = analyse(folder_of("nonlinear_silverbox", arguments))
    draw_latent(results, DOCS / "silverbox_latent.svg")
    draw_arrow(*results["without prior knowledge"], DOCS / "silverbox_arrow.svg")
    text = page(results)
    (DOCS / "silverbox.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main(sys.argv[1:])
