"""Rule simulate_passage: a track and a vehicle in, one passage and its truth out."""

from turnout.stages.simulate import write_passage
from turnout.stages.simulate_request import passage_request
from turnout.workflow.job_log import job_log

with job_log(snakemake.log[0]):
    request = passage_request(snakemake.input, snakemake.output, snakemake.wildcards)
    for path, note in write_passage(request):
        print(path, note)
