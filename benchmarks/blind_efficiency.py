"""Naming efficiency of a revealed set of histories: was there enough evidence for a name, in the tool's own model?

    python -m benchmarks.blind_efficiency SET

For each site with a clear effect, the visits up to two after it became clear are given the true effect without any
noise, with the information matrices that the tool has stored and the levels of errors that it found. Printed are the
evidence of the right name less the price of all candidates, its margin over the best other name, both in nats, and
whether the site was named. Evidence and margin above the tool's bars without a name: a failure of search or decision.
Below: a limit of the measurement. A gap that trains close has no linear model and is left out as the true effect; as a
rival of soft ballast it counts. The nose is taken as a dip of its wear. Noise adds half a nat on average.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from turnout.config import load_configuration, with_raw
from turnout.mismatch.calibrated import change_candidates, compare_onsets, estimate_history
from turnout.mismatch.calibrated.file_comparison import evidence_from_first
from turnout.mismatch.calibrated.history import Event
from turnout.mismatch.calibrated.levels import error_levels
from turnout.mismatch.calibrated.model_answer import NAMES
from turnout.mismatch.calibrated.soft_ballast_or_gap import evidence_of_gap
from turnout.mismatch.turnout.calibration import dip_directions, file_errors
from turnout.stages import stored_visits
from turnout.stages.recorded_work import events_of
from turnout_blind.history import START, parameters_at
from turnout_blind.reveal import read_revealed
from turnout_blind.score.histories import MAX_VISITS_LATE, judge_history
from turnout_blind.score.names import right_names

SIDE_SHARE = 0.33  # of the logarithm of a factor on ballast, at the neighbour: as ``turnout_blind.effects.ballast``


def change_by(effect, share, parameters, directions):
    """Parameter -> change by an effect at a share of its size; None where the model has no such change."""
    kind, where, sizes = effect["kind"], effect["where"], parameters_at(effect["kind"], effect["parameters"], share)
    if kind in ("ballast", "pad"):
        change = _of_supports(kind, where["position"], np.log(sizes["factor"]), parameters)
        if kind == "ballast":
            beside = where["position"] + 0.6 * sizes["side"]
            change |= _of_supports(kind, beside, SIDE_SHARE * np.log(sizes["factor"]), parameters)
        return change
    if kind in ("gain", "position"):
        group, size = ("gain", sizes["gain"] - 1.0) if kind == "gain" else ("seat", sizes["shift"])
        return {p.name: size for p in parameters if p.group == group and p.name.endswith(where["sensor"])}
    if kind in ("dip", "nose") and directions:
        name = min(directions, key=lambda n: _distance(n, where["position"], sizes["length"]))
        return {p: sizes["depth"] * d for p, d in directions[name].items()}
    return None


def _of_supports(group, position, size, parameters):
    """The spring nearest to a position changes by ``size``, its damper by half of it."""
    shares = {group: 1.0, f"{group}_damper": 0.5}
    near = [p for p in parameters if p.group in shares and p.position is not None and abs(p.position - position) < 0.3]
    return {p.name: shares[p.group] * size for p in near}


def _distance(name, position, length):
    """How far a dip of the candidates is from one at a position with a length [m]."""
    words, at = name.split(" m@")
    return abs(float(at) - position) + 0.2 * abs(float(words.rpartition(" ")[2]) - length)


def efficiency(folder, case, truth, rows):
    """Evidence of the true effect, its margin [nats] and the tool's bars for both; None without a linear effect."""
    turnout = with_raw(load_configuration(folder / "cases" / case / "config").turnout(case), folder / "cases" / case)
    stored = stored_visits.read_visits(
        folder / "work" / case / "tool" / stored_visits.FOLDER, case, {v: {} for v in truth["visits"]}
    )
    parameters, effect = stored_visits.parameters_of(stored), truth["effects"][0]
    last = truth["visits"].index(judge_history(truth, rows).clear_visit) + MAX_VISITS_LATE
    visits = sorted(stored_visits.visits_of(stored), key=lambda v: v.time)[:last]
    directions = dip_directions(parameters)
    changes = [change_by(effect, share, parameters, directions) if share else {} for share in truth["severities"]]
    if None in changes[:last] or not any(changes[:last]):
        return None
    events = [*events_of(turnout, parameters), *file_errors(parameters, directions)]
    candidates = change_candidates(parameters, directions)
    ideal = [_without_noise(v, parameters, change) for v, change in zip(visits, changes)]
    if truth["pattern"] == START:
        steps = [c for c in candidates if not c.grows]
        history = estimate_history(parameters, ideal, events, accepted=None)
        gains, price = evidence_from_first(history, steps)[0], np.log(len(steps))
        by_effect, levels = list(zip(steps, gains)), None
    else:
        explained = [Event(v.time, {}, c, 1.0) for v, c in zip(visits, changes) if c]
        levels = error_levels(parameters, visits, [*events, *explained])
        history = estimate_history(
            parameters, ideal, events, repeats_between_visits=False, accepted=None, levels=levels
        )
        price = np.log(len(candidates))
        by_effect = [(e, e.gain) for e in compare_onsets(history, candidates)]
    groups, right = {p.name: p.group for p in parameters}, right_names(effect["kind"])
    best, leaders = {True: -np.inf, False: -np.inf}, {}
    for leader, gain in by_effect:
        candidate = getattr(leader, "effect", leader)
        is_right = NAMES[groups.get(candidate.name, candidate.group or "dip")] in right
        if gain - price > best[is_right]:
            best[is_right], leaders[is_right] = gain - price, leader
    settings, margin = turnout.settings["mismatch"], best[True] - best[False]
    if effect["kind"] == "ballast" and effect["parameters"]["factor"] < 1.0:
        size = np.log(effect["parameters"]["factor"])
        margin = min(margin, -evidence_of_gap(parameters, ideal, events, leaders[True], size, levels))
    return best[True], margin, settings.threshold, settings.margin


def _without_noise(visit, parameters, change):
    """The visit with the information vectors of values as in the file, and a change."""
    value = {p.name: p.mean + change.get(p.name, 0.0) for p in parameters}
    groups = (replace(g, vector=g.matrix @ np.array([value[n] for n in g.names])) for g in visit.groups)
    return replace(visit, groups=tuple(groups))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path, help="folder of a revealed set of histories")
    folder = parser.parse_args().set
    truths, rows, diagnosis = read_revealed(folder)
    n_above = n_named = 0
    print("| site | concealed | evidence | margin | enough | named |\n|---|---|---|---|---|---|")
    for case in sorted(set(truths) & set(diagnosis["cases"])):
        result = judge_history(truths[case], rows[case])
        if result.clear_visit is None:
            continue
        found = efficiency(folder, case, truths[case], rows[case])
        named = result.named.replace("_", " ") or "no"
        if found is None:
            print(f"| {case} | {result.kind} | - | - | no linear model | {named} |")
            continue
        evidence, margin, threshold, least_margin = found
        is_enough = evidence >= threshold and margin >= least_margin
        n_above, n_named = n_above + is_enough, n_named + (is_enough and result.named == "named")
        print(f"| {case} | {result.kind} | {evidence:.0f} | {margin:.0f} | {'yes' if is_enough else 'no'} | {named} |")
    print(f"\nNamed {n_named} of {n_above} with enough evidence.")


if __name__ == "__main__":
    main()
