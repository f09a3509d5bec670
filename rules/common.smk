"""What all stages share. A stage is one rule file that appends its name to STAGES, and one include line."""

from turnout.fingerprint import fingerprint

# Stages whose results go into the registry, in order, and the files that a whole run makes.
STAGES, TARGETS = [], []


wildcard_constraints:
    shard=r"\d{2,4}of\d{2,4}",


def stage_params(stage, own):
    """The function that computes a stage, and the version of its code; `--config chains=` names another one."""
    function = RUN.chains.get(stage, own)
    code = function.partition(":")[0]
    ours = code.partition(".")[0] == "turnout"
    return {
        "chain": function,
        "algo": fingerprint(code) if ours else function,
        "job": RUN.job,
    }


def shard_states(wildcards):
    """State files of all stages and of the shards that take part."""
    return expand("work/{stage}/{shard}.json", stage=STAGES, shard=RUN.shards)


def shard_threads():
    """Processes of a stage job: on one machine the shards share its cores, on a cluster each job has one."""
    return RUN.threads(workflow.resource_settings.cores)
