"""Run the jobs of the workflow with the parameters that their scripts get from Snakemake."""

import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from turnout import __version__
from turnout.errors import TurnoutError
from turnout.files import changed_at, write_text
from turnout.workflow.batches import read_results
from turnout.workflow.configuration_rows import configuration_rows, keep_rows
from turnout.workflow.current_results import DamagedBatch
from turnout.workflow.duplicate_files import files_at_two_turnouts, withdraw_moved
from turnout.workflow.launch import launch_time, usable_configuration
from turnout.workflow.quality_gate import QualityGate, check_quality
from turnout.workflow.registry_damage import note_repair
from turnout.workflow.retries import attempt, request_rerun
from turnout.workflow.shard import Summary, run_shard
from turnout.workflow.state import batch_paths, state_of, state_of_mark
from turnout.workflow.tasks import Stage


def stage_job(plan: PathLike | str, mark: PathLike | str, params: Any, threads: int) -> Summary:
    """Run one stage of one shard and write its mark; the state file is in the same folder.

    Parameters
    ----------
    plan : path-like
        Plan file of the shard.
    mark : path-like
        Mark of the shard, the output of the rule.
    params : Params
        kind, function, algo, job and, where needed, context and gather.
    threads : int
        Processes that may run at a time.

    Returns
    -------
    Summary
        Numbers of units.

    Raises
    ------
    DamagedBatch
        If results of another stage cannot be read; they are computed again in the next run.
    TurnoutError
        If the configuration or the state of the shard cannot be used.
    """
    stage = Stage(params.kind, params.function, params.algo, params.get("context"), params.get("gather"))
    job = params.job
    configuration = usable_configuration(job["configuration"])
    try:
        summary = run_shard(
            Path(plan), state_of_mark(mark), stage, configuration, Path(job["raw"]),
            threads=threads, only=job["only"] or None, strict=job["strict"], launched=launch_time(),
        )  # fmt: skip
    except DamagedBatch as error:
        request_rerun(state_of(error.batch))
        raise
    _report(summary)
    write_text(mark, f"{summary}\n")
    return summary


def verdict_job(marks: Iterable[PathLike | str], output: PathLike | str, params: Any) -> QualityGate:
    """Check the quality of the run.

    Parameters
    ----------
    marks : iterable of path-like
        Marks of all shards of the stages that are judged.
    output : path-like
        File of the judged batches.
    params : Params
        job, again.

    Returns
    -------
    QualityGate
        Numbers of new units and complaints.

    Raises
    ------
    SystemExit
        With 1 if the run fails.
    """
    states = [state_of_mark(mark) for mark in marks]
    try:
        with attempt("verdict", params.again):
            gate = check_quality(states, usable_configuration(params.job["configuration"]), Path(output))
    except TurnoutError as error:
        _report(error)
        raise SystemExit(1) from None
    _report(gate)
    return gate


MAX_SHARED_SHOWN = 10  # files that are at two turnouts in the log; the registry names all


def register_job(register: Callable, generation: PathLike | str, params: Any) -> None:
    """Register the batches of all shards, including those that take no part in this run.

    Before that, units that were moved to a turnout of another shard are withdrawn from the old one. Hammer files that
    are at two turnouts get a remark.

    Parameters
    ----------
    register : callable
        ``turnout.registry.job.register``, or a function with its arguments.
    generation : path-like
        Generation file of the registry, the output of the rule.
    params : Params
        job, stages, shards, configuration, again, damage.
    """
    configuration = usable_configuration(params.job["configuration"])
    plans = [Path("work/plan") / f"{shard}.json" for shard in params.shards]
    states = [Path("work") / stage / f"{shard}.json" for stage in params.stages for shard in params.shards]
    tables = configuration_rows(configuration, Path(params.job["raw"]), plans)
    keep_rows(tables, configuration, Path(generation).parent)
    with attempt("register", params.again):
        published = changed_at(Path(generation))
        withdraw_moved(Path("work"), params.stages, params.shards, configuration.settings["fleet"], published)
        shared = files_at_two_turnouts(Path("work"), params.stages, params.shards)
        tables["quarantine"] += shared
        result = register(
            batch_paths(states), Path(generation).parent, read=read_results, tables=tables,
            config_hash=params.configuration, code_version=__version__, started_at=launch_time(),
        )  # fmt: skip
    note_repair(params.damage)
    os.utime(generation)
    log_of_run = logging.getLogger("turnout.workflow")
    for batch, fault in result.faults.items():
        log_of_run.warning("%s: %s", batch, fault)
    for row in shared[:MAX_SHARED_SHOWN]:
        log_of_run.warning("%s: %s. %s.", row["path"], row["found"], row["remedy"])
    _report(f"register: {result.n_units} units, {sum(result.rows.values())} rows, {result.n_rejected} rejected")


@contextmanager
def touch_after_publication(
    generation: PathLike | str, done: Iterable[PathLike | str], outputs: Iterable[PathLike | str]
) -> Iterator[None]:
    """Keep the order of times where a job publishes what it has computed from results of the same registry.

    The generation must not be older than the marks of the results that are in it, and the outputs of jobs that read an
    earlier generation must not be older than the new one: they would all run again in the next night.

    Parameters
    ----------
    generation : path-like
        Generation file of the registry, which the block may replace.
    done : iterable of path-like
        Marks of the results.
    outputs : iterable of path-like
        Outputs of jobs that read the generation before, named as their rules; those that are missing stay so.
    """
    before, marks = changed_at(Path(generation)), [Path(path) for path in done]
    yield
    if any(changed_at(mark) > changed_at(Path(generation)) for mark in marks):
        os.utime(generation)
    if changed_at(Path(generation)) != before:
        read_before = [Path(path) for path in outputs]
        # Snakemake takes the time of a job's benchmark for that of an output
        benchmarks = [Path("logs/benchmarks") / f"{path.stem}.tsv" for path in read_before]
        for path in (*read_before, *benchmarks, *marks):
            if path.exists():
                os.utime(path)


def _report(what: Any) -> None:
    logging.getLogger("turnout.workflow").info("%s", what)
    print(what, file=sys.stderr, flush=True)
