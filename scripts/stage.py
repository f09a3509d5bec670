"""Rule of any stage: the plan of one shard in, its new units computed, its mark out."""

from turnout.threads import use_one_thread

use_one_thread()

from turnout.workflow.job_log import job_log  # noqa: E402
from turnout.workflow.jobs import stage_job  # noqa: E402

with job_log(snakemake.log[0]):
    stage_job(snakemake.input.plan, snakemake.output.done, snakemake.params, snakemake.threads)
