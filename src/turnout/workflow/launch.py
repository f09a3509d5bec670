"""Prepare the workflow before its first job: options, shards, plan files."""

import logging
import shlex
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from turnout.config import Configuration, load_configuration
from turnout.config.consistency import ToSi
from turnout.config.events import day_problem
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, TurnoutError
from turnout.files import write_text
from turnout.registry.generation import load
from turnout.workflow.configuration_rows import fleet_hash
from turnout.workflow.plan import shard_names, write_plans
from turnout.workflow.retries import request_rerun
from turnout.workflow.state import is_cut_state, states_below

OPTIONS = {
    "configuration": "folder with config.yaml, turnouts.tsv, layouts/",
    "raw": "raw root",
    "turnouts": "ids, with commas between them: only these are computed",
    "shards": "number of shards, instead of that in config.yaml",
    "strict": "true: raise faults of the program instead of noting them",
    "diagnose": "true: diagnose every turnout, whatever its settings say; false: none, and no open alarm either",
    "accept_vanished": "true: many known files are gone on purpose",
    "day": "YYYY-MM-DD: the day of list and pages, instead of today",
    "functions": "for each stage module:function, instead of the program's own",
}
PLAN_FOLDER = "work/plan"
# Start time of the newest run that reached its jobs, UTC. It is no input of a rule, so it causes no rerun.
REGISTRY = Path("results/registry")
LAUNCH_FILE = "work/launched"
RUN_LOCK = Path("work/.run.lock")
_HELD: dict[Path, FileLock] = {}  # locks of this process


@dataclass(frozen=True)
class Launch:
    """Parameters of a run.

    ``shards`` take part in it, ``every_shard`` names all; ``job`` are the parameters of stage jobs. ``diagnose`` says
    which turnouts are diagnosed: "every", those "enabled" in their settings, or "" for none; ``alarms``, whether open
    alarms are. ``learned`` are the files of clusters, calibrations and axle patterns used for passages. ``day``
    (YYYY-MM-DD) is that of worklist and pages, a parameter because what is suppressed, planned or not measured changes
    with it.
    """

    shards: list[str]
    every_shard: list[str]
    turnouts: tuple[str, ...] | None
    fleet_hash: str
    job: dict = field(default_factory=dict)
    diagnose: str = ""
    functions: Mapping[str, str] = field(default_factory=dict)
    learned: tuple[str, ...] = ()
    day: str = ""
    alarms: bool = True

    def threads(self, cores: int | None) -> int:
        """Processes per job when ``cores`` are shared among the shards.

        Parameters
        ----------
        cores : int or None
            Cores of the run; None: one.

        Returns
        -------
        int
            At least 1.
        """
        return max(1, (cores or 1) // len(self.shards))


def launch(options: Mapping, scan: bool, formats: Collection[str] | None = None, to_si: ToSi | None = None) -> Launch:
    """Read the configuration and, with ``scan``, update the plan files.

    ``options`` are those of ``snakemake --config``; ConfigErrors where they or the configuration are invalid. With
    ``scan`` no other run can begin in this folder until this process ends.

    Parameters
    ----------
    options : mapping
        Those of ``snakemake --config``, see ``OPTIONS``.
    scan : bool
        Scan the raw folders and write the plan files; False in a job.
    formats : collection of str or None
        Names of the readers; None: formats are not checked.
    to_si : callable or None
        Converts units, as ``turnout.units.to_si``; None: units of channels are not checked.

    Returns
    -------
    Launch
        Parameters of the run.

    Raises
    ------
    ConfigErrors
        If the configuration has errors.
    RegistryError
        If DuckDB can make no database in this folder, or the list of its files cannot be read.
    ConfigError
        If an option is invalid, or so many files are missing that a disk is probably not mounted.
    TurnoutError
        With ``scan``, if another run works in this folder.
    """
    for name in options:
        if name not in OPTIONS:
            raise ConfigError("--config", "option", f"unknown option {name!r}", suggestion(name, OPTIONS))
    configuration = load_configuration(options.get("configuration", "config"), formats, to_si, leave_out=True)
    turnouts = _turnouts(options.get("turnouts"), configuration)
    shards = _number(options.get("shards", configuration.settings["fleet"].shards))
    job: dict = {
        "configuration": str(options.get("configuration", "config")),
        "raw": str(options.get("raw", "raw")),
        "only": list(turnouts) if turnouts else [],
        "strict": _flag(options, "strict"),
    }
    if scan:
        for error in configuration.errors:
            logging.getLogger("turnout.workflow").warning("left out: %s", error)
        load(REGISTRY)  # before anything is computed for it: a list that cannot be read stops the run with its remedy
        _keep_other_runs_out()  # Snakemake's own lock comes too late: a rejected run would have replaced the plans
        started = datetime.now(UTC).replace(tzinfo=None)
        raw, accept = Path(job["raw"]), _flag(options, "accept_vanished")
        write_plans(configuration, raw, Path(PLAN_FOLDER), shards, turnouts, accept)
        for state in states_below(Path(PLAN_FOLDER).parent):
            is_in_use = state.stem in shard_names(shards) or state.parent.name == "change"
            if is_in_use and is_cut_state(state):
                request_rerun(state)
        write_text(Path(LAUNCH_FILE), started.isoformat(timespec="seconds"))
    day = _day(options.get("day"))
    names = shard_names(shards, turnouts)
    functions = dict(options.get("functions") or {})
    diagnosis = _diagnosis_scope(options, configuration)
    learned = _learned_files(configuration)
    alarms = "diagnose" not in options or _flag(options, "diagnose")
    return Launch(
        names, shard_names(shards), turnouts, fleet_hash(configuration), job, diagnosis, functions, learned, day, alarms
    )


def usable_configuration(folder: Path | str) -> Configuration:
    """The configuration of a run in one of its jobs: without the turnouts that have an error in theirs.

    Parameters
    ----------
    folder : Path or str
        Folder of the configuration.

    Returns
    -------
    Configuration
        With the errors in ``faulty``, the same as in ``launch``.

    Raises
    ------
    ConfigErrors
        If an error concerns the whole fleet, or no turnout is left.
    """
    from turnout.readers.formats import FORMATS
    from turnout.units import to_si

    return load_configuration(folder, FORMATS, to_si, leave_out=True)


def _keep_other_runs_out() -> None:
    """Hold this folder for the run until this process ends, however it ends; TurnoutError if another run holds it."""
    path = RUN_LOCK.resolve()
    if path in _HELD:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise TurnoutError(f"{RUN_LOCK} is held: another run works in this folder. Wait for it, or end it.") from None
    _HELD[path] = lock


def quote_interpreter() -> None:
    """Quote the path of the interpreter for Snakemake, which writes it into shell commands as it is.

    The path may have spaces. Only the process of Snakemake may call this: others start the interpreter by its path.
    """
    if " " in sys.executable and Path(sys.executable).exists():
        sys.executable = shlex.quote(sys.executable)


def _learned_files(configuration: Configuration) -> tuple[str, ...]:
    """Existing files of learned parameters that the settings of any turnout name, each once."""
    files: dict[Path, None] = {}
    for settings in _distinct_settings(configuration):
        passage_settings = settings["passage"]
        named = (
            Path(passage_settings.assets) / "clusters.json",
            Path(passage_settings.assets) / "loads.json",
            Path(passage_settings.axle_patterns),
        )
        files |= dict.fromkeys(named)
    return tuple(str(path) for path in files if path.is_file())


def launch_time() -> datetime | None:
    """Start time of the run that this job belongs to; None outside a run."""
    try:
        return datetime.fromisoformat(Path(LAUNCH_FILE).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None


def _day(value: Any) -> str:
    """The given day, else the day on which the run began, which is the same for all of its jobs."""
    if not value:
        return (launch_time() or datetime.now(UTC)).date().isoformat()
    if problem := day_problem(str(value)):
        raise ConfigError("--config", "day", f"{str(value)!r}{problem[0]}", problem[1])
    return date.fromisoformat(str(value)).isoformat()


def _diagnosis_scope(options: Mapping, configuration: Configuration) -> str:
    """Which turnouts are diagnosed: by the option, else by ``mismatch: enabled`` of any turnout."""
    if "diagnose" in options:
        return "every" if _flag(options, "diagnose") else ""
    return "enabled" if any(settings["mismatch"].enabled for settings in _distinct_settings(configuration)) else ""


def _distinct_settings(configuration: Configuration) -> list[Mapping]:
    """The different settings of all turnouts, each by its parts."""
    variants = {id(v): v for v in configuration.variants.values()}.values()
    return [variant.turnout_fields["settings"] for variant in variants]


def _turnouts(value: Any, configuration: Configuration) -> tuple[str, ...] | None:
    if value is None or value == "":
        return None
    ids = [str(t).strip() for t in (value if isinstance(value, list) else str(value).split(","))]
    for turnout in ids:
        configuration.turnout(turnout)
    return tuple(sorted(set(ids)))


def _number(value: Any) -> int:
    if not isinstance(value, int) or not 1 <= value <= 4096:
        raise ConfigError("--config", "shards", repr(value), "Write a whole number from 1 to 4096")
    return value


def _flag(options: Mapping, name: str) -> bool:
    """An option that is true or false; Snakemake passes some spellings on as text."""
    value = str(options.get(name, False)).lower()
    if value not in ("true", "false"):
        raise ConfigError("--config", name, repr(options[name]), "Write true or false")
    return value == "true"
