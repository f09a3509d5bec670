"""Diagnosis of the track decay rates of Bern-Niederwangen: what changed at which section.

python -m examples.niederwangen [FOLDER]     writes docs/niederwangen_mismatch.md and its picture; minutes

FOLDER holds track_decay_rate.csv. Every number in the page comes from the run; its text is fixed.
"""

import sys

import numpy as np
import pandas as pd
from examples.decay_case import DIRECTIONS, DecayCase, MeasuredRates
from examples.decay_model import BANDS
from examples.recorded import DOCS, folder_of

from turnout.mismatch import diagnose
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.map_fit import fit_jointly

MIN_SPREAD = 0.1  # smallest plausible sd of the logarithm of a decay rate
LEFT_OUT_CAMPAIGNS = ("2015-09", "2013-07")  # campaigns left out in turn; the first campaign calibrates the model


def read(folder):
    """``MeasuredRates`` of every section: means over both rails.

    The spread is that of one rail. The repeatability of a section mean is the spread over the five sections in the
    first campaign, before any change.
    """
    rows = pd.read_csv(folder / "track_decay_rate.csv", parse_dates=["date"])
    rows["campaign"] = rows["date"].dt.strftime("%Y-%m")
    rows["log"] = np.log(rows["decay_rate_db_per_m"])
    campaigns = tuple(sorted(rows["campaign"].unique()))
    spread, repeat, log, temperature = {}, {}, {}, {}
    for direction, selected in rows.groupby("direction"):
        wide = selected.pivot_table(index=["section", "campaign", "rail"], columns="frequency_hz", values="log")
        rails = wide.xs("left", level="rail") - wide.xs("right", level="rail")
        spread[direction] = np.maximum(MIN_SPREAD, rails.std().to_numpy() / np.sqrt(2.0))
        first = wide.xs(campaigns[0], level="campaign").groupby("section").mean().std().to_numpy() ** 2
        repeat[direction] = np.sqrt(np.convolve(np.pad(first, 2, mode="edge"), np.ones(5) / 5.0, "valid"))
        for (section, campaign), cell in selected.groupby(["section", "campaign"]):
            log[section, direction, campaign] = cell.groupby("frequency_hz")["log"].mean().loc[BANDS].to_numpy()
            temperature[section, direction, campaign] = float(cell["rail_temp_c"].mean())
    return [
        MeasuredRates(s, _of_section(s, log), spread, repeat, _of_section(s, temperature), campaigns)
        for s in sorted(rows["section"].unique())
    ]


def _of_section(section, values):
    return {key[1:]: value for key, value in values.items() if key[0] == section}


def calibrate(measured):
    """{nuisance: (mean, sd)}: the track model fitted to the first campaign alone."""
    case = DecayCase(measured, only=measured.campaigns[:1])
    fit = fit_jointly(case, iterations=40)
    sd = np.sqrt(np.diag(fit.covariance))
    return {n.name: (fit.values[n.name], float(s)) for n, s in zip(case.nuisances, sd)}


def analyse(folder, sections=None, report=print):
    """{section: (calibrated priors, {left-out campaign: (case, diagnosis)}, {left-out campaign: gains by date})}."""
    results = {}
    for measured in read(folder):
        if sections and measured.section not in sections:
            continue
        priors = calibrate(measured)
        runs = {}
        for campaign in LEFT_OUT_CAMPAIGNS:
            case = DecayCase(measured, campaign, priors)
            runs[campaign] = case, diagnose(case)
            d = runs[campaign][1]
            report(f"{measured.section} without {campaign}: {d.verdict.answer} {d.verdict.names} {d.verification}")
        gains = {c: dates(*run) if run[1].verdict.answer != "none" else {} for c, run in runs.items()}
        results[measured.section] = priors, runs, gains
    return results


DAMPING_EFFECTS = {
    "absorber",
    "lateral_absorber",
    "vertical_absorber",
    "broad_absorber",
    "rail_loss",
}  # all of them dissipate energy of the rail


def conclusion(runs):
    """("not changed", "changed" or "left open", names given in either run).

    A section has changed if both runs name something and both predict their reserved campaign better with it. It has
    not changed if both say "none". Otherwise it stays open.
    """
    verdicts = [d.verdict for _, d in runs.values()]
    names = tuple(dict.fromkeys(n for v in verdicts for n in v.names))
    if all(v.answer == "none" for v in verdicts):
        return "not changed", ()
    better = [d.verification.after is not None and d.verification.after > d.verification.before for _, d in
              runs.values()]  # fmt: skip
    if all(v.names for v in verdicts) and all(better):
        return "changed", names
    return "left open", names


def dates(case, diagnosis):
    """{campaign: gain over the base model by held-out density [nats]} of the leading change at each date."""
    best_score = diagnosis.verdict.scores[0]
    base, gains = sum(held_out_score(case, diagnosis.base).values()), {}
    for candidate in (c for c in case.candidates if c.family == best_score.family):
        fit = fit_jointly(case, (candidate,), best_score.fit.psi[-len(candidate.parameters) :], iterations=15)
        gains[candidate.where["since"]] = sum(held_out_score(case, fit).values()) - base
    return gains


def bands_changed(measured, priors):
    """{direction: (log factor (n_campaign, n_band), its sd (n_band,))}: later campaigns over the calibrated model.

    The model is taken at the temperature of the campaign. The sd combines the errors of one rail and of one campaign.
    """
    case = DecayCase(measured, priors=priors)
    values = {name: mean for name, (mean, _) in priors.items()}
    factors = {}
    for direction in DIRECTIONS:
        later = [o for o in case.observations if o.data_type == direction and o.condition != measured.campaigns[0]]
        factor = np.array([measured.log[direction, o.condition] - case.logarithm(values, (), o) for o in later])
        error = np.sqrt(measured.spread[direction] ** 2 + measured.repeat[direction] ** 2)
        factors[direction] = factor, error * np.sqrt(1.0 + 1.0 / len(later))
    return factors


def main(arguments):
    """Write the page and its picture."""
    from examples.niederwangen_page import draw, page, section_rows

    folder = folder_of("track_sbb_niederwangen", arguments)
    measured, results = read(folder), analyse(folder)
    draw(measured, results, DOCS / "niederwangen_mismatch.svg")
    (DOCS / "niederwangen_mismatch.md").write_text(page(measured, results), encoding="utf-8")
    for row in section_rows(measured, results):
        print(" | ".join(row))


if __name__ == "__main__":
    main(sys.argv[1:])
