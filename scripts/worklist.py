"""Rule worklist: charts, alarms and their diagnoses in; the worklist out."""

from turnout.stages.worklist import worklist_job
from turnout.workflow.job_log import job_log
from turnout.workflow.jobs import touch_after_publication
from turnout.workflow.retries import attempt

generation, params = "results/registry/_generation.json", snakemake.params
with job_log(snakemake.log[0]), attempt("worklist", params.again):
    with touch_after_publication(generation, [*snakemake.input.done], [snakemake.input.trend, "work/verdict.json"]):
        n = worklist_job(generation, snakemake.output[0], day=params.day)
    print(f"worklist: {n} diagnoses of alarms")
