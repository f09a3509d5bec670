"""Rule trend: the registry as it stands in; every chart, alarm and the worklist out."""

import logging

from turnout.chains.trend import trend_job

logging.basicConfig(filename=snakemake.log[0], filemode="w", level="INFO", format="%(levelname)s %(message)s")
print(trend_job(snakemake.input.registry, *snakemake.output, snakemake.params.job["configuration"])["rows"])
