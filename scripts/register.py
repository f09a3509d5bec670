"""Rule register: what all shards have computed goes into the registry."""

from turnout.registry.job import register
from turnout.workflow.jobs import register_job

register_job(register, snakemake.output[0], snakemake.log[0], snakemake.params)
