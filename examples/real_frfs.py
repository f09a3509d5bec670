"""Diagnose real hammer tests with models that are deliberately too simple: is the missing effect named or "unknown"?

python -m examples.real_frfs [FOLDER]     writes docs/real_frfs.md and its picture; 20 CPU s

FOLDER holds frf_beam_sdypy/ and hammer_pyfrf/. Every number in the page comes from the run; its text is fixed.
"""

import sys
from pathlib import Path

import numpy as np
from examples.frf_case import LAMBDA, FrfCase
from examples.recorded import DOCS, REPOSITORY, SHARED, plotting, save, table
from scipy import stats

from turnout.config.load import load_configuration
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch import diagnose
from turnout.mismatch.engine.reserved_data import predict_reserved
from turnout.readers import read

SETTINGS = MismatchSettings(base_iterations=40, iterations=40)  # sharp resonances need many iterations
MODES = (177.0, 477.0, 933.0, 1535.0, 2287.0)  # of the first beam, printed by its makers to 0.1 Hz
PRINTED_FREQUENCIES = (177.0, 477.4, 933.1, 1535.5, 2286.9, 3162.4, 4181.2)  # all that its makers print [Hz]
PEAKS = (99.0, 164.0, 242.0, 368.0, 447.0, 558.0, 731.0, 872.0, 1362.0)  # of the second, from its third impact
PUBLISHED = {477: (477.4, 0.20)}  # [Hz], [%]


def beam(folder):
    """(frequency (n_line,), accelerance (6 impacts, 7 sensors, n_line)) of the first beam."""
    f, h = np.load(Path(folder) / "frf_beam_sdypy" / "acc_data.npy", allow_pickle=True)
    return np.real(f).astype(float), np.asarray(h).astype(complex)


def beam_of_five_impacts(folder):
    """(frequency, accelerance (5 impacts, 1 sensor, n_line)) of the second beam, one line per hertz."""
    description = load_configuration(REPOSITORY / "examples" / "recordings_of_others").turnout("pyfrf_beam").hammer
    root = (Path(folder) / "hammer_pyfrf").resolve()
    recordings = read(root / "impact2_response0.lvm", root, description.descriptions["BEAM"]).recordings
    force, response = (np.fft.rfft([r.signal(n) for r in recordings]) for n in ("force", "acceleration"))
    frequency = np.fft.rfftfreq(recordings[0].n_sample, 1.0 / recordings[0].rate)
    used = slice(1, 8000)
    return frequency[used], (response[:, used] / force[:, used])[:, None, :]


def without(modes, removed):
    """``modes`` without one."""
    return tuple(m for m in modes if m != removed)


def cases(folder):
    """{title: (case, what was left out deliberately)}."""
    f, h = beam(folder)
    one = {"frequency": f, "h": h, "band": (100.0, 1200.0), "reserved": (5,), "step": 4}
    g, h2 = beam_of_five_impacts(folder)
    two = {"frequency": g, "h": h2, "band": (80.0, 1000.0), "step": 1}
    more = (64.0, *PEAKS)
    return {
        "A1": (FrfCase(peaks=without(MODES, 477.0), rigid=2, **one), "the second resonance"),
        "A2": (FrfCase(peaks=without(MODES, 477.0), rigid=2, without=("mode",), **one),
               "the same, and no resonance in the library"),
        "A3": (FrfCase(peaks=MODES, rigid=1, **one), "one of the two motions of the rigid body (its mass)"),
        "A4": (FrfCase(peaks=MODES, rigid=2, beam=True, **{**one, "band": (100.0, 1900.0), "step": 6}),
               "resonances tied to those of a free Euler-Bernoulli beam"),
        "A5": (FrfCase(peaks=MODES, rigid=2, **one), "nothing known"),
        "B1": (FrfCase(peaks=PEAKS, reserved=(4,), impact_places=[1] * 5, **two),
               "nothing on purpose; the makers overloaded impact 1"),
        "B2": (FrfCase(peaks=without(more, 447.0), reserved=(3,), impact_places=[1] * 4, **{**two, "h": h2[1:]}),
               "a resonance; without impact 1; the resonance that B1 found is in the model"),
    }  # fmt: skip


def analyse(folder, titles=None):
    """{title: (case, left out, diagnosis)} of the cases in ``titles``; None: of all."""
    chosen = {title: pair for title, pair in cases(folder).items() if titles is None or title in titles}
    return {title: (case, left_out, diagnose(case, SETTINGS)) for title, (case, left_out) in chosen.items()}


def rows(results):
    """A row per case."""
    for title, (_, left_out, d) in results.items():
        v, check = d.verdict, d.verification
        names = ", ".join(n.replace("_", " ") for n in v.names)
        after = "–" if check.after is None else f"{check.after:.1f}"
        rival = "–" if check.rival is None else f"{check.rival:.1f}"
        text = "; ".join(t.sentence() for t in d.fit.terms) or v.reason.replace("_", " ")
        yield [title, left_out, f"**{v.answer.replace('_', ' ')}** {names}".strip(), _readable(text, d), where(d),
               f"{check.before:.1f} → {after}", rival]  # fmt: skip


def _readable(text, diagnosis):
    """Sentences with logarithms turned into hertz and percent."""
    for term in diagnosis.fit.terms:
        v = term.values
        if "log_frequency" in v:
            old = f"log_frequency {v['log_frequency']:.4g}, log_damping {v['log_damping']:.4g}"
            frequency = np.exp(v["log_frequency"]) * mean_stretch(diagnosis)
            new = f"{frequency:.1f} Hz, damping {100.0 * np.exp(v['log_damping']):.2f} %"
            text = text.replace(old, new)
    return text


def where(diagnosis):
    """The frame between whose levels the residual of the base model differs most, with its largest level.

    * marks a level that differs more than the others do among themselves. A missing resonance shows in several
    neighbouring bands, of which none need be marked.
    """
    f = max(diagnosis.frames, key=lambda f: f.share)
    return f"{f.frame} {f.level} ({f.effect:+.0f} dB){'*' if f.q < 0.05 else ''}"


def identified_mode(diagnosis):
    """(frequency [Hz], damping ratio [%]) of the resonance named, its frequency the mean over the impacts used.

    A common stretch of all impacts and the frequencies of all resonances only show as a product.
    """
    v = next(t.values for t in diagnosis.fit.terms if t.effect_type == "mode")
    return float(np.exp(v["log_frequency"])) * mean_stretch(diagnosis), 100.0 * float(np.exp(v["log_damping"]))


def mean_stretch(diagnosis):
    """Mean factor on all frequencies over the impacts used; that of a reserved one stays at its prior."""
    stretches = [v for name, v in diagnosis.fit.values.items() if name.startswith("stretch@") and v != 0.0]
    return 1.0 + float(np.mean(stretches))


def beam_printed():
    r"""(slenderness, half its 95 % interval, share by which the first resonance lies above that law) of the first beam.

    From the printed frequencies, the second to the seventh, far beyond the band of A4.

    .. math:: (\lambda_n^2 / f_n)^2 = (1 + S \lambda_n^2) / c^2, a straight line in \lambda_n^2
    """
    square, f = LAMBDA**2, np.array(PRINTED_FREQUENCIES)
    line = stats.linregress(square[1:], (square[1:] / f[1:]) ** 2)
    first = (square[0] / f[0]) ** 2
    above = np.sqrt((line.intercept + line.slope * square[0]) / first) - 1.0
    half = stats.t.ppf(0.975, square.size - 3) * line.stderr  # a line through all but the first
    return line.slope / line.intercept, half / line.intercept, above


def draw(results, path):
    """Draw the reserved impact of some cases: recorded, by the simple model, and with the named effect."""
    plt = plotting()
    titles = ("A1", "A3", "A5", "B1")
    figure, axes = plt.subplots(len(titles), 1, figsize=(8.5, 8.0), layout="constrained")
    for axis, title in zip(axes, titles):
        case, left_out, d = results[title]
        before, after = (size(case, predict_reserved(case, fit, case.reserved)[0]) for fit in (d.base, d.fit))
        axis.semilogy(case.frequency, size(case, case.reserved[0].data), color="black", lw=1.2, label="recorded")
        axis.semilogy(case.frequency, before, color="C1", lw=1, label="too simple model")
        axis.semilogy(case.frequency, after, color="C0", lw=1, ls="--", label="with what was named")
        axis.set_title(f"{title}, {case.reserved[0].name}, held out. Left out: {left_out}", fontsize=9)
        axis.set_ylabel("rms of the sensors [m/s²/N]")
    axes[0].legend(ncols=3)
    axes[-1].set_xlabel("frequency [Hz]")
    save(figure, path)


def size(case, halves):
    """(n_line,) root mean square over the sensors, from real parts followed by imaginary parts."""
    real, imaginary = halves.reshape(2, case.n_sensor, -1)
    return np.sqrt(np.mean(real**2 + imaginary**2, axis=0))


PAGE = """# Real hammer tests against models that are too simple

This page shows what the diagnosis names on beams that others measured.

*Made by `python -m examples.real_frfs [FOLDER]`; every number comes from that run. A: a beam, impacts at 6 positions,
7 accelerometers, published with sdypy-EMA (MIT). B: a beam, five impacts at one position, published with pyFRF (MIT).*

The diagnosis is given measured frequency responses and a sum of resonances from which something is missing. The
library: further resonances anywhere from a quarter of the band's lowest to four times its highest frequency, gain,
delay and mounting of each sensor, gain of each impact, damping of another kind; in A4 also shear, a mass, an axial
force and springs. One impact is held out for the verification.

{cases}

Fit: of the held-out impact [%], before → after, and with the best rival. "Near" is the frequency at which the search
started. A resonance outside the band of the fit represents all resonances beyond it; it is
not one of the beam itself.{starred}

![Responses of the held-out impacts](real_frfs.svg)

- **A1: found.** The resonance left out is named at {f:.1f} Hz with {zeta:.2f} % damping. The makers print
  {published:.1f} Hz and {printed:.2f} %.
- **A2: answer "unknown".** The residual is largest at {a2}; 477 Hz lies between
  449 and 566 Hz, the centres of neighbouring thirds of an octave.
- **A3: found**, as a resonance below the band ({low:.0f} Hz, on the beam's suspension): within the band, a missing mass
  of the body has this effect.
- **A4: {a4}
- **A5: {a5}
- **B1: found.** Impact 1 is named as one by a hammer of {gain:.0%} sensitivity (its gain and the tolerance of that
  impact together): the response is that share of the one that the recorded force would cause.
  Either the force is too large or the responses are clipped. The makers state that the impact
  was overloaded on purpose, but not in which channel. The double impact (impact 3) is not detected: a ratio of
  spectra holds for two impacts as well. `make real` rejects both from the force itself (impacts 0 and 2, as it counts).
- **B2:** {b2}
"""


STAR_NOTE = """ * Its mean
differs from the others by more than they do among themselves (Grubbs, 5 % over all frames)."""


def control_text(d):
    """The answer where no omission is known, and whether the reserved impact confirms it."""
    check, reason = d.verification, d.verdict.reason.replace("_", " ")
    if d.verdict.answer == "none":
        return 'answer "none"**.'
    if d.verdict.answer != "named":
        return (
            f'answer "unknown"**: {reason}. The fit of the held-out impact is {check.before:.1f} %, best of series A.'
        )
    text = "a false name, not withdrawn" if check.is_worse else "named; this cannot be checked"
    return (
        f"{text}.** No omission is known; the fit of the held-out impact goes from {check.before:.1f}\n"
        f"  to {check.after:.1f} % (standard error of the difference {check.error:.1f}). Resonances above the band\n"
        f"  there are: the makers print some up to {PRINTED_FREQUENCIES[-1]:.0f} Hz."
    )


def beam_text(d):
    """The answer for a beam without shear and rotatory inertia, compared with its printed frequencies."""
    if d.verdict.names[:1] != ("shear_and_rotation",):
        return f'answer "unknown"**: {d.verdict.reason.replace("_", " ")}.'
    (size, *_), (error, *_) = d.verdict.scores[0].estimates
    printed, half, above = beam_printed()
    fitted_text, printed_text = f"{1e4 * size:.3f} ± {1.96e4 * error:.3f}", f"{1e4 * printed:.2f} ± {1e4 * half:.2f}"
    return (
        f"found**, with grade {d.verdict.grade}: shear and rotatory inertia, slenderness ({fitted_text}) 1e-4 (95 %) "
        "from\n"
        f"  100 to 1900 Hz. The second to the seventh frequency that the makers print, "
        f"up to {PRINTED_FREQUENCIES[-1]:.0f} Hz,\n"
        f"  require ({printed_text}) 1e-4. The first lies {above:.1%} above that law, which is the structure "
        "that remains:\n"
        "  the supports of the beam and the mass of its seven accelerometers are not published."
    )


def page(results):
    """The page as text."""
    f, zeta = identified_mode(results["A1"][2])
    b2 = results["B2"][2]
    gain_effect = next(t for t in results["B1"][2].fit.terms if t.effect_type == "impact_gain")
    impact_gain = 1.0 + gain_effect.values["gain"] + results["B1"][2].fit.values["hammer@impact 1"]
    head = ["", "left out", "answer", "in words", "residual is largest at", "fit", "rival"]
    b2_text = "found." if "mode" in b2.verdict.names else 'answer "unknown", located; '
    if "mode" in b2.verdict.names:
        b2_text += f" At {identified_mode(b2)[0]:.1f} Hz; left out was the one at 447 Hz."
    else:
        b2_text += (
            f"the resonance near {b2.verdict.scores[0].candidate.where.get('near', '?')} leads, but leaves too much."
        )
    cells = table(head, rows(results))
    return PAGE.format(
        cases=cells, starred=STAR_NOTE if " dB)*" in cells else "", f=f, zeta=zeta,
        published=PUBLISHED[477][0], printed=PUBLISHED[477][1],
        low=identified_mode(results["A3"][2])[0], a2=where(results["A2"][2]),
        a4=beam_text(results["A4"][2]), a5=control_text(results["A5"][2]), gain=impact_gain, b2=b2_text,
    )  # fmt: skip


def main(arguments):
    """Write the page and its picture."""
    folder = Path(arguments[0]) if arguments else SHARED
    if not (folder / "frf_beam_sdypy").is_dir():
        sys.exit(f"skipped: {folder}/frf_beam_sdypy does not exist. Give the folder of the recordings.")
    results = analyse(folder)
    draw(results, DOCS / "real_frfs.svg")
    text = page(results)
    (DOCS / "real_frfs.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main(sys.argv[1:])
