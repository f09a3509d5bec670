"""Fits with the true effect, by the same engine on the same recordings left out: what a perfect name would gain.

    python -m benchmarks.blind_oracle SET [--clear 30] [--workers 2]
    python -m benchmarks.blind_oracle SET --cases T1234abcd ...

SET is a revealed set, judged by this very tool. Writes SET/oracle.json: hashes of tool and set, and ``fits`` {case: fit
without, fit with the true effect} [%], null where there is none, with the reason; goes on where it stopped, and asks
again what failed. All clear singles are asked, or with ``--clear`` so many of them in the order of their ids, which are
hashes: a sample that nobody has drawn. A case whose effect the library does not hold has no oracle, nor has one of a
wheel, which comes at another angle to every passage. ``--cases`` prints the chosen ones and writes nothing.
"""

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from tqdm import tqdm

import turnout
from benchmarks.blind_bridge import campaigns_of
from turnout.errors import TurnoutError
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.joint_problem import cost_at
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.reserved_data import predict_reserved
from turnout.mismatch.turnout.case import TrackCase
from turnout_blind.score.matching import MAX_POSITION_ERROR, MIN_CLEAR_GAIN, gain_of
from turnout_blind.score.names import SAME_PARAMETERS, right_names
from turnout_blind.score.report import provenance
from turnout_blind.seal import digest_of_folder

MAX_ITERATIONS = 15  # iterations of each fit
N_STARTS = 2  # starts beside the truth itself; scans of phase and frequency have dozens


def oracle(folder, case, truth):
    """{"before", "oracle", "cpu_s"} of one case: [%] and seconds."""
    start = time.process_time()
    (campaign,) = campaigns_of(folder, case)
    track_case = TrackCase(campaign)
    if not track_case.reserved:
        raise TurnoutError("none of the recordings left out can be used, so no fit can be told")
    base = fit = fit_jointly(track_case, iterations=MAX_ITERATIONS)
    for effect in truth["effects"]:
        fit = fit_with(track_case, fit, effect) or fit
    before, after = (
        fit_percent(track_case.reserved, predict_reserved(track_case, f, track_case.reserved)) for f in (base, fit)
    )
    families = {c.family for c in fit.candidates}
    is_complete = all(families & set(right_names(e["kind"])) for e in truth["effects"])
    return {
        "before": before, "oracle": after if is_complete and truth["effects"] else None,
        "cpu_s": round(time.process_time() - start, 1),
    }  # fmt: skip


def fit_with(case, fit, effect):
    """Best fit with this effect at its true position, from the truth and from the likeliest starts.

    Nuisance parameters that can mask the effect start also at their prior.
    """
    fits = {}
    unbent = fit.values | {n.name: n.mean for n in case.nuisances if n.owner is None and n.can_mask}
    for candidate in _candidates(case, effect):
        true_start = _true_start(candidate, effect)
        starts = [
            (true_start, fit.values),
            (true_start, unbent),
            *((s, fit.values) for s in _likeliest(case, fit, candidate)),
        ]
        for start, values in starts:
            key = repr(candidate.term(start)), values is unbent
            try:
                if key not in fits:
                    fits[key] = fit_jointly(
                        case, (*fit.candidates, candidate), [*fit.psi, *start], values, iterations=MAX_ITERATIONS
                    )
            except TurnoutError:  # it cannot be simulated from this start
                continue
    return min(fits.values(), key=lambda f: f.cost, default=None)


def _likeliest(case, fit, candidate):
    """The ``N_STARTS`` starts of a candidate with the least cost before any fit."""
    cost = {}
    for start in candidate.starts:
        try:
            cost[start] = cost_at(case, (*fit.candidates, candidate), [*fit.psi, *start], fit.values)
        except TurnoutError:  # it cannot be simulated from this start
            continue
    return sorted(cost, key=cost.get)[:N_STARTS]


def _candidates(case, effect):
    """Candidates with a right name at the true position, sensor, train and axle."""
    where = effect["where"]
    for candidate in case.candidates:
        candidate_where = candidate.where
        is_near = (
            "place" not in candidate_where
            or "position" not in where
            or abs(candidate_where["place"] - where["position"]) <= 0.5 * MAX_POSITION_ERROR
        )
        is_same = all(
            candidate_where.get(k) == where[k]
            for k in ("sensor", "train", "axle")
            if k in where and k in candidate_where
        )
        if candidate.family in right_names(effect["kind"]) and is_near and is_same:
            yield candidate


def _true_start(candidate, effect):
    """True parameters where generator and tool share them, and the first start for the others."""
    true_values = {
        tool_name: effect["parameters"][name] for name, tool_name in SAME_PARAMETERS.get(effect["kind"], {}).items()
    }
    return [
        min(max(true_values.get(p.name, s), p.bounds[0]), p.bounds[1])
        for p, s in zip(candidate.parameters, candidate.starts[0])
    ]


def clear_singles(truths):
    """Cases of one effect that costs more than 3 points of held-out fit and can have an oracle, by id."""
    return [
        case
        for case, truth in sorted(truths.items())
        if truth["stratum"] == "single"
        and gain_of(truth["visible"]) > MIN_CLEAR_GAIN
        and right_names(truth["effects"][0]["kind"])
        and "axle" not in truth["effects"][0].get("where", {})
    ]


def _job(job):
    folder, case, truth = job
    try:
        return case, oracle(folder, case, truth)
    except Exception as error:
        return case, {"error": f"{type(error).__name__}: {error}"[:300]}


def ask_oracle(out, truths, clear, workers):
    """Compute the clear singles that have no answer yet or failed, and write each answer as it comes."""
    path, origin = out / "oracle.json", provenance(json.loads((out / "diagnosis.json").read_text()))
    tool_sha256 = digest_of_folder(Path(turnout.__file__).parent)
    if tool_sha256 != origin["tool_sha256"]:
        sys.exit(
            f"{out}/diagnosis.json: judged by tool {origin['tool_sha256'][:16]}, "
            f"this is {tool_sha256[:16]}. Run that one."
        )
    former = json.loads(path.read_text()) if path.exists() else {}
    fits = former["fits"] if {k: former.get(k) for k in origin} == origin else {}
    chosen = clear_singles(truths)[:clear]
    for case, result in answers(out, [c for c in chosen if fits.get(c, {}).get("oracle") is None], truths, workers):
        fits[case] = result
        path.write_text(json.dumps(origin | {"asked": chosen, "fits": fits}, indent=1, sort_keys=True) + "\n")


def answers(out, cases, truths, workers):
    """(case, result) as they come."""
    with ProcessPoolExecutor(workers) as pool:
        jobs = [pool.submit(_job, (out / "cases" / case, case, truths[case])) for case in cases]
        for future in tqdm(as_completed(jobs), "oracle", len(jobs), unit="case", disable=not sys.stderr.isatty()):
            yield future.result()


def main():
    """Fit and write, case by case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set")
    parser.add_argument("--cases", nargs="+", help="these, printed and not kept")
    parser.add_argument("--clear", type=int, help="so many of the clear singles; all where it is not given")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    out = Path(args.set)
    truths = {p.stem: json.loads(p.read_text()) for p in sorted((out / "revealed").glob("T*.json"))}
    if args.cases:
        for case, result in answers(out, args.cases, truths, args.workers):
            print(case, result, flush=True)
    else:
        ask_oracle(out, truths, args.clear, args.workers)


if __name__ == "__main__":
    main()
