"""The registry: one job takes in what all shards have computed, then the run is judged."""

from turnout.workflow.registry_damage import repair_request

TARGETS += ["results/registry/_generation.json", "work/verdict.json"]


rule register:
    input:
        done=shards_done,
        plans=expand("work/plan/{shard}.json", shard=RUN.shards),
    output:
        update("results/registry/_generation.json"),
    log:
        "logs/register.log",
    benchmark:
        "logs/benchmarks/register.tsv"
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=fingerprint("turnout.registry.job", "turnout.reasons"),
        again=attempts("register"),
        # files that changed on the disk make the job run, which restores their rows
        damage=lambda wildcards: repair_request("results/registry"),
        stages=STAGES,
        shards=RUN.every_shard,
        configuration=RUN.fleet_hash,
        job=RUN.job,
    script:
        "../scripts/register.py"


rule verdict:
    input:
        "results/registry/_generation.json",
        done=shards_done,
    output:
        update("work/verdict.json"),
    log:
        "logs/verdict.log",
    benchmark:
        "logs/benchmarks/verdict.tsv"
    retries: 0
    resources:
        mem_mb=500,
        runtime=10,
    params:
        again=attempts("verdict"),
        job=RUN.job,
    script:
        "../scripts/verdict.py"
