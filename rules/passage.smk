"""Train passages: the files of one shard, from raw files to rows, with the models that the hammer stage left."""

STAGES.append("passage")


rule passage:
    input:
        plan="work/plan/{shard}.json",
        hammer="work/hammer/{shard}.done",
        learned=RUN.learned,
    output:
        done="work/passage/{shard}.done",
    log:
        "logs/passage/{shard}.log",
    benchmark:
        "logs/benchmarks/passage/{shard}.tsv"
    threads: shard_threads()
    resources:
        mem_mb=2000,
        runtime=240,
    params:
        **stage_params("passage", "turnout.stages.passage:passage_unit"),
        kind="passage",
        learned=contents(RUN.learned),
        context="turnout.stages.passage_context:passage_context",
    script:
        "../scripts/stage.py"
