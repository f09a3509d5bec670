"""Rule register: what all shards have computed goes into the registry."""

from turnout.workflow.jobs import register_job
from turnout.registry.register import register

register_job(register, snakemake.output[0], snakemake.log[0], snakemake.params)
