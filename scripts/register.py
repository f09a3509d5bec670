"""Rule register: what all shards have computed goes into the registry."""

from turnout.arrow_memory import use_system_allocator

use_system_allocator()

from turnout.registry.job import register  # noqa: E402
from turnout.workflow.job_log import job_log  # noqa: E402
from turnout.workflow.jobs import register_job  # noqa: E402

with job_log(snakemake.log[0]):
    register_job(register, snakemake.output[0], snakemake.params)
