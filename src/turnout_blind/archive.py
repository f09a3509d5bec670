"""Store a revealed set in one small file: seals, truths and findings. Seeds reproduce the recordings."""

import gzip
import json
from pathlib import Path

from turnout_blind.campaign import stage
from turnout_blind.effect import load_effects
from turnout_blind.reveal import findings
from turnout_blind.seal import SET, BlindError, digest, files_of, verify
from turnout_blind.site import PLAIN
from turnout_blind.strata import CasePlan, case_id, plan_cases

KEPT = "set.json.gz"


def keep(out, folder, truth=None):
    """Write ``folder``/set.json.gz: the commit, the sealed truths, and the findings where the set was diagnosed.

    ``truth`` is the folder of truths, by default those revealed in ``out``. All seals are verified first.
    """
    out, folder = Path(out), Path(folder)
    truth = out / "revealed" if truth is None else Path(truth)
    truths = verify(out, truth)
    rows, held = findings(out) if (out / "diagnosis.json").exists() else ({}, None)
    content = {
        "commit": (out / "commit.json").read_text(),
        "set": (truth / SET).read_text(),
        "truths": {case: (truth / f"{case}.json").read_text() for case in sorted(truths)},
        "rows": rows,
        "diagnosis": held,
    }
    folder.mkdir(parents=True, exist_ok=True)
    data = json.dumps(content, sort_keys=True, separators=(",", ":")).encode()
    (folder / KEPT).write_bytes(gzip.compress(data, 9, mtime=0))
    return folder / KEPT


def kept(folder):
    """Content of an archive, as ``write_archive`` wrote it."""
    return json.loads(gzip.decompress((Path(folder) / KEPT).read_bytes()))


def verify_kept(held, effects=None):
    """Truths by case, after every check that needs no recording. BlindError at the first check that fails.

    Checked are the seals of set and truths, and the ids, strata, effects and seeds of the plan. Position and size of
    every effect must be those that the seed of the case draws.
    """
    sealed, about = json.loads(held["commit"]), json.loads(held["set"])
    effects = effects or load_effects()
    _same(KEPT, "set", digest(held["set"].encode()), sealed["set_sha256"])
    plans = plan_cases(about["seed"], effects, about["full"], about.get("only") or None, _panel(about))
    plans = plans[: about.get("limit")]
    planned = {case_id(about["seed"], k): plan for k, plan in enumerate(plans)}
    _same(KEPT, "cases", sorted(sealed["cases"]), sorted(planned))
    truths = {}
    for case, plan in planned.items():
        text = held["truths"][case]
        _same(KEPT, case, digest(text.encode()), sealed["cases"][case]["truth_sha256"])
        truths[case] = truth = json.loads(text)
        _same(KEPT, case, (truth["stratum"], truth["seed"]), (plan.stratum, list(plan.seed)))
        drawn = stage(plan, effects)[3]
        said = [(e["kind"], e["rung"], e["where"], e["parameters"]) for e in truth["effects"]]
        _same(KEPT, case, said, [(d.kind, d.rung, _plain(d.where), _plain(d.parameters)) for d in drawn])
    return truths


def verify_recordings(held, case, folder):
    """BlindError if the files of a regenerated case below ``folder``/``case`` differ from the sealed ones."""
    _same(
        Path(folder) / case, "files", files_of(Path(folder) / case), json.loads(held["commit"])["cases"][case]["files"]
    )


def plan_of(held, case):
    """``CasePlan`` of an archived case."""
    truth = json.loads(held["truths"][case])
    return CasePlan(
        truth["stratum"], tuple((e["kind"], e["rung"]) for e in truth["effects"]), tuple(truth["seed"]), _panel(truth)
    )


def _panel(told):
    """Panel of a set or a case. Older sets had plain track only."""
    return told.get("panel", PLAIN)


def _plain(mapping):
    return json.loads(json.dumps(dict(mapping)))


def _same(path, where, found, wanted):
    if found != wanted:
        raise BlindError(path, where, "not what was sealed", "Take the kept set from its commit again")
