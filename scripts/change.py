"""Rule change: open alarms in, what their sections show to have changed out."""

from turnout.threads import use_one_thread

use_one_thread()

from pathlib import Path  # noqa: E402

from turnout.workflow.job_log import job_log  # noqa: E402
from turnout.workflow.jobs import stage_job  # noqa: E402

with job_log(snakemake.log[0]):
    stage_job(Path("work/plan"), snakemake.output.done, snakemake.params, snakemake.threads)
