"""Naming efficiency of a revealed set of single visits: was there enough evidence for a name, in the tool's own model?

    python -m benchmarks.blind_visit_efficiency SET [--cases T1234abcd ...]

Each clear single effect is fitted on top of the base model of the tool, to the same recordings. The fit starts from the
true size and from the likeliest starts of the candidates at the true position, sensor or train. Its gain is compared
with the bars of the tool, and with the gains of all other names that its finding lists. Gain and margin above the bars
without a name: a failure of search or decision. Below: a limit of the measurement. Effects of one wheel, whose angle is
another in every passage, and those outside the library have no such fit. A case costs about as much as its diagnosis.
"""

import argparse
import json
from pathlib import Path

from benchmarks.blind_bridge import campaigns_of
from benchmarks.blind_oracle import clear_singles, fit_with
from turnout.mismatch.engine.diagnose import fit_base
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout.case import TrackCase
from turnout_blind.reveal import read_revealed
from turnout_blind.score.names import right_names


def true_score(folder, case, effect):
    """(score of the true effect, settings of the search); (None, settings) if it cannot be simulated."""
    (campaign,) = campaigns_of(folder / "cases" / case, case)
    search, base = fit_base(Search.of(TrackCase(campaign)))
    fit = fit_with(search.case, base, effect)
    return None if fit is None else score_of(search, base, fit, fit.candidates[-1]), search.settings


def best_rival(rows, names):
    """(name, gain [nats]) of the best name that the finding lists and that is none of ``names``; ("", 0.0) without."""
    ranking = json.loads(rows[0]["evidence_json"] or "{}").get("ranking", ()) if rows else ()
    rivals = [(r["family"], max(r["nats"], 0.0)) for r in ranking if r["family"] not in names]
    return max(rivals, key=lambda r: r[1], default=("", 0.0))


def has_enough(score, rival_gain, settings):
    """Whether gain, size and lead of the true effect suffice for its name."""
    if score is None or not score.is_reportable:
        return False
    return score.gain > settings.threshold and score.gain - rival_gain >= settings.margin


def main():
    """Fit and print, case by case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path, help="folder of a revealed set of single visits")
    parser.add_argument("--cases", nargs="+", help="these alone")
    args = parser.parse_args()
    truths, rows, diagnosis = read_revealed(args.set)
    chosen = [c for c in clear_singles(truths) if c in diagnosis["cases"] and c in (args.cases or truths)]
    named_by_enough = []
    print("| case | concealed | gain [nats] | best other name | enough | answer |")
    print("|---|---|---|---|---|---|", flush=True)
    for case in chosen:
        (effect,) = truths[case]["effects"]
        names = right_names(effect["kind"])
        score, settings = true_score(args.set, case, effect)
        rival, rival_gain = best_rival(rows[case], names)
        is_enough = has_enough(score, rival_gain, settings)
        answer = rows[case][0] if rows[case] else {"verdict": "no answer", "term": None}
        if is_enough:
            named_by_enough.append(answer["verdict"] == "named" and answer["term"] in names)
        gain = "-" if score is None else f"{score.gain:.1f}"
        words = f"{answer['verdict']} {answer['term'] or ''}".strip().replace("_", " ")
        print(f"| {case} | {effect['kind']} | {gain} | {rival} {rival_gain:.1f} | "
              f"{'yes' if is_enough else 'no'} | {words} |", flush=True)  # fmt: skip
    print(f"\nNamed {sum(named_by_enough)} of {len(named_by_enough)} with enough evidence.")


if __name__ == "__main__":
    main()
