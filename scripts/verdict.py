"""Rule verdict: fails, after the registry is out, where too much of what is new cannot be trusted."""

from turnout.workflow.job_log import job_log
from turnout.workflow.jobs import verdict_job

with job_log(snakemake.log[0]):
    verdict_job(snakemake.input.done, snakemake.output[0], snakemake.params)
