"""Simulated recordings on request: `snakemake simulated/tommerup/passages/ic3_160_main_facing_1.h5`."""

SIMULATED_CODE = fingerprint("turnout.stages.simulate")


wildcard_constraints:
    track=r"[A-Za-z0-9_]+",
    vehicle=r"[a-z0-9_]+",
    location=r"[A-Za-z0-9]+",
    speed=r"\d+",
    route=r"[a-z]+",
    direction="facing|trailing",
    seed=r"\d+",


rule simulate_hammer:
    input:
        track="config/tracks/{track}.yaml",
    output:
        recording="simulated/{track}/hammer/{location}_{seed}.h5",
    log:
        "logs/simulate_hammer/{track}_{location}_{seed}.log",
    benchmark:
        "logs/benchmarks/simulate_hammer/{track}_{location}_{seed}.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=SIMULATED_CODE,
    script:
        "../scripts/simulate_hammer.py"


rule simulate_passage:
    input:
        track="config/tracks/{track}.yaml",
        vehicle="config/vehicles/{vehicle}.yaml",
    output:
        recording="simulated/{track}/passages/{vehicle}_{speed}_{route}_{direction}_{seed}.h5",
        truth="simulated/{track}/truth/{vehicle}_{speed}_{route}_{direction}_{seed}.json",
    log:
        "logs/simulate_passage/{track}_{vehicle}_{speed}_{route}_{direction}_{seed}.log",
    benchmark:
        "logs/benchmarks/simulate_passage/{track}_{vehicle}_{speed}_{route}_{direction}_{seed}.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=SIMULATED_CODE,
    script:
        "../scripts/simulate_passage.py"
