"""Diagnosis of mismatches: the newest visit of each turnout that asks for it, from raw files to findings.

`snakemake --config diagnose=true` asks for every turnout, `mismatch: enabled: true` in the settings for some.
"""

from pathlib import Path

if RUN.diagnose:
    STAGES.append("mismatch")
MODELS = [
    p
    for kind in ("tracks", "vehicles")
    for p in sorted(Path(RUN.job["configuration"]).glob(f"{kind}/[!.]*.yaml"))
]


rule mismatch:
    input:
        plan="work/plan/{shard}.json",
        passage="work/passage/{shard}.done",
        models=MODELS,
    output:
        done="work/mismatch/{shard}.done",
    log:
        "logs/mismatch/{shard}.log",
    benchmark:
        "logs/benchmarks/mismatch/{shard}.tsv"
    threads: shard_threads()
    resources:
        mem_mb=4000,
        runtime=1440,
    params:
        **stage_params("mismatch", "turnout.stages.mismatch:mismatch_unit"),
        kind="mismatch",
        models=contents(MODELS),
        context="turnout.stages.mismatch_inputs:mismatch_context",
        gather=f"turnout.stages.mismatch_groups:{RUN.diagnose or 'enabled'}_visit",
    script:
        "../scripts/stage.py"
