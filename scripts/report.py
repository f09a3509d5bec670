"""Rule report: the registry in, pages out."""

from pathlib import Path

from turnout.report.job import report_job
from turnout.workflow.job_log import job_log
from turnout.workflow.retries import attempt

registry, pages = (str(Path(p).parent) for p in (snakemake.input.generation, snakemake.output[0]))
params = snakemake.params
with job_log(snakemake.log[0]), attempt("report", params.again):
    report_job(registry, pages, params.turnouts, snakemake.threads, params.day, progress=False)
