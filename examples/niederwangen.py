"""Bern-Niederwangen with the diagnosis: what changed at which section, and what was added or taken away.

python -m examples.niederwangen [FOLDER]     writes docs/niederwangen_mismatch.md and its picture; minutes

FOLDER holds track_decay_rate.csv. Every number in the page comes from the run; its prose is fixed.
"""

import sys

import numpy as np
import pandas as pd
from examples.decay_case import DIRECTIONS, DecayCase, Measured
from examples.decay_model import BANDS
from examples.recorded import DOCS, folder_of

from turnout.mismatch import diagnose
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.map_fit import fit_jointly

FLOOR = 0.1  # least spread of a logarithm that anybody should believe
LEFT_OUT = ("2015-09", "2013-07")  # each in its turn; before 2013-01 there is only what the model is calibrated on


def read(folder):
    """``Measured`` of every section: means over both rails; the spread is that of one rail, and how well a section's
    mean repeats is taken from the five sections of the first campaign, before anything can have changed."""
    rows = pd.read_csv(folder / "track_decay_rate.csv", parse_dates=["date"])
    rows["campaign"] = rows["date"].dt.strftime("%Y-%m")
    rows["log"] = np.log(rows["decay_rate_db_per_m"])
    campaigns = tuple(sorted(rows["campaign"].unique()))
    spread, repeat, log, temperature = {}, {}, {}, {}
    for direction, part in rows.groupby("direction"):
        wide = part.pivot_table(index=["section", "campaign", "rail"], columns="frequency_hz", values="log")
        rails = wide.xs("left", level="rail") - wide.xs("right", level="rail")
        spread[direction] = np.maximum(FLOOR, rails.std().to_numpy() / np.sqrt(2.0))
        first = wide.xs(campaigns[0], level="campaign").groupby("section").mean().std().to_numpy() ** 2
        repeat[direction] = np.sqrt(np.convolve(np.pad(first, 2, mode="edge"), np.ones(5) / 5.0, "valid"))
        for (section, campaign), cell in part.groupby(["section", "campaign"]):
            log[section, direction, campaign] = cell.groupby("frequency_hz")["log"].mean().loc[BANDS].to_numpy()
            temperature[section, direction, campaign] = float(cell["rail_temp_c"].mean())
    return [
        Measured(s, _of(s, log), spread, repeat, _of(s, temperature), campaigns)
        for s in sorted(rows["section"].unique())
    ]


def _of(section, held):
    return {key[1:]: value for key, value in held.items() if key[0] == section}


def calibrate(measured):
    """{nuisance: (mean, sd)}: the track model fitted to the first campaign alone."""
    case = DecayCase(measured, only=measured.campaigns[:1])
    fit = fit_jointly(case, iterations=40)
    sd = np.sqrt(np.diag(fit.covariance))
    return {n.name: (fit.values[n.name], float(s)) for n, s in zip(case.nuisances, sd)}


def analyse(folder, sections=None, tell=print):
    """{section: (calibrated priors, {left-out campaign: (case, diagnosis)}, {left-out campaign: gains by date})}."""
    found = {}
    for measured in read(folder):
        if sections and measured.section not in sections:
            continue
        priors = calibrate(measured)
        runs = {}
        for campaign in LEFT_OUT:
            case = DecayCase(measured, campaign, priors)
            runs[campaign] = case, diagnose(case)
            d = runs[campaign][1]
            tell(f"{measured.section} without {campaign}: {d.verdict.answer} {d.verdict.names} {d.verification}")
        gains = {c: dates(*run) if run[1].verdict.answer != "none" else {} for c, run in runs.items()}
        found[measured.section] = priors, runs, gains
    return found


DAMPS = {
    "absorber",
    "lateral_absorber",
    "vertical_absorber",
    "broad_absorber",
    "rail_loss",
}  # all of them take energy out of the rail


def conclusion(runs):
    """(what, names): "not changed", "changed" or "left open", and the names that either run leaves.

    A section has changed if both runs say so and both predict the campaign that they never saw better for it; it has
    not if both say "none"; anything else stays open.
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
    best = diagnosis.verdict.scores[0]
    base, found = sum(held_out_score(case, diagnosis.base).values()), {}
    for candidate in (c for c in case.candidates if c.family == best.family):
        fit = fit_jointly(case, (candidate,), best.fit.psi[-len(candidate.parameters) :], iterations=15)
        found[candidate.where["since"]] = sum(held_out_score(case, fit).values()) - base
    return found


def bands_changed(measured, priors):
    """{direction: (log factor (n_campaign, n_band), its sd (n_band,))} of the campaigns after the first over the
    calibrated model at their temperature; the sd holds what one rail and one campaign may err."""
    case = DecayCase(measured, priors=priors)
    values = {name: mean for name, (mean, _) in priors.items()}
    found = {}
    for direction in DIRECTIONS:
        mine = [o for o in case.observations if o.data_type == direction and o.condition != measured.campaigns[0]]
        factor = np.array([measured.log[direction, o.condition] - case.logarithm(values, (), o) for o in mine])
        error = np.sqrt(measured.spread[direction] ** 2 + measured.repeat[direction] ** 2)
        found[direction] = factor, error * np.sqrt(1.0 + 1.0 / len(mine))
    return found


def main(arguments):
    """Write the page and its picture."""
    from examples.niederwangen_page import draw, page, section_rows

    folder = folder_of("track_sbb_niederwangen", arguments)
    measured, found = read(folder), analyse(folder)
    draw(measured, found, DOCS / "niederwangen_mismatch.svg")
    (DOCS / "niederwangen_mismatch.md").write_text(page(measured, found), encoding="utf-8")
    for row in section_rows(measured, found):
        print(" | ".join(row))


if __name__ == "__main__":
    main(sys.argv[1:])
