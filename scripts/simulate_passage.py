"""Rule simulate_passage: a track and a vehicle in, one passage and its truth out."""

from turnout.stages.simulate import write_passage
from turnout.stages.simulate_request import passage_request

request = passage_request(snakemake.input, snakemake.output, snakemake.wildcards)
for path, note in write_passage(request):
    print(path, note)
