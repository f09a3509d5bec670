"""Pages: one for the fleet, one for each turnout, after the trends."""

TARGETS += ["results/pages/index.html"]


rule report:
    input:
        generation="results/registry/_generation.json",
        trend="work/trend.json",
        worklist="results/worklist.csv",
    output:
        update("results/pages/index.html"),
    log:
        "logs/report.log",
    benchmark:
        "logs/benchmarks/report.tsv"
    threads: workflow.resource_settings.cores or 1
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=fingerprint("turnout.report.job", "turnout.reasons"),
        again=attempts("report"),
        turnouts=RUN.job["only"],
        day=RUN.day,
    script:
        "../scripts/report.py"
