"""What all stages share. A stage is one rule file that appends its name to STAGES, and one include line.

The output of a stage is a mark that its job came to its end. What it has computed lies beside it, out of the reach of
Snakemake, which deletes the output of a job that fails.
"""

from pathlib import Path

from turnout.content import sha256_of
from turnout.fingerprint import fingerprint
from turnout.workflow.retries import attempts
from turnout.workflow.retries import read_postponed

# Stages whose results go into the registry, in order, and the files that a whole run makes.
STAGES, TARGETS = [], []
# Mark of the diagnoses of open alarms, one job for all shards.
DIAGNOSED = "work/change/00of01.done"


wildcard_constraints:
    shard=r"\d{2,4}of\d{2,4}",


def stage_params(stage, own):
    """The function that computes a stage, and the version of its code; `--config functions=` gives another one."""
    function = RUN.functions.get(stage, own)
    code = function.partition(":")[0]
    ours = code.partition(".")[0] == "turnout"
    return {
        "function": function,
        "algo": fingerprint(code) if ours else function,
        "job": RUN.job,
        "plan": plan_content,
        "again": jobs_that_left_units(stage),
    }


def plan_content(wildcards):
    """What the plan of a shard says: a job that read an older one runs again, whatever the clocks say."""
    return sha256_of(f"work/plan/{wildcards.shard}.json")


def contents(paths):
    """The same for files that people or other programs may change while a job runs."""
    return [sha256_of(path) for path in paths]


def jobs_that_left_units(stage):
    """For a shard, a number that grows with each job that left units for the next one: it makes that one run."""

    def of_shard(wildcards):
        return read_postponed(Path("work") / stage / f"{wildcards.shard}.json")[0]

    return of_shard


def shards_done(wildcards):
    """Marks of all stages and of the shards that take part; where no stage may run, those that are there."""
    marks = expand("work/{stage}/{shard}.done", stage=STAGES, shard=RUN.shards)
    only = workflow.dag_settings.allowed_rules
    return [mark for mark in marks if not only or Path(mark).exists()]


def shard_threads():
    """Processes of a stage job: on one machine the shards share its cores, on a cluster each job has one."""
    return RUN.threads(workflow.resource_settings.cores)


def alarms_diagnosed(wildcards):
    """Mark of the diagnoses of alarms; where that rule may not run, if it is there."""
    only = workflow.dag_settings.allowed_rules
    return [DIAGNOSED] if RUN.alarms and (not only or Path(DIAGNOSED).exists()) else []
