"""Rule trend: the registry as it stands in; every chart and alarm out."""

from turnout.arrow_memory import use_system_allocator

use_system_allocator()

from turnout.stages.trend import trend_job  # noqa: E402
from turnout.workflow.job_log import job_log  # noqa: E402
from turnout.workflow.retries import attempt  # noqa: E402

with job_log(snakemake.log[0]), attempt("trend", snakemake.params.again):
    configuration, day = snakemake.params.job["configuration"], snakemake.params.day
    rows = trend_job(snakemake.input.registry, snakemake.output.state, configuration, day)["rows"]
    print(f"trend: {', '.join(f'{n} rows of {table}' for table, n in rows.items())}")
