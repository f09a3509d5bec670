"""Rule verdict: fails, after the registry is out, where too much of what is new cannot be trusted."""

from turnout.workflow.jobs import verdict_job

verdict_job(snakemake.input.done, snakemake.output[0], snakemake.log[0], snakemake.params)
