"""Trends: after every registration all charts again, then the worklist."""

from pathlib import Path

TARGETS += ["work/trend.json", "results/worklist.csv"]
SILENCED = Path(RUN.job["configuration"]) / "acknowledgements.csv"
ACKNOWLEDGED = [str(SILENCED)] if SILENCED.exists() else []


rule trend:
    input:
        registry="results/registry/_generation.json",
        acknowledged=ACKNOWLEDGED,
    output:
        state=update("work/trend.json"),
    log:
        "logs/trend.log",
    benchmark:
        "logs/benchmarks/trend.tsv"
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=fingerprint("turnout.trend.update"),
        again=attempts("trend"),
        configuration=RUN.fleet_hash,
        acknowledgements=contents(ACKNOWLEDGED),
        job=RUN.job,
        day=RUN.day,
    script:
        "../scripts/trend_update.py"


rule worklist:
    input:
        trend="work/trend.json",
        done=alarms_diagnosed,
    output:
        update("results/worklist.csv"),
    log:
        "logs/worklist.log",
    benchmark:
        "logs/benchmarks/worklist.tsv"
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        code=fingerprint("turnout.stages.worklist"),
        again=attempts("worklist"),
        day=RUN.day,
    script:
        "../scripts/worklist.py"
