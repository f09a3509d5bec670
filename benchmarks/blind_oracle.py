"""Fits with the true effect, by the same engine on the same recordings left out: what a perfect name would gain.

    python -m benchmarks.blind_oracle SET [--cases T1234abcd ...] [--clear 30] [--workers 2]

SET is a revealed set. Writes SET/oracle.json, {case: [fit without, fit with the true effect]} [%], and
SET/oracle_detail.json; goes on where it stopped. A case whose effects the library does not hold has no oracle, nor has
one of a wheel, which comes at another angle to every passage. Errors of a case are its result and stop nothing.
``--clear`` takes so many clear singles in the order of their ids, which are hashes: a sample that nobody has drawn.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from benchmarks.blind_bridge import campaigns_of
from turnout.errors import TurnoutError
from turnout.mismatch.joint import cost_at, fit_jointly
from turnout.mismatch.track.track_case import TrackCase
from turnout.mismatch.verify import fit_percent, predict_reserved
from turnout_blind.score.judged import BAY, CLEAR, gain_of
from turnout_blind.score.names import SAME, right_names

STEPS = 15
STARTS = 2  # beside the truth itself: scans of phase and frequency have dozens


def oracle(folder, case, truth):
    """{"before", "oracle", "cpu_s"} of one case: [%] and seconds."""
    began = time.process_time()
    (campaign,) = campaigns_of(folder, case)
    made = TrackCase(campaign)
    if not made.reserved:
        raise TurnoutError("none of the recordings left out can be used, so no fit can be told")
    base = fit = fit_jointly(made, iterations=STEPS)
    for effect in truth["effects"]:
        fit = _with(made, fit, effect) or fit
    before, after = (fit_percent(made.reserved, predict_reserved(made, f, made.reserved)) for f in (base, fit))
    held = {c.family for c in fit.candidates}
    whole = all(held & set(right_names(e["kind"])) for e in truth["effects"])
    return {
        "before": before, "oracle": after if whole and truth["effects"] else None,
        "cpu_s": round(time.process_time() - began, 1),
    }  # fmt: skip


def _with(case, fit, effect):
    """The best fit with this effect in it, where it is, from the truth itself and from the likeliest starts."""
    found = []
    for candidate in _candidates(case, effect):
        for start in (_told(candidate, effect), *_likeliest(case, fit, candidate)):
            try:
                found.append(
                    fit_jointly(case, (*fit.candidates, candidate), [*fit.psi, *start], fit.values, iterations=STEPS)
                )
            except TurnoutError:  # it cannot be simulated from here
                continue
    return min(found, key=lambda f: f.cost, default=None)


def _likeliest(case, fit, candidate):
    """The ``STARTS`` of its starts that cost least before anything is fitted."""
    cost = {}
    for start in candidate.starts:
        try:
            cost[start] = cost_at(case, (*fit.candidates, candidate), [*fit.psi, *start], fit.values)
        except TurnoutError:  # it cannot be simulated there
            continue
    return sorted(cost, key=cost.get)[:STARTS]


def _candidates(case, effect):
    """Candidates of a right name at the true place, sensor, train and axle."""
    where = effect["where"]
    for candidate in case.candidates:
        mine = candidate.where
        near = "place" not in mine or "position" not in where or abs(mine["place"] - where["position"]) <= 0.5 * BAY
        same = all(mine.get(k) == where[k] for k in ("sensor", "train", "axle") if k in where and k in mine)
        if candidate.family in right_names(effect["kind"]) and near and same:
            yield candidate


def _told(candidate, effect):
    """Parameters as they really are where the two codes mean the same, the first start elsewhere."""
    known = {theirs: effect["parameters"][own] for own, theirs in SAME.get(effect["kind"], {}).items()}
    return [
        min(max(known.get(p.name, s), p.bounds[0]), p.bounds[1])
        for p, s in zip(candidate.parameters, candidate.starts[0])
    ]


def clear_singles(truths):
    """Cases of one effect that costs more than 3 points of held-out fit and has a name, by id."""
    return [
        case
        for case, truth in sorted(truths.items())
        if truth["stratum"] == "single"
        and gain_of(truth["visible"]) > CLEAR
        and right_names(truth["effects"][0]["kind"])
    ]


def _job(job):
    folder, case, truth = job
    try:
        return case, oracle(folder, case, truth)
    except Exception as error:
        return case, {"error": f"{type(error).__name__}: {error}"[:300]}


def main():
    """Fit and write, case by case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set")
    parser.add_argument("--cases", nargs="+")
    parser.add_argument("--clear", type=int, help="so many of the clear singles")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    out = Path(args.set)
    truths = {p.stem: json.loads(p.read_text()) for p in sorted((out / "revealed").glob("T*.json"))}
    detail = out / "oracle_detail.json"
    found = json.loads(detail.read_text()) if detail.exists() else {}
    chosen = args.cases or (truths if args.clear is None else clear_singles(truths)[: args.clear])
    wanted = [c for c in chosen if c not in found and truths[c]["stratum"] in ("single", "double")]
    with ProcessPoolExecutor(args.workers) as pool:
        jobs = [pool.submit(_job, (out / "cases" / case, case, truths[case])) for case in wanted]
        for done in as_completed(jobs):
            case, result = done.result()
            found[case] = result
            detail.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
            known = {c: (r["before"], r["oracle"]) for c, r in found.items() if r.get("oracle") is not None}
            (out / "oracle.json").write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
            print(case, result, flush=True)


if __name__ == "__main__":
    main()
