"""Diagnosis of change of every group of sections with an open alarm, after the trends and before the list.

One job for the fleet, since few sections have an open alarm. `snakemake --config diagnose=false` leaves it out.
"""

from pathlib import Path


rule change:
    input:
        trend="work/trend.json",
        plans=expand("work/plan/{shard}.json", shard=RUN.shards),
        models=MODELS,
    output:
        done=DIAGNOSED,
    log:
        "logs/change.log",
    benchmark:
        "logs/benchmarks/change.tsv"
    threads: workflow.resource_settings.cores or 1
    resources:
        mem_mb=4000,
        runtime=1440,
    params:
        kind="change",
        function=RUN.functions.get(
            "change", "turnout.stages.change_diagnosis:change_unit"
        ),
        algo=fingerprint("turnout.stages.change_diagnosis"),
        job=RUN.job,
        again=lambda wildcards: read_postponed(Path("work/change/00of01.json"))[0],
        models=contents(MODELS),
        context="turnout.stages.mismatch_inputs:mismatch_context",
        gather="turnout.stages.change_units:alarmed_groups",
    script:
        "../scripts/change.py"
