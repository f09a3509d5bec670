"""Make a blind set: campaigns in one folder, sealed truths in another. An interrupted run can be continued."""

from __future__ import annotations

import json
import os
import platform
import secrets
import shutil
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING

import turnout
from turnout_blind.campaign import make_case
from turnout_blind.effect import load_effects
from turnout_blind.history import HistoryPlan, make_history, plan_histories
from turnout_blind.seal import SET_FILE, BlindError, digest, digest_of_folder, seed_for, write_commit, write_truth
from turnout_blind.site import CROSSING, PLAIN
from turnout_blind.strata import CasePlan, case_id, plan_cases

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from typing import Any

# folder of the cases, folder of the truths, id, plan, folders with further effects, seed of the set
Job = tuple[Path, Path, str, CasePlan | HistoryPlan, tuple[str, ...], int]
# entries of set.json that options state
OPTIONS = {
    "seed": "--seed", "full": "--fast", "effects": "--effects-folder", "only": "--only", "limit": "--limit",
    "panel": "--panel", "histories": "--histories and --passages",
}  # fmt: skip


def make_set(
    out: str | Path,
    truth: str | Path,
    seed: int | str | None = None,
    full: bool = True,
    folders: Sequence[str | Path] = (),
    only: Collection[str] | None = None,
    limit: int | None = None,
    panel: str = PLAIN,
    workers: int = 1,
    progress: Callable[..., Iterable] | None = None,
    histories: tuple[int, int] | None = None,
    pool: Callable[[int], Executor] | None = None,
) -> str:
    """Write ``out``/cases, ``out``/commit.json and the truths below ``truth``.

    Parameters
    ----------
    out, truth : path
        Folders; ``truth`` must not lie inside ``out``, which is what the tool is given.
    seed : int, "tool" or None
        The same seed gives the same recordings and seals. None draws one. "tool" derives it from the hash of the
        sources of the installed tool. Such a set exists no earlier than the tool that it examines, and no other tool
        may diagnose it. Nobody chose it, and everybody can make it.
    full : bool
        All strata, or the fast tier of 40 cases.
    folders : iterable of path
        Folders with further effects, one per file.
    only, limit : iterable of str, int
        Kinds of effects beside the controls; number of cases taken from the start of the shuffled set.
    panel : str
        Panel of all cases, one of ``turnout_blind.site.PANELS``.
    workers : int
        Number of processes.
    progress : callable or None
        (iterable of finished cases, their number) -> iterable.
    histories : (int, int) or None
        Number of sites with a history of two years, and of passages at each visit; None: single campaigns. They have
        no fast tier and no choice of kinds. Half of them are in crossing panels, or all in switch panels.
    pool : callable or None
        Number of processes -> executor; None: that of the standard library, which completes all cases if interrupted.

    Returns
    -------
    str
        SHA-256 of commit.json.

    Raises
    ------
    BlindError
        If ``truth`` lies inside ``out``, if ``out`` holds a complete set already, if an interrupted set was started
        with other options or other sources, or if histories are to have what they cannot have.
    """
    out, truth = Path(out).resolve(), Path(truth).resolve()
    if truth.is_relative_to(out):
        raise BlindError(truth, "--truth", "inside the folder that the tool is given", "Choose a folder beside it")
    if (out / "commit.json").exists():
        raise BlindError(out, "cases", "a set is there already", "Choose another folder, or remove it")
    if histories is not None:
        _check_histories(full, only, panel)
    examines = digest_of_folder(Path(turnout.__file__).parent) if seed == "tool" else None
    if unknown := sorted(set(only or ()) - set(load_effects(*folders))):
        available = ", ".join(sorted(load_effects(*folders)))
        raise BlindError("--only", unknown[0], "no such kind", f"There are {available}")
    set_info = _open_set(truth, seed_for(examines) if examines else seed, full, folders, only, limit, panel, histories)
    set_seed: int = set_info["seed"]
    library, plans = load_effects(*folders), list[CasePlan | HistoryPlan]()
    if histories is None:
        plans += plan_cases(set_seed, library, full, only, panel)[:limit]
    else:
        plans += plan_histories(set_seed, histories[0], library, histories[1], panel=panel)[:limit]
    effect_folders = tuple(map(str, folders))
    jobs: list[Job] = [
        (out / "cases", truth, case_id(set_seed, k), plan, effect_folders, set_seed) for k, plan in enumerate(plans)
    ]
    pending = [job for job in jobs if not _is_made(job)]
    with (pool or ProcessPoolExecutor)(workers) as executor:
        futures = [executor.submit(_make, job) for job in pending]
        for future in (progress or (lambda finished, total: finished))(as_completed(futures), len(futures)):
            future.result()
    shutil.rmtree(out / "unfinished", ignore_errors=True)
    truths = {"set": digest((truth / SET_FILE).read_bytes())}
    truths |= {job[2]: digest((truth / f"{job[2]}.json").read_bytes()) for job in jobs}
    return write_commit(out, truths, examines)


def _check_histories(full: bool, only: Collection[str] | None, panel: str) -> None:
    """Reject what sites with a history cannot have."""
    remedy = "Histories have kinds of their own, half of them in crossing panels, or all with --panel switch"
    unusable = {"--fast": not full, "--only": bool(only), "--panel crossing": panel == CROSSING}
    for option in [name for name, is_given in unusable.items() if is_given]:
        raise BlindError("--histories", option, "a set of histories does not have this option", remedy)


def _open_set(
    truth: Path,
    seed: int | str | None,
    full: bool,
    folders: Iterable[str | Path],
    only: Iterable[str] | None,
    limit: int | None,
    panel: str,
    histories: tuple[int, int] | None,
) -> dict[str, Any]:
    """Content of set.json: seed and options of an interrupted set, or written now."""
    settings = {"full": full, "effects": sorted(map(str, folders)), "only": sorted(only or ()), "limit": limit}
    settings |= {
        "panel": panel,
        "generator_sha256": digest_of_folder(Path(__file__).parent, "*.py"),
        "made_on": platform.machine(),
        **({"histories": list(histories)} if histories else {}),
    }
    path = truth / SET_FILE
    if not path.exists():
        seed = secrets.randbits(63) if seed is None else int(seed)
        write_truth(truth, "set", {"seed": seed, **settings}, seed)
        return json.loads(path.read_bytes())
    set_info = json.loads(path.read_bytes())
    settings["seed"] = set_info["seed"] if seed is None else int(seed)
    settings.setdefault("histories", None)
    for name, value in settings.items():
        if set_info.get(name) != value:
            before, now = _value_text(name, set_info.get(name)), _value_text(name, value)
            problem = f"begun otherwise: {before}" + ("" if now == before else f", now {now}")
            raise BlindError(path, OPTIONS.get(name, name), problem, "Go on as it was begun, or remove both folders")
    return set_info


def _value_text(name: str, value: Any) -> str:
    """A value of set.json as its option states it, such as "2 and 1" for histories."""
    if name == "seed":  # it tells the concealed effects
        return "another seed"
    if name == "full":
        return "without it" if value else "with it"
    if name == "generator_sha256":
        return f"sources {str(value)[:12]}"
    return (
        " and ".join(map(str, value)) or "none" if isinstance(value, list) else "none" if value is None else str(value)
    )


def _is_made(job: Job) -> bool:
    cases, truth, case, *_ = job
    return (cases / case).is_dir() and (truth / f"{case}.json").exists()


def _make(job: Job) -> str:
    """Make a case in a temporary folder, write its truth, then move it: an incomplete case is never taken for one."""
    cases, truth, case, plan, folders, seed = job
    temporary = cases.parent / "unfinished"
    shutil.rmtree(temporary / case, ignore_errors=True)
    if isinstance(plan, HistoryPlan):
        case_truth = make_history(temporary, case, plan, load_effects(*folders))
    else:
        case_truth = make_case(temporary, case, plan, load_effects(*folders))
    write_truth(truth, case, case_truth, seed)
    cases.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(cases / case, ignore_errors=True)
    os.replace(temporary / case, cases / case)
    return case
