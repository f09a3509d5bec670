"""Rule simulate_hammer: a track in, one hammer test at a location out."""

from turnout.stages.simulate import write_hammer
from turnout.stages.simulate_request import hammer_request
from turnout.workflow.job_log import job_log

with job_log(snakemake.log[0]):
    for path, note in write_hammer(
        hammer_request(snakemake.input.track, snakemake.output.recording, snakemake.wildcards)
    ):
        print(path, note)
