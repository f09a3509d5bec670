"""Hammer tests: the units of one shard, from raw files to rows."""

STAGES.append("hammer")


rule hammer:
    input:
        plan="work/plan/{shard}.json",
    output:
        done="work/hammer/{shard}.done",
    log:
        "logs/hammer/{shard}.log",
    benchmark:
        "logs/benchmarks/hammer/{shard}.tsv"
    threads: shard_threads()
    resources:
        mem_mb=1000,
        runtime=120,
    params:
        **stage_params("hammer", "turnout.stages.hammer:hammer_unit"),
        kind="hammer",
    script:
        "../scripts/stage.py"
