"""Make a blind set: campaigns in one folder, sealed truths in another."""

import secrets
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from turnout_blind.campaign import make_case
from turnout_blind.effect import load_effects
from turnout_blind.seal import BlindError, commit, write_truth
from turnout_blind.strata import case_id, plan_cases


def make_set(out, truth, seed=None, full=True, folders=(), only=None, limit=None, workers=1, progress=None):
    """Write ``out``/cases, ``out``/commit.json and the truths below ``truth``; returns the SHA-256 of commit.json.

    Parameters
    ----------
    out, truth : path
        Folders; ``truth`` must not lie inside ``out``, which is what the tool is given.
    seed : int or None
        The same seed gives the same recordings; None draws one. The nonces are always drawn anew.
    full : bool
        All strata, or the fast tier of 40.
    folders : iterable of path
        Folders with effects of your own, one per file.
    only, limit : iterable of str, int
        Kinds to keep beside the controls; the first so many cases of the shuffled set.
    workers : int
        Processes.

    Errors: BlindError where ``truth`` lies inside ``out`` or ``out`` holds a set already.
    """
    out, truth = Path(out).resolve(), Path(truth).resolve()
    if truth.is_relative_to(out):
        raise BlindError(truth, "--truth", "inside the folder that the tool is given", "Choose a folder beside it")
    if (out / "cases").exists():
        raise BlindError(out, "cases", "a set is there already", "Choose another folder, or remove it")
    seed = secrets.randbits(63) if seed is None else int(seed)
    plans = plan_cases(seed, load_effects(*folders), full, only)[:limit]
    jobs = [(out / "cases", case_id(seed, k), plan, tuple(map(str, folders))) for k, plan in enumerate(plans)]
    truths = {"set": write_truth(truth, "set", {"seed": seed, "cases": len(jobs), "full": full})}
    with ProcessPoolExecutor(workers) as pool:
        for made in (progress or iter)(pool.map(_make, jobs)):
            truths[made["case"]] = write_truth(truth, made["case"], made)
    return commit(out, truths)


def _make(job):
    folder, case, plan, folders = job
    return make_case(folder, case, plan, load_effects(*folders))
