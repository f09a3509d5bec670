"""Rule simulate_passage: a track and a vehicle in, one passage and its truth out."""

from turnout.stages.simulate import passage_request, write_passage

request = passage_request(snakemake.input, snakemake.output, snakemake.wildcards)
for path, note in write_passage(request):
    print(path, note)
