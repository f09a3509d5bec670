"""Rule simulate_passage: a track and a vehicle in, one passage and its truth out."""

from turnout.chains.simulate import passage_request, write_passage

request = passage_request(snakemake.input, snakemake.output, snakemake.wildcards)
for path, note in write_passage(request):
    print(path, note)
